//! The event rate over a focus sweep: two humps with a dip at focus when nothing moves, one peak when the scene does.
//!
//! The figures are those of the notes on sensor and optics, section 3, made with another program: dead leaves on 160 x 120
//! pixels, 0.015 px per count, thresholds 0.2, the range in 2 s, events in bins of 40 counts about focus. There: light 1732
//! at -340, 0 at +60, 1238 at +380, ON 0.25 / 0.85; dark 2820 at -260, 0.47 of it at +60, 2588 at +340; moving one peak of
//! 5500 (light) and 6100 (dark) at +-20.

use crate::sweep::{SweepCurve, section_three, sweep_curve};
use hil_sim::{Light, MotionConfig, RigConfig, Scene, SensorConfig};

fn show(name: &str, curve: &SweepCurve) {
    println!("{name}: {curve}");
}

/// The value is within the bounds, or the test fails with its name.
fn within(name: &str, value: f64, low: f64, high: f64) {
    assert!(value >= low && value <= high, "{name} is {value}, not within {low} and {high}");
}

#[test]
fn static_scene_in_light_has_two_humps() {
    let curve = sweep_curve(&section_three(Light::Light));
    show("static light", &curve);
    let (before, after) = (curve.peak(-800.0, 0.0).1, curve.peak(0.0, 800.0).1);
    let dip = curve.dip(-200.0, 300.0);
    within("first hump", f64::from(before), 1400.0, 2100.0);
    within("its place", curve.hump(-800.0, 0.0), -420.0, -220.0);
    within("second hump", f64::from(after), 1000.0, 1550.0);
    within("its place", curve.hump(0.0, 800.0), 320.0, 560.0);
    within("first over second", f64::from(before) / f64::from(after), 1.15, 1.7);
    within("dip", f64::from(dip.1) / f64::from(before), 0.0, 0.03);
    within("place of the dip", dip.0, 0.0, 100.0);
    within("ON share before", curve.on_share(-800.0, 0.0), 0.20, 0.34);
    within("ON share after", curve.on_share(0.0, 800.0), 0.75, 0.9);
}

#[test]
fn static_scene_in_the_dark_has_two_humps_on_a_floor_of_noise() {
    let curve = sweep_curve(&section_three(Light::Dark));
    show("static dark", &curve);
    let (before, after) = (curve.peak(-800.0, 0.0).1, curve.peak(0.0, 800.0).1);
    let dip = curve.dip(-200.0, 300.0);
    within("first hump", f64::from(before), 2400.0, 3500.0);
    within("its place", curve.hump(-800.0, 0.0), -420.0, -180.0);
    within("second hump", f64::from(after), 2100.0, 3000.0);
    within("first over second", f64::from(before) / f64::from(after), 1.05, 1.4);
    within("dip", f64::from(dip.1) / f64::from(before), 0.38, 0.55);
    within("place of the dip", dip.0, 20.0, 150.0);
    within("ON share before", curve.on_share(-800.0, 0.0), 0.32, 0.45);
    within("ON share after", curve.on_share(0.0, 800.0), 0.54, 0.68);
}

#[test]
fn moving_scene_has_one_peak() {
    for (light, height) in [(Light::Light, 5500.0), (Light::Dark, 6100.0)] {
        let config = RigConfig { motion: MotionConfig::moving(25.0), ..section_three(light) };
        let curve = sweep_curve(&config);
        show("moving", &curve);
        let peak = curve.peak(-1500.0, 1500.0);
        within("peak", f64::from(peak.1), height * 0.8, height * 1.25);
        within("its place", curve.hump(-1500.0, 1500.0), -60.0, 60.0);
        // No dip: what lies between the middle and the flanks falls steadily.
        for (inner, outer) in [(100.0, 300.0), (300.0, 500.0), (500.0, 700.0), (700.0, 900.0)] {
            for (inner, outer) in [(inner, outer), (-inner, -outer)] {
                let at = |offset: f64| curve.peak(offset - 40.0, offset + 40.0).1;
                assert!(at(inner) > at(outer), "{inner} to {outer} rises");
            }
        }
        assert!(curve.on_share(-800.0, 0.0) < 0.5 && curve.on_share(0.0, 800.0) > 0.5);
    }
}

#[test]
fn thresholds_that_differ_raise_the_hump_of_the_lower_one() {
    let base = section_three(Light::Light);
    let ratio = |on_threshold, off_threshold| {
        let sensor = SensorConfig { on_threshold, off_threshold, ..base.sensor.clone() };
        let curve = sweep_curve(&RigConfig { sensor, ..base.clone() });
        f64::from(curve.peak(0.0, 800.0).1) / f64::from(curve.peak(-800.0, 0.0).1)
    };
    // Towards focus OFF events prevail, away from it ON events.
    let (even, low_on, low_off) = (ratio(0.2, 0.2), ratio(0.15, 0.25), ratio(0.25, 0.15));
    println!("second hump over first: {even:.2}, {low_on:.2} with ON 0.15, {low_off:.2} with OFF 0.15");
    assert!(low_on > 1.15 * even && low_off < 0.9 * even);
}

#[test]
fn two_depths_have_a_dip_each() {
    let config = RigConfig { scene: Scene::TwoDepths, ..section_three(Light::Light) };
    let curve = sweep_curve(&config);
    show("two depths", &curve);
    let between = f64::from(curve.peak(250.0, 650.0).1);
    within("dip of the first", f64::from(curve.dip(-100.0, 200.0).1) / between, 0.0, 0.9);
    within("dip of the second", f64::from(curve.dip(700.0, 1000.0).1) / between, 0.0, 0.9);
}

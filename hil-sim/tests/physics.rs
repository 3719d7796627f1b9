//! The event rate over a focus sweep: two humps with a dip at focus when nothing moves, one peak when the scene does.
//!
//! The figures are those of the notes on sensor and optics, section 3, made with another program: dead leaves on 160 x 120
//! pixels, 0.015 px per count, thresholds 0.2, the range in 2 s, events in bins of 40 counts about focus.

use crate::sweep::{SweepCurve, section_three, sweep_curve};
use hil_sim::{Light, MotionConfig, RigConfig};

fn show(name: &str, curve: &SweepCurve) {
    println!("{name}: {curve}");
}

#[test]
fn static_scene_in_light_has_two_humps() {
    let curve = sweep_curve(&section_three(Light::Light));
    show("static light", &curve);
}

#[test]
fn static_scene_in_the_dark_has_two_humps_on_a_floor_of_noise() {
    let curve = sweep_curve(&section_three(Light::Dark));
    show("static dark", &curve);
}

#[test]
fn moving_scene_has_one_peak() {
    for light in [Light::Light, Light::Dark] {
        let config = RigConfig { motion: MotionConfig::moving(25.0), ..section_three(light) };
        show("moving", &sweep_curve(&config));
    }
}

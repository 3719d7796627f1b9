//! Pixels that work otherwise than ours: each part can be seen in the events, and the models as a whole in a sweep.

use hil_sim::{Light, Logarithm, RigConfig, SensorConfig};

use crate::sensor::{by_pixel, flickering, quiet, second, with};
use crate::sweep::{section_three, sweep_curve};

#[test]
fn a_source_follower_takes_more_of_the_flicker() {
    let count = |hertz| second(&with(flickering(), |sensor| sensor.source_follower_hz = hertz)).0.len();
    let (none, fast, slow) = (count(None), count(Some(1e5)), count(Some(40.0)));
    println!("{none} events, {fast} behind a fast follower, {slow} behind a slow one");
    assert!(fast.abs_diff(none) * 50 < none);
    assert!(slow * 10 < none * 7);
}

/// Mean and relative spread of the intervals between a pixel's events under leak, ms.
fn intervals(jitter: f64) -> (f64, f64) {
    let config = with(quiet(), |sensor| (sensor.leak_hz, sensor.threshold_jitter) = (10.0, jitter));
    let pixels = by_pixel(&second(&config).0);
    let intervals: Vec<f64> = pixels
        .values()
        .flat_map(|times| times.windows(2).map(|pair| (pair[1] - pair[0]) as f64 / 1000.0))
        .collect();
    let mean = intervals.iter().sum::<f64>() / intervals.len() as f64;
    let power = intervals.iter().map(|interval| (interval - mean).powi(2)).sum::<f64>();
    (mean, (power / intervals.len() as f64).sqrt() / mean)
}

#[test]
fn thresholds_that_are_redrawn_scatter_the_intervals() {
    let (steady, jittered) = (intervals(0.0), intervals(0.04));
    println!("intervals {steady:?} ms, with jitter {jittered:?} ms");
    assert!((steady.0 - 100.0).abs() < 2.0 && (jittered.0 - 100.0).abs() < 4.0);
    // Leaks are booked every 16 ms, which scatters even steady ones; 0.04 is a fifth of the threshold.
    let expected = steady.1.hypot(0.2);
    assert!((jittered.1 - expected).abs() < 0.04, "{} is not {expected}", jittered.1);
}

#[test]
fn an_offset_flattens_the_logarithm() {
    let count = |logarithm| second(&with(flickering(), |sensor| sensor.logarithm = logarithm)).0.len();
    let linear = count(Logarithm::LinearBelow(20.0));
    let (esim, dark_current) = (count(Logarithm::Offset(0.255)), count(Logarithm::Offset(128.0)));
    let all_linear = count(Logarithm::LinearBelow(255.0));
    println!(
        "{linear} events, {esim} with ESIM's, {dark_current} with an offset of 128 DN, {all_linear} linear"
    );
    assert!(esim.abs_diff(linear) * 20 < linear);
    assert!(dark_current * 2 < linear && all_linear * 2 < linear);
}

#[test]
fn each_model_sweeps_in_its_own_way() {
    let geometry = section_three(Light::Light).sensor.geometry;
    let mut heights = Vec::new();
    for sensor in [
        section_three(Light::Light).sensor,
        SensorConfig::v2e_like(Light::Light),
        SensorConfig::iebcs_like(Light::Light),
        SensorConfig::v2e_like(Light::Dark),
        SensorConfig::iebcs_like(Light::Dark),
    ] {
        let base = section_three(Light::Light);
        let name = sensor.model.clone();
        let curve = sweep_curve(&RigConfig { sensor: SensorConfig { geometry, ..sensor }, ..base });
        println!("{name}: {curve}");
        let (before, dip) = (curve.peak(-800.0, 0.0), curve.dip(-200.0, 300.0));
        assert!(f64::from(dip.1) < 0.8 * f64::from(before.1), "{name} has no dip");
        heights.push(before.1);
    }
    heights.sort_unstable();
    heights.dedup();
    assert_eq!(heights.len(), 5);
}

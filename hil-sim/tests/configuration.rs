//! Names, checks of the configuration, and what the simulator knows of itself.

use std::sync::Arc;

use evfocus_core::{HostMicros, LensPosition};
use evfocus_hal::VirtualClock;
use hil_sim::{
    CameraModel, Fault, FaultKind, FaultTrigger, LensConfig, LensKind, Light, MotionConfig, OpticsConfig,
    Rig, RigConfig, Scene,
};

use crate::sweep::{open, section_three};

#[test]
fn names_go_both_ways() {
    for &scene in Scene::ALL {
        assert_eq!(scene.to_string().parse(), Ok(scene));
    }
    for &light in Light::ALL {
        assert_eq!(light.to_string().parse(), Ok(light));
    }
    for &kind in LensKind::ALL {
        assert_eq!(kind.to_string().parse(), Ok(kind));
    }
    for &model in CameraModel::ALL {
        assert_eq!(model.to_string().parse(), Ok(model));
    }
}

#[test]
fn an_unknown_name_gets_the_list_of_valid_ones() {
    assert_eq!(
        "siemens".parse::<Scene>().unwrap_err().to_string(),
        "scene \"siemens\" is not known; choose one of: text, siemens-star, dead-leaves, pink-noise, star-field, \
         checker, foliage, buildings, low-texture, blank-wall, two-depths"
    );
    assert_eq!(
        "bright".parse::<Light>().unwrap_err().to_string(),
        "light \"bright\" is not known; choose one of: light, dark"
    );
}

#[test]
fn senseless_values_are_refused_by_name() {
    let refused = |change: &dyn Fn(&mut RigConfig)| {
        let mut config = RigConfig::default();
        change(&mut config);
        Rig::new(config, Arc::new(VirtualClock::new())).unwrap_err().to_string()
    };
    assert_eq!(
        refused(&|config| config.focus = LensPosition(4000.0)),
        "focus is 4000; it must be within 220 and 3750"
    );
    assert!(
        refused(&|config| config.optics.blur_px_per_count = f64::NAN)
            .starts_with("optics.blur_px_per_count is NaN")
    );
    assert!(
        refused(&|config| config.lens = LensConfig { backlash: -1.0, ..config.lens })
            .contains("lens.backlash")
    );
    let beyond = FaultTrigger::AtPosition(LensPosition(0.0));
    let fault = Fault { kind: FaultKind::LensStalled, trigger: beyond };
    assert!(refused(&|config| config.faults = vec![fault]).contains("faults.position"));
}

/// Mean squared difference of horizontal neighbours in columns `from..to`.
fn sharpness(rig: &Rig, position: f64, from: usize, to: usize) -> f32 {
    let width = usize::from(rig.config().sensor.geometry.width);
    let frame = rig.intensity_frame(HostMicros(0), LensPosition(position));
    frame.chunks(width).flat_map(|row| row[from..to].windows(2)).map(|pair| (pair[0] - pair[1]).powi(2)).sum()
}

#[test]
fn every_scene_is_sharpest_at_the_truth() {
    for &scene in Scene::ALL {
        let (rig, ..) = open(&RigConfig { scene, ..section_three(Light::Light) });
        let truth = rig.truth();
        if scene == Scene::BlankWall {
            continue;
        }
        // The left half has the first depth; the middle is left out.
        for (truth, (from, to)) in truth.iter().zip([(0, 70), (90, 160)]) {
            let sharp = sharpness(&rig, truth.0, from, to);
            for offset in [-300.0, -60.0, 60.0, 300.0] {
                let other = sharpness(&rig, truth.0 + offset, from, to);
                assert!(other < sharp, "{scene}: {other} at {offset}, {sharp} at the truth");
            }
        }
    }
    let (rig, ..) = open(&RigConfig { scene: Scene::TwoDepths, ..section_three(Light::Light) });
    assert_eq!(rig.truth(), vec![LensPosition(1985.0), LensPosition(2785.0)]);
}

#[test]
fn blur_keeps_the_light_and_stands_still_at_focus() {
    let (rig, ..) = open(&section_three(Light::Light));
    let frame = |position: f64| rig.intensity_frame(HostMicros(0), LensPosition(position));
    let change =
        |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).sum::<f32>() / a.len() as f32;
    let mean = |frame: &[f32]| frame.iter().sum::<f32>() / frame.len() as f32;
    let sharp = frame(1985.0);
    assert!((mean(&sharp) / mean(&frame(2985.0)) - 1.0).abs() < 0.05);
    // The blur's variance grows as the square of the distance: twice as far is four times the change.
    let ratio = change(&sharp, &frame(2005.0)) / change(&sharp, &frame(1995.0));
    assert!((ratio - 4.0).abs() < 0.1, "{ratio}");
    assert!(change(&frame(1965.0), &frame(2005.0)) < 1e-3, "both sides of focus look the same");
}

#[test]
fn slopes_may_differ_and_the_picture_may_breathe() {
    let base = section_three(Light::Light);
    let uneven = RigConfig { optics: OpticsConfig { slope_ratio: 1.15, ..base.optics }, ..base.clone() };
    let (rig, ..) = open(&uneven);
    assert!(sharpness(&rig, 2185.0, 0, 160) < sharpness(&rig, 1785.0, 0, 160) * 0.95);
    let breathing = RigConfig { optics: OpticsConfig { breathing: 0.04, ..base.optics }, ..base.clone() };
    let (rig, ..) = open(&breathing);
    let (still, ..) = open(&base);
    let differs = |position: f64| {
        let pair = [&rig, &still].map(|rig| rig.intensity_frame(HostMicros(0), LensPosition(position)));
        pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).sum::<f32>() / pair[0].len() as f32
    };
    assert!(differs(1985.0) < 0.01 && differs(1185.0) > 1.0, "{} {}", differs(1985.0), differs(1185.0));
}

#[test]
fn a_whole_pixel_of_motion_is_a_shift_by_one_pixel() {
    let base = section_three(Light::Light);
    let (rig, ..) = open(&RigConfig {
        motion: MotionConfig { velocity_px_per_s: (3.0, 2.0), ..MotionConfig::default() },
        ..base
    });
    let frame = |micros| rig.intensity_frame(HostMicros(micros), LensPosition(1985.0));
    let (before, after) = (frame(0), frame(1_000_000));
    for y in 0..100 {
        for x in 0..150 {
            let (old, new) = (before[y * 160 + x], after[(y + 2) * 160 + x + 3]);
            assert!((old - new).abs() < 1e-2, "({x}, {y}): {old} became {new}");
        }
    }
}

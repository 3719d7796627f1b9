//! What the scenes offer to a focus sweep.

use evfocus_core::{HostMicros, LensPosition};
use hil_sim::{Light, RigConfig, Scene};

use crate::sweep::{open, section_three, sweep_curve};

/// Events of a still sweep in light, within 800 counts of focus.
fn events(scene: Scene) -> u32 {
    let curve = sweep_curve(&RigConfig { scene, ..section_three(Light::Light) });
    let near = (0..curve.offsets.len()).filter(|&bin| curve.offsets[bin].abs() < 800.0);
    near.map(|bin| curve.total(bin)).sum()
}

#[test]
fn scenes_make_events_by_what_is_to_be_seen_in_them() {
    let counts: Vec<_> = Scene::ALL.iter().map(|&scene| (scene, events(scene))).collect();
    println!("{counts:?}");
    let of = |scene| counts.iter().find(|(other, _)| *other == scene).map(|&(_, count)| count).unwrap();
    let (wall, weak) = (of(Scene::BlankWall), of(Scene::LowTexture));
    assert!(weak > 2 * wall && 5 * weak < of(Scene::DeadLeaves), "{weak} events of weak edges");
    let useful = counts.iter().filter(|&&(_, count)| count > 2 * wall).count();
    assert_eq!(useful, Scene::ALL.len() - 1, "all but the blank wall");
}

#[test]
fn a_scene_follows_from_the_seed_and_stays_within_white() {
    let frame = |scene, seed| {
        let (rig, ..) = open(&RigConfig { scene, seed, ..section_three(Light::Light) });
        rig.intensity_frame(HostMicros(0), LensPosition(1985.0))
    };
    for scene in [Scene::Foliage, Scene::Buildings, Scene::LowTexture] {
        assert!(frame(scene, 1) == frame(scene, 1));
        assert!(frame(scene, 1) != frame(scene, 2), "{scene}");
        assert!(frame(scene, 1).iter().all(|value| (0.0..=256.0).contains(value)), "{scene}");
    }
}

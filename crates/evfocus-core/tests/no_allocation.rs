//! The event path allocates nothing: from the start of the sweep to the result, and in the clock map ever.
#![expect(clippy::unwrap_used, clippy::panic, reason = "a test whose own fixture is missing fails")]

use evfocus_core::controller::{Command, Mode};
use evfocus_core::{CameraMicros, ClockMap, HostMicros, Method, Outcome, Phase};

#[path = "support/allocations.rs"]
mod allocations;
#[path = "support/random.rs"]
mod random;
#[path = "controller/rig.rs"]
#[expect(dead_code, reason = "the rig of the controller's tests can do more than is needed here")]
mod rig;

use allocations::allocations_in;

#[test]
fn the_counter_of_allocations_counts() {
    assert_eq!(allocations_in(|| drop(core::hint::black_box(vec![1_u8]))), 1);
    let mut grown = core::hint::black_box(Vec::with_capacity(1));
    assert!(allocations_in(|| grown.extend(0..1_000_u32)) >= 1);
    assert_eq!(allocations_in(|| grown.clear()), 0);
}

#[test]
fn a_run_allocates_nothing_from_the_start_of_the_sweep_to_the_result() {
    for method in Method::ALL {
        let config = evfocus_core::ControllerConfig { method, ..rig::config() };
        let mut rig = rig::Rig::new(config);
        rig.focus();
        rig.until(Phase::Sweeping);
        let events = rig.controller.snapshot().events;
        let allocations = allocations_in(|| {
            while rig.controller.snapshot().run.is_some() {
                rig.step();
            }
        });
        let Outcome::Focused { .. } = rig.controller.report().unwrap().outcome else {
            panic!("{:?}", rig.controller.report());
        };
        assert!(rig.controller.snapshot().events > events + 20_000);
        assert_eq!(allocations, 0, "{method}");
    }
}

#[test]
fn watching_for_lost_focus_allocates_nothing() {
    let mut rig = rig::Rig::new(rig::config());
    rig.scene.stripe = 3;
    rig.command(Command::SetMode(Mode::Continuous)).unwrap();
    rig.step();
    rig.finish(|_, _| {});
    rig.steps(10);
    let allocations = allocations_in(|| rig.steps(5_000));
    let snapshot = rig.controller.snapshot();
    assert!(snapshot.sharpness.is_some() && snapshot.run.is_none(), "{snapshot:?}");
    assert_eq!(allocations, 0);
}

#[test]
fn the_clock_map_allocates_nothing_once_it_is_made() {
    let mut map = ClockMap::new(None);
    let mut random = random::Xorshift::new(1);
    let allocations = allocations_in(|| {
        for millisecond in 0..60_000_i64 {
            let delay = random.exponential(300.0) as i64;
            map.observe(CameraMicros(millisecond * 1_000), HostMicros(millisecond * 1_000 + delay));
        }
    });
    assert_eq!((allocations, map.quality().observations), (0, 60_000));
}

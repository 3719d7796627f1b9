//! Whatever comes in, in whatever order: no panic, no order that the lens cannot follow, and every run ends.

use core::time::Duration;

use evfocus_core::controller::{Command, DeviceFailure, FocusRequest, Input, Mode, Pause};
use evfocus_core::{
    CameraMicros, ControllerConfig, Event, EventBatch, EventList, HostMicros, LensPosition, LensRange,
    LensSample, LensSpeed, Method, Polarity, SweepCapacity,
};
use proptest::prelude::*;

use crate::rig::{CameraFault, LensFault, Rig, config};

#[derive(Debug, Clone)]
enum Happening {
    Command(Command),
    Batch { times: Vec<i64>, arrival: i64, reached: Option<i64>, lost: u64 },
    Lens(LensSample),
    Device(Input<'static>),
    Time(u32),
    LensFault(LensFault),
    CameraFault(CameraFault),
}

/// Numbers as they should be, and numbers as they should not.
fn wild(sound: core::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![6 => sound, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)]
}

fn micros() -> impl Strategy<Value = i64> {
    prop_oneof![4 => 0..10_000_000_000_i64, 2 => 990_000_000..1_100_000_000_i64, 1 => any::<i64>()]
}

fn commands() -> impl Strategy<Value = Command> {
    let requests =
        (prop::option::of(0..4_usize), prop::option::of((0.0..1e3_f64, 0.0..1e3_f64)), 10.0..3e3_f64)
            .prop_map(|(method, range, speed)| FocusRequest {
                method: method.map(|index| Method::ALL[index]),
                range: range.and_then(|(a, b)| LensRange::new(LensPosition(a), LensPosition(b)).ok()),
                speed: LensSpeed::new(speed).ok(),
                ..FocusRequest::default()
            });
    prop_oneof![
        4 => Just(Command::Focus(FocusRequest::default())),
        2 => requests.prop_map(Command::Focus),
        1 => Just(Command::Abort),
        1 => wild(0.0..1e3).prop_map(|position| Command::MoveTo(LensPosition(position))),
        1 => prop_oneof![Just(Mode::Auto), Just(Mode::Manual), Just(Mode::Continuous)].prop_map(Command::SetMode),
        1 => prop_oneof![Just(Pause::Immediate), Just(Pause::Deferred), Just(Pause::Resume)].prop_map(Command::Pause),
    ]
}

fn devices() -> impl Strategy<Value = Input<'static>> {
    let failures =
        prop_oneof![Just(DeviceFailure::Gone), Just(DeviceFailure::Fault), Just(DeviceFailure::Silent)];
    prop_oneof![
        Just(Input::CameraReady),
        Just(Input::LensReady),
        Just(Input::Tick),
        failures.clone().prop_map(Input::CameraFailed),
        failures.prop_map(Input::LensFailed),
    ]
}

fn faults() -> impl Strategy<Value = Happening> {
    let lens = prop_oneof![
        Just(LensFault::None),
        Just(LensFault::Stuck),
        (0.0..1e3_f64).prop_map(LensFault::Blocked),
        (-50.0..50.0_f64).prop_map(LensFault::Overshoots),
        (-10.0..10.0_f64).prop_map(LensFault::Slips),
        (1.0..500.0_f64).prop_map(LensFault::Creeps),
        Just(LensFault::NeverArrives),
        Just(LensFault::Silent),
    ];
    let camera = prop_oneof![
        Just(CameraFault::None),
        Just(CameraFault::Silent),
        Just(CameraFault::TimeStandsStill),
        (0..100_u64).prop_map(CameraFault::Loses),
    ];
    prop_oneof![lens.prop_map(Happening::LensFault), camera.prop_map(Happening::CameraFault)]
}

fn happenings() -> impl Strategy<Value = Happening> {
    let batches = (prop::collection::vec(micros(), 0..5), micros(), prop::option::of(micros()), 0..100_u64)
        .prop_map(|(times, arrival, reached, lost)| Happening::Batch { times, arrival, reached, lost });
    let lenses = (micros(), micros(), wild(-100.0..1_100.0), any::<bool>()).prop_map(
        |(requested, replied, position, moving)| {
            Happening::Lens(LensSample {
                requested: HostMicros(requested),
                replied: HostMicros(replied),
                position: LensPosition(position),
                moving,
            })
        },
    );
    prop_oneof![
        3 => commands().prop_map(Happening::Command),
        2 => batches,
        2 => lenses,
        1 => devices().prop_map(Happening::Device),
        4 => (0..1_500_u32).prop_map(Happening::Time),
        2 => faults(),
    ]
}

fn small() -> ControllerConfig {
    let capacity =
        SweepCapacity { bin: Duration::from_micros(100), longest: Duration::from_secs(2), events: 20_000 };
    ControllerConfig {
        capacity,
        needs_homing: true,
        homing_timeout: Duration::from_secs(2),
        lens_samples: 1_000,
        ..config()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// Any sequence of inputs, sound or absurd, ends in a controller without a run within half a minute, and every order to the lens on
    /// the way lies within its limits (the rig looks at each).
    #[test]
    fn every_run_ends(happenings in prop::collection::vec(happenings(), 1..25)) {
        let mut rig = Rig::new(small());
        rig.scene.peak_rate = 2e4;
        for happening in happenings {
            match happening {
                Happening::Command(command) => drop(rig.command(command)),
                Happening::Batch { times, arrival, reached, lost } => {
                    let event = |t| Event { t: CameraMicros(t), x: 1, y: 1, polarity: Polarity::On };
                    let mut events = EventList::default();
                    let lost = lost + events.append(times.into_iter().map(event));
                    let (arrival, reached) = (HostMicros(arrival), reached.map(CameraMicros));
                    rig.input(Input::Batch(&EventBatch { events, arrival, reached, lost }));
                }
                Happening::Lens(sample) => rig.input(Input::Lens(sample)),
                Happening::Device(input) => rig.input(input),
                Happening::Time(milliseconds) => rig.steps(milliseconds),
                Happening::LensFault(fault) => rig.lens_fault = fault,
                Happening::CameraFault(fault) => rig.camera_fault = fault,
            }
        }
        // Continuous mode would go on for ever.
        if rig.controller.snapshot().mode == Mode::Continuous {
            prop_assert!(rig.command(Command::Pause(Pause::Deferred)).is_ok());
        }
        for _ in 0..30_000 {
            if rig.controller.snapshot().run.is_none() {
                return Ok(());
            }
            rig.step();
        }
        prop_assert!(false, "still {:?}", rig.controller.snapshot());
    }
}

//! What can go wrong while a camera streams.

use std::time::Duration;

use evfocus_camera::{Driver, ReopeningCamera};
use evfocus_core::EventBatch;
use evfocus_hal::{Camera, Clock, DeviceErrorKind};
use hil_sim::{Fault, FaultKind, FaultTrigger, RigConfig, UsbFaults};

use crate::common::{Bench, config};

const WHILE: Duration = Duration::from_millis(150);

/// A bench with a started camera, past its first events.
fn started(driver: Driver) -> (Bench, Box<dyn Camera>) {
    let bench = Bench::new(driver);
    let mut camera = bench.open().unwrap();
    camera.start().unwrap();
    assert!(!bench.watch(camera.as_mut(), WHILE).unwrap().0.is_empty());
    (bench, camera)
}

#[test]
fn a_stall_is_cleared_and_the_stream_goes_on() {
    for driver in Driver::ALL {
        let (bench, mut camera) = started(driver);
        bench.set_faults(UsbFaults { stalls: 2, ..UsbFaults::default() });
        let (events, _) = bench.watch(camera.as_mut(), WHILE).unwrap();
        assert!(events.len() > 1_000, "{driver}: {} events", events.len());
    }
}

#[test]
fn endless_stalls_end_the_stream_which_can_be_started_again() {
    for driver in Driver::ALL {
        let (bench, mut camera) = started(driver);
        bench.set_faults(UsbFaults { stalls: u32::MAX, ..UsbFaults::default() });
        assert_eq!(bench.watch(camera.as_mut(), WHILE).unwrap_err().kind, DeviceErrorKind::Protocol);
        let mut batch = EventBatch::with_capacity(64);
        let again = camera.read(&mut batch, Duration::ZERO).unwrap_err();
        assert_eq!(again.kind, DeviceErrorKind::NotStarted);
        bench.set_faults(UsbFaults::default());
        camera.start().unwrap();
        assert!(!bench.watch(camera.as_mut(), WHILE).unwrap().0.is_empty());
    }
}

#[test]
fn lost_transfers_do_not_turn_time_back() {
    for driver in Driver::ALL {
        let (bench, mut camera) = started(driver);
        let faults = UsbFaults { lose_one_of: Some(3), short_packets: Some(40), ..UsbFaults::default() };
        bench.set_faults(faults);
        let (events, _) = bench.watch(camera.as_mut(), WHILE * 3).unwrap();
        assert!(events.len() > 1_000 && events.is_sorted_by_key(|event| event.t), "{driver}");
        let geometry = camera.info().geometry;
        assert!(events.iter().all(|event| geometry.contains(event.x, event.y)));
    }
}

#[test]
fn half_a_word_does_not_garble_what_follows() {
    for driver in Driver::ALL {
        let (bench, mut camera) = started(driver);
        bench.set_faults(UsbFaults { odd_transfers: true, ..UsbFaults::default() });
        let (events, _) = bench.watch(camera.as_mut(), WHILE).unwrap();
        // Read one byte off, times and addresses would be anything.
        let on_picture = events.iter().filter(|event| event.x < 160 && event.y < 120).count();
        assert!(
            on_picture > 1_000 && on_picture == events.len(),
            "{driver}: {on_picture} of {}",
            events.len()
        );
        assert!(events.last().unwrap().t.0 < 10_000_000);
    }
}

#[test]
fn babble_neither_panics_nor_turns_time_back_and_ends_the_handle() {
    for driver in Driver::ALL {
        let (bench, mut camera) = started(driver);
        bench.set_faults(UsbFaults { babble: Some(500), ..UsbFaults::default() });
        let geometry = camera.info().geometry;
        let (mut batch, mut last) = (EventBatch::with_capacity(4096), i64::MIN);
        let error = loop {
            match camera.read(&mut batch, Duration::from_millis(5)) {
                Ok(()) => {}
                Err(error) => break error,
            }
            for event in batch.events.iter() {
                assert!(event.t.0 >= last && geometry.contains(event.x, event.y));
                last = event.t.0;
            }
            assert!(batch.events.capacity() <= 4096);
        };
        assert_eq!(error.kind, DeviceErrorKind::Disconnected, "{error}");
        let again = camera.read(&mut batch, Duration::ZERO).unwrap_err();
        assert_eq!(again.kind, DeviceErrorKind::Disconnected);
    }
}

#[test]
fn a_restarted_clock_leaps_and_never_turns_back() {
    for driver in Driver::ALL {
        let trigger = FaultTrigger::After(Duration::from_secs(4));
        let faults = vec![Fault { kind: FaultKind::CameraTimeReset, trigger }];
        let bench = Bench::with(driver, RigConfig { faults, ..config(driver) });
        let mut camera = bench.open().unwrap();
        bench.clock.advance_to(evfocus_core::HostMicros(3_000_000));
        camera.start().unwrap();
        let (events, _) = bench.watch(camera.as_mut(), Duration::from_millis(1500)).unwrap();
        assert!(events.is_sorted_by_key(|event| event.t), "{driver}");
        let longest = events.windows(2).map(|pair| pair[1].t.0 - pair[0].t.0).max().unwrap();
        assert!((10_000_000..20_000_000).contains(&longest), "{driver}: a step of {longest} us");
    }
}

#[test]
fn what_nobody_read_is_counted_and_its_wraps_are_time_all_the_same() {
    let (bench, mut camera) = started(Driver::Davis346);
    let before = bench.watch(camera.as_mut(), WHILE).unwrap().0.last().unwrap().t;
    let host = bench.clock.now();
    let overflow = Some(Duration::from_millis(500));
    bench.set_faults(UsbFaults { overflow, ..UsbFaults::default() });
    let (events, lost) = bench.watch(camera.as_mut(), Duration::from_millis(800)).unwrap();
    // The low word of what the camera counted.
    assert!(lost > 10_000 && lost == u64::from(bench.port.register(0, 84)), "{lost}");
    let times: Vec<_> = std::iter::once(before).chain(events.iter().map(|event| event.t)).collect();
    let gap = times.windows(2).map(|pair| pair[1].micros_since(pair[0])).max().unwrap();
    assert!((495_000..520_000).contains(&gap), "{gap}");
    let passed = events.last().unwrap().t.micros_since(before);
    let waited = bench.clock.now().micros_since(host);
    assert!((passed - waited).abs() < 5_000, "{passed} us on the camera, {waited} us on the host");
}

#[test]
fn an_unplugged_camera_is_gone_until_it_is_opened_again() {
    for driver in Driver::ALL {
        let trigger = FaultTrigger::After(Duration::from_secs(4));
        let faults = vec![Fault { kind: FaultKind::CameraUnplugged, trigger }];
        let bench = Bench::with(driver, RigConfig { faults, ..config(driver) });
        let bench = std::sync::Arc::new(bench);
        let opener = std::sync::Arc::clone(&bench);
        let mut camera = ReopeningCamera::new(move || {
            // What the system's USB says of a port with nothing in it.
            opener.port.open().map_err(|error| {
                evfocus_hal::DeviceError::new(DeviceErrorKind::Disconnected, "port", error.to_string())
            })?;
            opener.open()
        })
        .unwrap();
        let info = camera.info();
        camera.start().unwrap();
        let error = bench.watch(&mut camera, Duration::from_secs(5)).unwrap_err();
        assert_eq!(error.kind, DeviceErrorKind::Disconnected, "{error}");
        let mut batch = EventBatch::with_capacity(64);
        for _ in 0..3 {
            let error = camera.read(&mut batch, Duration::ZERO).unwrap_err();
            assert_eq!(error.kind, DeviceErrorKind::Disconnected);
            assert_eq!(camera.start().unwrap_err().kind, DeviceErrorKind::Disconnected);
        }
        bench.rig.repair();
        camera.start().unwrap();
        assert!(!bench.watch(&mut camera, WHILE).unwrap().0.is_empty());
        assert_eq!(camera.info(), info);
    }
}

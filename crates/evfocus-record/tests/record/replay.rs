//! A recording as a camera: it does what cameras must do, and nothing is lost or made up.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{CameraMicros, Event, EventBatch, HostMicros};
use evfocus_hal::{Camera, Clock, DeviceErrorKind, VirtualClock, conformance};
use evfocus_record::{CsvWriter, RecordError, ReplayCamera, ReplayEnd, ReplayPace};

use crate::common::{data, event, file, read_file};

const RECORDINGS: [&str; 5] = [
    "evt3_hd_1280x720_trigger.raw",
    "evt3_vga_640x480_trigger.raw",
    "davis346_events.aedat4",
    "davis346_usb_words_made_stall.bin",
    "davis346_events_head.csv",
];

fn open(name: &str, pace: ReplayPace, end: ReplayEnd) -> (ReplayCamera, Arc<VirtualClock>) {
    let clock = Arc::new(VirtualClock::new());
    (ReplayCamera::open(data(name), pace, end, clock.clone()).unwrap(), clock)
}

/// Everything until the camera is gone, and the error.
fn play(camera: &mut ReplayCamera, capacity: usize) -> (Vec<Event>, DeviceErrorKind) {
    let mut batch = EventBatch::with_capacity(capacity);
    let mut events = Vec::new();
    camera.start().unwrap();
    loop {
        match camera.read(&mut batch, Duration::from_millis(20)) {
            Ok(()) => events.extend(batch.events.iter()),
            Err(error) => return (events, error.kind),
        }
    }
}

#[test]
fn replayed_recordings_conform() {
    for name in RECORDINGS {
        let checked = conformance::camera(|| {
            let (camera, clock) = open(name, ReplayPace::RealTime, ReplayEnd::Repeat);
            (Box::new(camera), clock)
        });
        assert_eq!(checked, Ok(()), "{name}");
    }
}

#[test]
fn every_event_comes_once() {
    for name in RECORDINGS {
        let expected = read_file(&data(name), None);
        for (pace, capacity) in [(ReplayPace::RealTime, 1 << 16), (ReplayPace::AsFastAsPossible, 999)] {
            let (mut camera, _) = open(name, pace, ReplayEnd::Disconnect);
            for _ in 0..2 {
                let (events, error) = play(&mut camera, capacity);
                assert!(events == expected, "{name}, {pace:?}: {} of {}", events.len(), expected.len());
                assert_eq!(error, DeviceErrorKind::Disconnected);
            }
        }
    }
}

#[test]
fn real_time_is_as_long_as_the_recording() {
    let (mut camera, clock) = open("davis346_events.aedat4", ReplayPace::RealTime, ReplayEnd::Disconnect);
    clock.advance_to(HostMicros(5_000_000));
    camera.start().unwrap();
    let mut batch = EventBatch::with_capacity(1 << 16);
    let (mut first, mut last) = (None, CameraMicros(0));
    while camera.read(&mut batch, Duration::from_millis(10)).is_ok() {
        let (Some(begin), Some(end)) = (batch.events.first(), batch.events.last()) else { continue };
        let origin = *first.get_or_insert(begin.t);
        last = end.t;
        // Never before it happened, and no more than a packet after.
        let late = batch.arrival.micros_since(HostMicros(5_000_000)) - last.micros_since(origin);
        assert!((0..=2_000).contains(&late), "{late} us late");
    }
    let length = last.micros_since(first.unwrap());
    assert!((0..=2_000).contains(&(clock.now().0 - 5_000_000 - length)), "{} us", clock.now().0);
}

/// Plays these events twice over.
fn play_twice(events: &[Event]) -> Vec<Event> {
    let (_folder, path) = file("events.csv", b"");
    let mut writer = CsvWriter::create(&path).unwrap();
    writer.write(events).unwrap();
    writer.finish().unwrap();
    let clock = Arc::new(VirtualClock::new());
    let pace = ReplayPace::AsFastAsPossible;
    let mut camera = ReplayCamera::open(&path, pace, ReplayEnd::Repeat, clock).unwrap();
    camera.start().unwrap();
    let mut batch = EventBatch::with_capacity(2);
    let mut played = Vec::new();
    while played.len() < 2 * events.len() {
        camera.read(&mut batch, Duration::ZERO).unwrap();
        played.extend(batch.events.iter());
    }
    played
}

#[test]
fn time_goes_on_at_the_end_and_where_the_recording_goes_back() {
    let at = |times: &[i64]| times.iter().map(|&t| event(t, 3, 4, true)).collect::<Vec<_>>();
    // A little out of order, then a restart of the camera's clock.
    let played = play_twice(&at(&[1_000, 50_000, 49_990, 50_010, 20, 30]));
    let pass = [1_000, 50_000, 50_000, 50_010, 50_010, 50_020];
    let again = pass.map(|t| t + 50_021 - 1_000);
    assert_eq!(played, at(&[pass, again].concat()));
}

#[test]
fn what_cannot_be_played_is_refused_by_name() {
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock::new());
    let refused = |path: &std::path::Path| {
        let opened = ReplayCamera::open(path, ReplayPace::RealTime, ReplayEnd::Repeat, Arc::clone(&clock));
        opened.err().map(|error: RecordError| error.to_string()).unwrap_or_default()
    };
    let missing = refused(std::path::Path::new("/nowhere/sweep.raw"));
    assert!(missing.contains("/nowhere/sweep.raw") && missing.contains("check its name"), "{missing}");
    let (_folder, path) = file("empty.raw", b"% evt 3.0\n% geometry 640x480\n% end\n\x01\x80\x02\x60");
    let empty = refused(&path);
    assert!(empty.contains("empty.raw") && empty.contains("no events"), "{empty}");
}

//! What is written comes back the same: events, order, times, whatever the gaps and the origin.

use evfocus_core::decode::Evt3Decoder;
use evfocus_core::{CameraMicros, Event, Geometry};
use evfocus_record::encode::{EncodeError, Evt3Encoder};
use evfocus_record::{
    Aedat4Compression, Aedat4Writer, CsvWriter, Evt3Writer, RecordError, Recording, Summary,
};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::common::{event, read_file};

const SENSOR: Geometry = Geometry { width: 346, height: 260 };

/// Where a recording may begin: at zero, anywhere in the first days, before zero, in Unix time.
fn origin() -> impl Strategy<Value = i64> {
    prop_oneof![Just(0), 0..1_i64 << 40, -(1_i64 << 40)..0, Just(1_589_163_147_368_868)]
}

/// Microseconds from one event to the next: mostly none or few, now and then more than the 24 and the 31 bits of clocks.
fn gap() -> impl Strategy<Value = i64> {
    prop_oneof![
        20 => Just(0),
        20 => 1..50_i64,
        4 => 1..10_000_i64,
        1 => (1_i64 << 24) - 5000..(1 << 24) + 5000,
        1 => (1_i64 << 31)..(1 << 31) + 5000,
    ]
}

/// Events in few rows and close columns, so that there are vectors; every address occurs.
fn events() -> impl Strategy<Value = Vec<Event>> {
    let place = prop_oneof![
        (0..SENSOR.width, 0..SENSOR.height),
        (0..40_u16, 7..9_u16),
        (SENSOR.width - 40..SENSOR.width, 7..9_u16)
    ];
    (origin(), vec((gap(), place, any::<bool>()), 0..300)).prop_map(|(mut t, steps)| {
        let step = |(gap, (x, y), on)| {
            t += gap;
            event(t, x, y, on)
        };
        steps.into_iter().map(step).collect()
    })
}

/// Runs of neighbours in one row at one time, as moving edges make them.
fn runs() -> impl Strategy<Value = Vec<Event>> {
    let run = (0..30_i64, 0..SENSOR.height, 0..SENSOR.width, 1..70_u16, 1..3_u16, any::<bool>());
    vec(run, 1..60).prop_map(|runs| {
        let mut t = 1000;
        let mut events = Vec::new();
        for (gap, y, first, length, step, on) in runs {
            t += gap;
            let columns = (first..SENSOR.width).step_by(usize::from(step)).take(usize::from(length));
            events.extend(columns.map(|x| event(t, x, y, on)));
        }
        events
    })
}

fn encoded(events: &[Event]) -> (Vec<u8>, CameraMicros) {
    let mut words = Vec::new();
    let mut encoder = Evt3Encoder::new(SENSOR).unwrap();
    encoder.encode(events, &mut words).unwrap();
    (words, encoder.origin().unwrap_or_default())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn evt3(events in prop_oneof![events(), runs()], chunk in 1..100_usize) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("written");
        let mut writer = Evt3Writer::create(&path, SENSOR).unwrap();
        for chunk in events.chunks(chunk) {
            writer.write(chunk).unwrap();
        }
        writer.finish().unwrap();
        prop_assert_eq!(Recording::open(&path, None).unwrap().geometry(), Some(SENSOR));
        prop_assert_eq!(read_file(&path, None), events);
        prop_assert!(Summary::of_file(&path, None).unwrap().damage.is_none());
    }

    #[test]
    fn evt3_words_survive_any_piecewise_reading(events in runs(), piece in 1..9_usize) {
        let (words, origin) = encoded(&events);
        let mut batch = evfocus_core::EventBatch::default();
        let mut decoder = Evt3Decoder::with_origin(SENSOR, origin);
        words.chunks(piece).for_each(|bytes| decoder.decode(bytes, &mut batch));
        prop_assert_eq!(batch.events, events);
    }

    #[test]
    fn aedat4(events in events(), compressed in any::<bool>()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("written");
        let compression = if compressed { Aedat4Compression::Lz4 } else { Aedat4Compression::None };
        let mut writer = Aedat4Writer::create(&path, SENSOR, compression).unwrap();
        writer.write(&events).unwrap();
        writer.finish().unwrap();
        prop_assert_eq!(Recording::open(&path, None).unwrap().geometry(), Some(SENSOR));
        prop_assert_eq!(read_file(&path, None), events);
    }

    #[test]
    fn csv(events in events()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("written");
        let mut writer = CsvWriter::create(&path).unwrap();
        writer.write(&events).unwrap();
        writer.finish().unwrap();
        // Without events there is nothing but the header, which says enough.
        prop_assert_eq!(read_file(&path, None), events);
    }
}

#[test]
fn evt3_takes_vectors_where_they_are_shorter() {
    let run: Vec<Event> = (0..32).map(|x| event(0, 64 + x, 3, true)).collect();
    // TIME_HIGH, TIME_LOW, ADDR_Y, base and three vectors.
    assert_eq!(encoded(&run).0.len(), 14);
    assert_eq!(encoded(&run[..4]).0.len(), 14);
    // A vector must not reach over the edge of the sensor.
    let at_the_edge: Vec<Event> = (0..31).map(|x| event(0, SENSOR.width - 31 + x, 3, true)).collect();
    assert_eq!(encoded(&at_the_edge).0.len(), 6 + 62);
}

#[test]
fn evt3_refuses_what_it_cannot_express() {
    let mut encoder = Evt3Encoder::new(SENSOR).unwrap();
    let mut words = Vec::new();
    encoder.encode([event(100, 0, 0, true)], &mut words).unwrap();
    let outside = encoder.encode([event(100, 346, 0, true)], &mut words);
    assert!(matches!(outside, Err(EncodeError::OutsideSensor { .. })));
    let back = encoder.encode([event(99, 0, 0, true)], &mut words);
    assert_eq!(back, Err(EncodeError::TimeReversal { time: 99, last: 100 }));
    let late = encoder.encode([event(101 + Evt3Encoder::MAX_GAP_US, 0, 0, true)], &mut words);
    assert_eq!(late, Err(EncodeError::GapTooLong { gap_us: Evt3Encoder::MAX_GAP_US + 1 }));
    encoder.encode([event(101, 0, 0, true)], &mut words).unwrap();
    let large = Evt3Encoder::new(Geometry { width: 2049, height: 1 });
    assert!(matches!(large, Err(EncodeError::SensorTooLarge { .. })));
}

#[test]
fn files_without_events() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty");
    Evt3Writer::create(&path, SENSOR).unwrap().finish().unwrap();
    assert_eq!(Summary::of_file(&path, None).unwrap().events, 0);
    Aedat4Writer::create(&path, SENSOR, Aedat4Compression::Lz4).unwrap().finish().unwrap();
    assert_eq!(Summary::of_file(&path, None).unwrap().events, 0);
    CsvWriter::create(&path).unwrap().finish().unwrap();
    let summary = Summary::of_file(&path, None).unwrap();
    assert_eq!((summary.events, summary.geometry, summary.mean_rate), (0, None, None));
}

#[test]
fn a_full_disk_is_an_error_not_a_short_file() {
    let mut writer = Evt3Writer::create("/dev/full", SENSOR).unwrap();
    writer.write([event(0, 0, 0, true)]).unwrap();
    assert!(matches!(writer.finish(), Err(RecordError::Write { .. })));
}

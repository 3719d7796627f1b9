//! Real recordings come out exactly: counts, times and sums as established with the independent decoders that
//! `tests/data/README.md` names.

use std::path::{Path, PathBuf};

use evfocus_core::{Event, EventBatch};
use evfocus_record::{Format, MAX_EVENTS_PER_READ, Recording};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn read_all(recording: &mut Recording) -> Vec<Event> {
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    let capacity = batch.events.capacity();
    let mut events = Vec::new();
    while recording.read(&mut batch).unwrap() {
        events.extend_from_slice(&batch.events);
    }
    assert_eq!(batch.events.capacity(), capacity, "the batch never grows");
    events
}

fn on(events: &[Event]) -> usize {
    events.iter().filter(|event| event.polarity.is_on()).count()
}

#[test]
fn evt3_of_an_hd_camera() {
    let mut recording = Recording::open(data("evt3_hd_1280x720_trigger.raw"), None).unwrap();
    assert_eq!(recording.format(), Format::Evt3);
    let events = read_all(&mut recording);
    assert_eq!((events.len(), on(&events)), (82_469, 41_439));
    assert_eq!(events.iter().map(|event| u64::from(event.x)).sum::<u64>(), 42_078_718);
    assert_eq!(events.iter().map(|event| u64::from(event.y)).sum::<u64>(), 31_656_267);
    assert_eq!((events[0].t.0, events[events.len() - 1].t.0), (14_224_870, 15_476_187));
    assert_eq!(recording.triggers(), Some(2));
    assert!(recording.damage().is_none(), "{:?}", recording.damage());
}

#[test]
fn evt3_of_a_vga_camera() {
    let mut recording = Recording::open(data("evt3_vga_640x480_trigger.raw"), None).unwrap();
    let events = read_all(&mut recording);
    assert_eq!((events.len(), on(&events)), (343_474, 125_183));
    assert_eq!((events[0].t.0, events[events.len() - 1].t.0), (7_139_845, 9_218_023));
    assert_eq!(recording.triggers(), Some(4157));
    assert!(recording.damage().is_none(), "{:?}", recording.damage());
}
#[test]
fn davis_words() {
    let mut recording = Recording::open(data("davis346_usb_words_made.bin"), None).unwrap();
    let events = read_all(&mut recording);
    assert_eq!(events.len(), 78_830);
    let mut recording = Recording::open(data("davis346_usb_words_made_stall.bin"), None).unwrap();
    let events = read_all(&mut recording);
    assert_eq!(events.len(), 63_842);
    assert_eq!((events[0].t.0, events[events.len() - 1].t.0), (1000, 2_360_945));
}

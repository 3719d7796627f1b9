//! Real recordings come out exactly: counts, times and sums as established with the independent decoders that
//! `tests/data/README.md` names.

use std::fmt::Write as _;
use std::fs;

use crate::common::{data, read_all, read_file, shifted};
use evfocus_core::{Event, Geometry};
use evfocus_record::{Aedat4Compression, Aedat4Writer, CsvWriter, Evt3Writer, Format, Recording, Summary};

/// Unix time of the DAVIS346's first event, which its USB words put at 1000 us.
const DAVIS_FIRST_US: i64 = 1_589_163_147_368_868;

fn davis_events() -> Vec<Event> {
    read_file(&data("davis346_events.aedat4"), None)
}

#[test]
fn evt3_of_an_hd_camera() {
    let summary = Summary::of_file(data("evt3_hd_1280x720_trigger.raw"), None).unwrap();
    assert_eq!(summary.format, Format::Evt3);
    assert_eq!(summary.geometry, Some(Geometry { width: 1280, height: 720 }));
    assert!(!summary.geometry_inferred);
    assert_eq!((summary.events, summary.on, summary.off), (82_469, 41_439, 41_030));
    assert_eq!((summary.sum_x, summary.sum_y), (42_078_718, 31_656_267));
    assert_eq!((summary.first_t_us, summary.last_t_us), (Some(14_224_870), Some(15_476_187)));
    assert_eq!(summary.triggers, Some(2));
    assert!(summary.damage.is_none(), "{:?}", summary.damage);
}

#[test]
fn evt3_of_a_vga_camera() {
    let summary = Summary::of_file(data("evt3_vga_640x480_trigger.raw"), None).unwrap();
    assert_eq!((summary.events, summary.on, summary.off), (343_474, 125_183, 218_291));
    assert_eq!((summary.first_t_us, summary.last_t_us), (Some(7_139_845), Some(9_218_023)));
    assert_eq!(summary.triggers, Some(4157));
    assert!(summary.damage.is_none(), "{:?}", summary.damage);
}

#[test]
fn aedat4_of_a_davis346() {
    let summary = Summary::of_file(data("davis346_events.aedat4"), None).unwrap();
    assert_eq!(summary.format, Format::Aedat4);
    assert_eq!(summary.geometry, Some(Geometry { width: 346, height: 260 }));
    assert_eq!((summary.events, summary.on, summary.sum_x), (78_830, 41_257, 14_861_513));
    assert_eq!((summary.first_t_us, summary.last_t_us), (Some(DAVIS_FIRST_US), Some(1_589_163_149_728_813)));
    assert!(summary.damage.is_none(), "{:?}", summary.damage);
}

#[test]
fn aedat4_compressed_with_zstd() {
    let events = read_file(&data("davis346_events_zstd.aedat4"), None);
    assert_eq!(events, davis_events()[..4000]);
}

#[test]
fn csv_of_a_davis346() {
    let events = davis_events();
    let mut text = String::from("t,x,y,p\n");
    for event in &events {
        writeln!(text, "{},{},{},{}", event.t.0, event.x, event.y, u8::from(event.polarity.is_on())).unwrap();
    }
    // The size of the file that dv-processing's events were written to.
    assert_eq!(text.len(), 2_117_123);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("davis346_events.csv");
    fs::write(&path, text).unwrap();
    let mut recording = Recording::open(&path, None).unwrap();
    assert_eq!(recording.format(), Format::Csv);
    assert_eq!(read_all(&mut recording), events);
}

#[test]
fn csv_that_others_wrote() {
    let mut recording = Recording::open(data("davis346_events_head.csv"), None).unwrap();
    assert_eq!(recording.format(), Format::Csv);
    assert_eq!(read_all(&mut recording), davis_events()[..20_000]);
}

#[test]
fn usb_words_of_a_davis346() {
    let expected = shifted(&davis_events(), 1000 - DAVIS_FIRST_US);
    let mut recording = Recording::open(data("davis346_usb_words_made.bin"), None).unwrap();
    assert_eq!(recording.format(), Format::DavisWords);
    let events = read_all(&mut recording);
    assert_eq!((events.len(), events[0].t.0, events[events.len() - 1].t.0), (78_830, 1000, 2_360_945));
    assert!(events == expected, "differs from the events that the words were made of");
    assert!(recording.damage().is_none(), "{:?}", recording.damage());
}

#[test]
fn usb_words_of_a_davis346_that_nobody_read_for_a_while() {
    let mut expected = shifted(&davis_events(), 1000 - DAVIS_FIRST_US);
    expected.retain(|event| !(800_000..1_300_000).contains(&event.t.0));
    let mut recording = Recording::open(data("davis346_usb_words_made_stall.bin"), None).unwrap();
    let events = read_all(&mut recording);
    assert_eq!((events.len(), events[0].t.0, events[events.len() - 1].t.0), (63_842, 1000, 2_360_945));
    assert!(events == expected, "differs from the events that the words were made of");
    assert_eq!(recording.damage().time_jumps, 1);
}

#[test]
fn real_recordings_survive_every_writer() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["evt3_hd_1280x720_trigger.raw", "evt3_vga_640x480_trigger.raw", "davis346_events.aedat4"] {
        let mut recording = Recording::open(data(name), None).unwrap();
        let geometry = recording.geometry().unwrap();
        let events = read_all(&mut recording);
        let path = folder.path().join("no extension helps");

        let mut writer = Evt3Writer::create(&path, geometry).unwrap();
        events.chunks(1000).for_each(|chunk| writer.write(chunk).unwrap());
        writer.finish().unwrap();
        assert!(read_file(&path, None) == events, "{name} as EVT3");
        assert!(Summary::of_file(&path, None).unwrap().damage.is_none());

        for compression in [Aedat4Compression::None, Aedat4Compression::Lz4] {
            let mut writer = Aedat4Writer::create(&path, geometry, compression).unwrap();
            events.chunks(1000).for_each(|chunk| writer.write(chunk).unwrap());
            writer.finish().unwrap();
            assert!(read_file(&path, None) == events, "{name} as AEDAT4, {compression:?}");
        }

        let mut writer = CsvWriter::create(&path).unwrap();
        events.chunks(1000).for_each(|chunk| writer.write(chunk).unwrap());
        writer.finish().unwrap();
        assert!(read_file(&path, None) == events, "{name} as CSV");
    }
}

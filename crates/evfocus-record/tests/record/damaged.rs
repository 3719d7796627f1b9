//! Whatever the bytes are, nothing panics, hangs or grows.

use std::path::Path;

use evfocus_core::EventBatch;
use evfocus_record::{Format, MAX_EVENTS_PER_READ, Recording, Summary};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

use crate::common::{data, file};

/// Reads a file to its end or to an error; either is fine.
fn ends(path: &Path, format: Option<Format>) {
    match Summary::of_file(path, format) {
        Ok(summary) => assert_eq!(summary.events, summary.on + summary.off),
        Err(error) => assert!(error.to_string().contains(&path.display().to_string())),
    }
}

/// One of the real recordings.
fn real() -> impl Strategy<Value = Vec<u8>> {
    let names = [
        "evt3_hd_1280x720_trigger.raw",
        "davis346_events.aedat4",
        "davis346_events_zstd.aedat4",
        "davis346_usb_words_made.bin",
    ];
    prop::sample::select(names.to_vec()).prop_map(|name| {
        let mut bytes = std::fs::read(data(name)).unwrap();
        bytes.truncate(60_000);
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn arbitrary_bytes_as_any_format(bytes in vec(any::<u8>(), 0..2000), format in prop::sample::select(Format::ALL.to_vec())) {
        let (_folder, path) = file("anything", &bytes);
        ends(&path, Some(format));
        ends(&path, None);
    }

    #[test]
    fn real_files_with_a_flipped_bit_or_a_lost_end(
        mut bytes in real(),
        flips in vec((any::<Index>(), 0..8_u8), 0..6),
        keep in any::<Index>(),
        near_start in any::<bool>(),
    ) {
        for (place, bit) in &flips {
            let range = if near_start { bytes.len().min(900) } else { bytes.len() };
            bytes[place.index(range)] ^= 1 << bit;
        }
        bytes.truncate(keep.index(bytes.len()) + 1);
        let (_folder, path) = file("damaged", &bytes);
        ends(&path, None);
        for format in Format::ALL {
            ends(&path, Some(format));
        }
    }
}

#[test]
fn a_cut_aedat4_file_is_read_up_to_the_cut() {
    let bytes = std::fs::read(data("davis346_events.aedat4")).unwrap();
    let (_folder, path) = file("cut.aedat4", &bytes[..400_000]);
    let summary = Summary::of_file(&path, None).unwrap();
    assert!(summary.events > 40_000 && summary.events < 60_000);
    assert!(summary.damage.trailing_bytes > 0);
    assert_eq!(summary.damage.bad_packets, 0);
}

#[test]
fn a_packet_that_does_not_decompress_is_counted_and_passed_over() {
    let mut bytes = std::fs::read(data("davis346_events.aedat4")).unwrap();
    // The magic number of the first packet's LZ4 frame.
    bytes[838 + 8] ^= 0xFF;
    let (_folder, path) = file("bad.aedat4", &bytes);
    let summary = Summary::of_file(&path, None).unwrap();
    assert_eq!(summary.damage.bad_packets, 1);
    assert!(summary.events > 78_000 && summary.events < 78_830);
}

#[test]
fn times_that_go_back_are_delivered_and_counted() {
    let (_folder, path) = file("back.csv", b"t_us,x,y,p\n10,1,1,1\n5,1,1,1\n7,1,1,1\n");
    let mut recording = Recording::open(&path, None).unwrap();
    let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
    assert!(recording.read(&mut batch).unwrap());
    assert_eq!(batch.events.len(), 3);
    assert_eq!(recording.damage().time_reversals, 1);
}

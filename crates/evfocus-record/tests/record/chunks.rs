//! The decoders of live cameras give real recordings exactly, however the bytes come; so do the counters. `EVFOCUS_RECORDINGS=FOLDER`
//! does the same with a folder of more.

use std::path::{Path, PathBuf};

use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder, Evt3Counter, Evt3Decoder};
use evfocus_core::{Event, EventBatch, Geometry};
use evfocus_record::{Format, Recording};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::common::{data, read_file};

/// The words of a file, without its header.
fn words(path: &Path) -> Vec<u8> {
    const HEADER_END: &[u8] = b"% end\n";
    let bytes = std::fs::read(path).unwrap();
    let start = bytes.windows(HEADER_END.len()).position(|window| window == HEADER_END);
    bytes[start.map_or(0, |start| start + HEADER_END.len())..].to_vec()
}

/// Sizes of the chunks, used in turn: 1 byte to 1 MiB, small ones as likely as large ones.
fn sizes() -> impl Strategy<Value = Vec<usize>> {
    vec((0..=20_u32).prop_flat_map(|exponent| 1_usize..=1 << exponent), 1..40)
}

fn in_chunks(bytes: &[u8], sizes: &[usize], mut feed: impl FnMut(&[u8])) {
    let mut rest = bytes;
    let mut sizes = sizes.iter().cycle();
    while !rest.is_empty() {
        let (chunk, after) = rest.split_at(sizes.next().copied().unwrap_or(1).min(rest.len()));
        feed(chunk);
        rest = after;
    }
}

fn evt3_is_exact(path: &Path, geometry: Geometry, sizes: &[usize]) {
    let bytes = words(path);
    let expected = expected(path);
    let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(geometry));
    let (mut counted, mut counter) = (0, Evt3Counter::new(20));
    in_chunks(&bytes, sizes, |chunk| {
        decoder.decode(chunk, &mut batch);
        counter.count(chunk, |_, events| counted += events);
    });
    exact(path, &batch.events.to_vec(), &expected, counted);
    assert!(decoder.damage().is_none(), "{}: {:?}", path.display(), decoder.damage());
}

fn davis_is_exact(path: &Path, sizes: &[usize]) {
    let bytes = words(path);
    let expected = expected(path);
    let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::live());
    let (mut counted, mut counter) = (0, DavisWordCounter::new(20));
    in_chunks(&bytes, sizes, |chunk| {
        decoder.decode(chunk, &mut batch);
        counter.count(chunk, |_, events| counted += events);
    });
    exact(path, &batch.events.to_vec(), &expected, counted);
}

/// What others made of a recording, where that lies beside it as CSV; else what reading the file gives.
fn expected(path: &Path) -> Vec<Event> {
    let beside = path.with_extension("csv");
    read_file(if beside.exists() { &beside } else { path }, None)
}

fn exact(path: &Path, events: &[Event], expected: &[Event], counted: u64) {
    // Millions of events are no message.
    let (path, found) = (path.display(), events.len());
    assert!(events == expected, "{path}: {found} events, {} expected", expected.len());
    assert_eq!(counted, expected.len() as u64, "{path}");
}

/// Every recording of words in `folder`; the number of them.
fn folder_is_exact(folder: &Path, sizes: &[usize]) -> usize {
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    let mut recordings = 0;
    for path in paths {
        let Ok(recording) = Recording::open(&path, None) else { continue };
        match (recording.format(), recording.geometry()) {
            (Format::Evt3, Some(geometry)) => evt3_is_exact(&path, geometry, sizes),
            (Format::DavisWords, _) => davis_is_exact(&path, sizes),
            _ => continue,
        }
        recordings += 1;
    }
    recordings
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn recordings_in_chunks(sizes in sizes()) {
        prop_assert_eq!(folder_is_exact(&data(""), &sizes), 4);
        if let Some(folder) = std::env::var_os("EVFOCUS_RECORDINGS") {
            prop_assert!(folder_is_exact(Path::new(&folder), &sizes) > 0);
        }
    }
}

//! Counting straight from the words counts what decoding decodes.

use std::collections::BTreeMap;

use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder, Evt3Counter, Evt3Decoder};
use evfocus_core::{CameraMicros, EventBatch};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

use crate::common::{bytes_of, in_pieces};

/// Events by bin.
type Bins = BTreeMap<i64, u64>;

/// The decoded events by bin; the lost ones are those whose bin nobody knows.
fn decoded(batch: &EventBatch, bin_us: u32) -> (Bins, u64) {
    let mut bins = Bins::new();
    let bin_us = i64::from(bin_us);
    for event in batch.events.iter() {
        *bins.entry(event.t.0.div_euclid(bin_us) * bin_us).or_default() += 1;
    }
    (bins, batch.lost)
}

/// The bins that `count` makes of `bytes`, given to it in pieces.
fn counted(
    bytes: &[u8],
    cuts: &[Index],
    mut count: impl FnMut(&[u8], &mut dyn FnMut(CameraMicros, u64)),
) -> Bins {
    let mut bins = Bins::new();
    in_pieces(bytes, cuts, |piece| {
        count(piece, &mut |start, events| *bins.entry(start.0).or_default() += events);
    });
    bins
}

/// Words as a camera might send them: mostly columns and vectors, times that mostly rise.
fn evt3_word() -> impl Strategy<Value = u16> {
    let of = |kind: u16| move |payload: u16| kind << 12 | payload & 0xFFF;
    prop_oneof![
        30 => any::<u16>().prop_map(of(0x2)),
        20 => any::<u16>().prop_map(of(0x4)),
        10 => any::<u16>().prop_map(of(0x5)),
        8 => any::<u16>().prop_map(of(0x0)),
        8 => (0..1_000_u16).prop_map(of(0x3)),
        8 => (0..4096_u16).prop_map(of(0x6)),
        3 => (100..104_u16).prop_map(of(0x8)),
        1 => any::<u16>(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    /// With a sensor that has every address, and a row and a base first, nothing is lost and every bin is the same.
    #[test]
    fn evt3_bins_are_equal(
        words in vec(evt3_word(), 0..1500),
        bin_us in prop_oneof![Just(1_u32), Just(20), 1..9000_u32],
        cuts in vec(any::<Index>(), 0..4),
    ) {
        let mut bytes = bytes_of(&[0x0001, 0x3000]);
        // A long run of vectors would leave even 2048 columns; a fresh base in between keeps them on the sensor.
        bytes.extend(words.iter().flat_map(|&word| {
            let vector = matches!(word >> 12, 0x4 | 0x5);
            bytes_of(if vector { &[0x3000, 0] } else { &[0x1000, 0] }).into_iter().take(2).chain(word.to_le_bytes())
        }));
        let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(Evt3Decoder::MAX_GEOMETRY));
        decoder.decode(&bytes, &mut batch);
        let mut counter = Evt3Counter::new(bin_us);
        let bins = counted(&bytes, &cuts, |piece, bin| counter.count(piece, bin));
        prop_assert_eq!((bins, 0), decoded(&batch, bin_us));
        prop_assert_eq!(counter.reached(), batch.reached);
    }

    /// Whatever the bytes are, the total is what was decoded and what was dropped for its address.
    #[test]
    fn evt3_totals_are_equal(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(Evt3Decoder::MAX_GEOMETRY));
        decoder.decode(&bytes, &mut batch);
        let (mut total, mut counter) = (0, Evt3Counter::new(20));
        in_pieces(&bytes, &cuts, |piece| counter.count(piece, |_, events| total += events));
        // What the camera says it dropped was never in the words.
        let dropped = decoder.damage().dropped_by_camera;
        prop_assert_eq!(total, batch.events.len() as u64 + batch.lost - dropped);
        prop_assert_eq!(counter.reached(), batch.reached);
    }

    /// The same for the DAVIS346; with nothing dropped, each bin is the same too.
    #[test]
    fn davis_counts_are_equal(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::live());
        decoder.decode(&bytes, &mut batch);
        let mut counter = DavisWordCounter::new(20);
        let bins = counted(&bytes, &cuts, |piece, bin| counter.count(piece, bin));
        let (expected, lost) = decoded(&batch, 20);
        prop_assert_eq!(bins.values().sum::<u64>(), batch.events.len() as u64 + lost);
        prop_assert!(expected.iter().all(|(start, events)| bins.get(start) >= Some(events)));
        prop_assert!(lost > 0 || bins == expected);
        prop_assert_eq!(counter.reached(), batch.reached);
    }

    /// Dense streams, of which whole blocks of words lie within a bin, and the ends of bins anywhere in a block.
    #[test]
    fn evt3_dense_bins_are_equal(
        words in vec((0..40_u16, any::<u16>()), 0..3000),
        bin_us in prop_oneof![Just(20_u32), 1..60_u32, 1000..9000_u32],
        cuts in vec(any::<Index>(), 0..4),
    ) {
        let mut stream = vec![0x8000, 0x0001, 0x3000];
        let mut time = 4000_u32;
        for (kind, payload) in words {
            match kind {
                0 => {
                    time += u32::from(payload % 9);
                    stream.extend([0x8000 | (time >> 12 & 0xFFF) as u16, 0x6000 | (time & 0xFFF) as u16]);
                }
                // A fine time that falls is held; one of any size leaves the bin.
                1 => stream.push(0x6000 | (time & 0xFFF) as u16 & !(payload & 3)),
                2 if payload % 64 == 0 => stream.push(0x6000 | payload >> 6),
                3..20 => stream.push(0x2000 | payload & 0xFFF),
                _ => stream.extend([0x3000, 0x4000 | (kind & 1) << 12 | payload & 0xFFF]),
            }
        }
        let bytes = bytes_of(&stream);
        let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::live(Evt3Decoder::MAX_GEOMETRY));
        decoder.decode(&bytes, &mut batch);
        let mut counter = Evt3Counter::new(bin_us);
        let bins = counted(&bytes, &cuts, |piece, bin| counter.count(piece, bin));
        prop_assert_eq!((bins, 0), decoded(&batch, bin_us));
        prop_assert_eq!(counter.reached(), batch.reached);
    }

    /// The same for the DAVIS346, with times that fall within a bin: there a wrap is missing.
    #[test]
    fn davis_dense_bins_are_equal(
        words in vec((0..30_u16, any::<u16>()), 0..3000),
        bin_us in prop_oneof![Just(20_u32), 1..60_u32, 1000..90_000_u32],
        cuts in vec(any::<Index>(), 0..4),
    ) {
        let mut stream = vec![0x1001];
        let mut time = 32_700_u16;
        for (kind, payload) in words {
            match kind {
                0 if time > 0x7FF0 => {
                    stream.push(0x7001);
                    time = 0;
                }
                0 => time += payload % 9,
                1 if payload % 64 == 0 => stream.push([0x7002, 0x0001, 0x7001][usize::from(payload >> 6) % 3]),
                2 if payload % 64 == 0 => time = time.saturating_sub(payload >> 14),
                3 => stream.push(0x1000 | (payload % 346)),
                4 => stream.push(0x4000 | payload & 0x2FFF),
                5..10 => stream.push(0x8000 | time),
                _ => stream.push(0x2000 | payload & 0x1000 | (payload % 260)),
            }
        }
        let bytes = bytes_of(&stream);
        let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::live());
        decoder.decode(&bytes, &mut batch);
        let mut counter = DavisWordCounter::new(bin_us);
        let bins = counted(&bytes, &cuts, |piece, bin| counter.count(piece, bin));
        prop_assert_eq!((bins, 0), decoded(&batch, bin_us));
        prop_assert_eq!(counter.reached(), batch.reached);
    }
}

//! Decoding many words at a time gives what reading one word after the other gives.

use evfocus_core::decode::{DavisWordDecoder, Evt3Decoder};
use evfocus_core::{Event, EventBatch, Geometry};
use proptest::collection::vec;
use proptest::prelude::*;

use crate::common::{bytes_of, event};

const SENSOR: Geometry = Geometry { width: 1280, height: 720 };

/// EVT 3.0 by its text, for streams that begin with a TIME_HIGH and whose time does not go back by as much as it may.
fn evt3(words: &[u16]) -> Vec<Event> {
    let (mut events, mut high, mut time) = (Vec::new(), 0, 0);
    let (mut row, mut base, mut base_is_on) = (None, None, false);
    for &word in words {
        let (payload, address, upper) = (word & 0xFFF, word & 0x7FF, word & 0x800 != 0);
        match word >> 12 {
            0x0 => row = Some(address),
            0x2 => events.extend(row.map(|row| event(time, address, row, upper))),
            0x3 => (base, base_is_on) = (Some(address), upper),
            0x4 | 0x5 => {
                let pixels = if word >> 12 == 4 { 12 } else { 8 };
                let valid = (0..pixels).filter(|bit| payload >> bit & 1 == 1);
                if let (Some(row), Some(base)) = (row, base) {
                    events.extend(valid.map(|bit| event(time, base + bit, row, base_is_on)));
                }
                base = base.map(|base| base + pixels);
            }
            0x6 => time = high << 12 | i64::from(payload),
            0x8 if i64::from(payload) != high => {
                high = i64::from(payload);
                time = high << 12;
            }
            _ => {}
        }
    }
    events.retain(|event| SENSOR.contains(event.x, event.y));
    events
}

/// The DAVIS346's words by their text.
fn davis(words: &[u16]) -> Vec<Event> {
    let (mut events, mut wraps, mut time, mut column) = (Vec::new(), 0, None, None);
    for &word in words {
        let data = word & 0xFFF;
        match word >> 12 {
            1 => column = Some(data),
            2 | 3 => {
                let shared = time.zip(column);
                events.extend(shared.map(|(time, column)| event(time, column, data, word >> 12 == 3)));
            }
            7 => {
                wraps += i64::from(data) << 15;
                time = Some(wraps);
            }
            8.. => time = Some(wraps + i64::from(word & 0x7FFF)),
            _ => {}
        }
    }
    events.retain(|event| DavisWordDecoder::GEOMETRY.contains(event.x, event.y));
    events
}

fn of(kind: u16) -> impl Fn(u16) -> u16 {
    move |payload| kind << 12 | payload
}

/// Mostly single events, in runs of any length.
fn evt3_word() -> impl Strategy<Value = u16> {
    prop_oneof![
        60 => (0..1300_u16, any::<bool>()).prop_map(|(x, on)| 0x2000 | u16::from(on) << 11 | x),
        8 => (0..740_u16).prop_map(of(0x0)),
        6 => (0..4096_u16).prop_map(of(0x6)),
        2 => (100..104_u16).prop_map(of(0x8)),
        2 => (0..1300_u16).prop_map(of(0x3)),
        4 => (0..4096_u16).prop_map(of(0x4)),
        2 => (0..256_u16).prop_map(of(0x5)),
        1 => Just(0xE000),
    ]
}

fn davis_word() -> impl Strategy<Value = u16> {
    prop_oneof![
        60 => (0..270_u16, any::<bool>()).prop_map(|(y, on)| 0x2000 | u16::from(on) << 12 | y),
        10 => (0..360_u16).prop_map(of(0x1)),
        10 => (0..0x8000_u16).prop_map(|low| 0x8000 | low),
        1 => (1..3_u16).prop_map(of(0x7)),
        1 => (0..10_u16).prop_map(of(0x4)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1024))]

    #[test]
    fn evt3_is_decoded_by_its_text(words in vec(evt3_word(), 0..600)) {
        let words: Vec<u16> = [0x8064].into_iter().chain(words).collect();
        let mut batch = EventBatch::default();
        Evt3Decoder::new(SENSOR).decode(&bytes_of(&words), &mut batch);
        prop_assert_eq!(batch.events, evt3(&words));
    }

    #[test]
    fn davis_words_are_decoded_by_their_text(words in vec(davis_word(), 0..600)) {
        let mut batch = EventBatch::default();
        DavisWordDecoder::new().decode(&bytes_of(&words), &mut batch);
        prop_assert_eq!(batch.events, davis(&words));
    }
}

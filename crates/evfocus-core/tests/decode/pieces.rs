//! Whatever the bytes are and wherever they are cut, decoders neither panic nor change their mind.

use evfocus_core::decode::{DavisWordDecoder, Evt2Decoder, Evt3Decoder};
use evfocus_core::{CameraMicros, EventBatch, Geometry};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;

use crate::common::in_pieces;

const SENSOR: Geometry = Geometry { width: 640, height: 480 };

/// The whole and the pieces must give the same events, the same damage, and events on the sensor only.
macro_rules! splitting_changes_nothing {
    ($new:expr, $geometry:expr, $bytes:expr, $cuts:expr) => {{
        let (mut whole, mut decoder) = (EventBatch::default(), $new);
        decoder.decode($bytes, &mut whole);
        decoder.finish();
        let (mut pieces, mut piecewise) = (EventBatch::default(), $new);
        in_pieces($bytes, $cuts, |piece| piecewise.decode(piece, &mut pieces));
        piecewise.finish();
        prop_assert_eq!(&whole.events, &pieces.events);
        prop_assert_eq!(whole.reached, pieces.reached);
        prop_assert_eq!(whole.lost, pieces.lost);
        prop_assert_eq!(decoder.damage(), piecewise.damage());
        prop_assert_eq!(decoder.triggers(), piecewise.triggers());
        prop_assert!(whole.events.iter().all(|event| $geometry.contains(event.x, event.y)));
        prop_assert!(whole.events.len() <= $bytes.len() * Evt3Decoder::MAX_EVENTS_PER_BYTE);
    }};
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn evt3_in_pieces(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        splitting_changes_nothing!(Evt3Decoder::new(SENSOR), SENSOR, &bytes, &cuts);
    }

    #[test]
    fn evt2_in_pieces(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        splitting_changes_nothing!(Evt2Decoder::with_origin(SENSOR, CameraMicros(0)), SENSOR, &bytes, &cuts);
    }

    #[test]
    fn davis_words_in_pieces(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        splitting_changes_nothing!(DavisWordDecoder::new(), DavisWordDecoder::GEOMETRY, &bytes, &cuts);
    }

    #[test]
    fn live_decoders_in_pieces(bytes in vec(any::<u8>(), 0..4000), cuts in vec(any::<Index>(), 0..8)) {
        splitting_changes_nothing!(Evt3Decoder::live(SENSOR), SENSOR, &bytes, &cuts);
        splitting_changes_nothing!(DavisWordDecoder::live(), DavisWordDecoder::GEOMETRY, &bytes, &cuts);
    }
}

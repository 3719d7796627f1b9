//! The rules of decoding, word by word.

use evfocus_core::decode::{DavisWordDecoder, Evt2Decoder, Evt3Decoder, RESTART_LEAP_US};
use evfocus_core::{CameraMicros, Damage, EventBatch, EventList, Geometry};

use crate::common::{bytes_of, event};

const SENSOR: Geometry = Geometry { width: 1280, height: 720 };

fn evt3(words: &[u16]) -> (EventBatch, Evt3Decoder) {
    let bytes = bytes_of(words);
    let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::new(SENSOR));
    decoder.decode(&bytes, &mut batch);
    decoder.finish();
    (batch, decoder)
}

fn davis(words: &[u16]) -> (EventBatch, DavisWordDecoder) {
    let bytes = bytes_of(words);
    let (mut batch, mut decoder) = (EventBatch::default(), DavisWordDecoder::new());
    decoder.decode(&bytes, &mut batch);
    (batch, decoder)
}

#[test]
fn evt3_single_events_and_vectors() {
    // TIME_HIGH 1, TIME_LOW 2, ADDR_Y 7, ADDR_X 5 ON, base 100 OFF, vectors with their outermost bits.
    let (batch, decoder) = evt3(&[0x8001, 0x6002, 0x0007, 0x2805, 0x3064, 0x4801, 0x4801, 0x5081]);
    let t = 4098;
    let columns = [100, 111, 112, 123, 124, 131];
    let mut expected = vec![event(t, 5, 7, true)];
    expected.extend(columns.map(|x| event(t, x, 7, false)));
    assert_eq!(batch.events, expected);
    assert_eq!(batch.reached, Some(CameraMicros(t)));
    assert!(decoder.damage().is_none());
}

#[test]
fn evt3_drops_what_lacks_time_or_address() {
    // A column before the time; then one before the row; a vector before its base.
    let (batch, decoder) = evt3(&[0x0001, 0x2001, 0x8001]);
    assert_eq!((batch.events.len(), decoder.damage().events_before_time), (0, 1));
    let (batch, decoder) = evt3(&[0x8001, 0x2001, 0x4003]);
    assert_eq!((batch.events.len(), batch.lost), (0, 3));
    assert_eq!(decoder.damage(), Damage { events_before_address: 3, ..Damage::default() });
}

#[test]
fn evt3_drops_rows_and_columns_beyond_the_sensor() {
    // Row 720, then row 719 with columns 1279 and 1280.
    let (batch, decoder) = evt3(&[0x8000, 0x02D0, 0x2001, 0x2002, 0x02CF, 0x24FF, 0x2500]);
    assert_eq!(batch.events, [event(0, 1279, 719, false)]);
    assert_eq!((decoder.damage().outside_sensor, batch.lost), (3, 3));
}

#[test]
fn evt3_time_wraps_and_goes_back() {
    let times = |words: &[u16]| -> Vec<i64> {
        let (batch, _) = evt3(words);
        batch.events.iter().map(|event| event.t.0).collect()
    };
    // 4095 to 0 is a wrap, even across lost words (4000 to 1000: a fall of 3000).
    assert_eq!(times(&[0x0001, 0x8FFF, 0x6FFF, 0x2001, 0x8000, 0x2001]), [(1 << 24) - 1, 1 << 24]);
    assert_eq!(times(&[0x0001, 0x8FA0, 0x2001, 0x83E8, 0x2001]), [4000 << 12, (1 << 24) + (1000 << 12)]);
    // A fall of less than 2048 is a step back.
    assert_eq!(times(&[0x0001, 0x8064, 0x2001, 0x8060, 0x2001]), [100 << 12, 96 << 12]);
    // A repeated TIME_HIGH keeps the low bits, a new one clears them.
    assert_eq!(
        times(&[0x0001, 0x8064, 0x6005, 0x8064, 0x2001, 0x8065, 0x2001]),
        [(100 << 12) + 5, 101 << 12]
    );
    let (_, decoder) = evt3(&[0x8064, 0x8065, 0x8067]);
    assert_eq!(decoder.damage().time_jumps, 1);
}

#[test]
fn evt3_counts_triggers_unknown_words_and_a_half_word() {
    let (batch, decoder) = evt3(&[0xA001, 0x8000, 0xA101, 0x1000, 0xB000, 0xE014, 0xF001, 0x7001]);
    assert!(batch.events.is_empty());
    assert_eq!((decoder.triggers(), decoder.damage().unknown_words), (1, 2));
    let (mut batch, mut decoder) = (EventBatch::default(), Evt3Decoder::new(SENSOR));
    decoder.decode(&[0x01], &mut batch);
    decoder.finish();
    assert_eq!(decoder.damage().trailing_bytes, 1);
}

#[test]
fn evt3_tells_what_the_rate_controller_dropped() {
    // 0x1234567 events in, 0x1234500 out; then counts without the other one, and one cut short by another word.
    let (batch, decoder) = evt3(&[0x8000, 0xE014, 0xF567, 0xF234, 0x7001, 0xE016, 0xF500, 0xF234, 0x7001]);
    assert_eq!((batch.lost, decoder.damage().dropped_by_camera), (0x67, 0x67));
    let (batch, _) = evt3(&[0x8000, 0xE016, 0xF000, 0xF000, 0x7000, 0xE014, 0xF001, 0xE019, 0xF002, 0x7000]);
    assert_eq!(batch.lost, 0);
    // Another pair: as many out as in.
    let (batch, _) = evt3(&[0x8000, 0xE014, 0xF007, 0xF000, 0x7000, 0xE016, 0xF007, 0xF000, 0x7000]);
    assert_eq!(batch.lost, 0);
}

#[test]
fn evt2_events_and_wrap() {
    let high = |micros: u64| 0x8000_0000 | (micros >> 6) as u32;
    let on = |fine: u32, x: u32, y: u32| 0x1000_0000 | fine << 22 | x << 11 | y;
    let last = (1 << 34) - 64;
    let words = [
        on(0, 1, 1),
        high(640),
        on(63, 1279, 719),
        on(0, 1280, 0),
        high(last),
        on(1, 2, 3),
        high(0),
        on(2, 2, 3),
    ];
    let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
    let (mut batch, mut decoder) = (EventBatch::default(), Evt2Decoder::with_origin(SENSOR, CameraMicros(0)));
    decoder.decode(&bytes, &mut batch);
    let expected =
        [event(703, 1279, 719, true), event(last as i64 + 1, 2, 3, true), event((1 << 34) + 2, 2, 3, true)];
    assert_eq!(batch.events, expected);
    assert_eq!(decoder.damage(), Damage { events_before_time: 1, outside_sensor: 1, ..Damage::default() });
}

#[test]
fn davis_axes_are_exchanged_and_time_survives_wraps_and_resets() {
    // Reset, time 5, row 345, column 259 ON; wrap by 3, column 0 OFF; reset, column 1 OFF.
    let (batch, decoder) = davis(&[0x0001, 0x8005, 0x1159, 0x3103, 0x7003, 0x2000, 0x0001, 0x2001]);
    let expected = [event(5, 345, 259, true), event(3 << 15, 345, 0, false), event(0, 345, 1, false)];
    assert_eq!(batch.events, expected);
    assert_eq!(decoder.damage(), Damage { time_jumps: 1, timestamp_resets: 1, ..Damage::default() });
}

#[test]
fn davis_drops_addresses_beyond_the_sensor() {
    // Row 346 and its column, row 0, column 260, column 259; external pulse.
    let (batch, decoder) = davis(&[0x8005, 0x115A, 0x2000, 0x1000, 0x2104, 0x2103, 0x0004]);
    assert_eq!(batch.events, [event(5, 0, 259, false)]);
    assert_eq!((decoder.damage().outside_sensor, batch.lost), (2, 2));
    assert_eq!(decoder.triggers(), 1);
}

#[test]
fn live_times_never_go_back() {
    let times = |batch: &EventBatch| batch.events.iter().map(|event| event.t.0).collect::<Vec<_>>();
    let mut batch = EventBatch::default();
    // EVT3: a fine time that falls is held; a coarse one that falls is a restart of the camera's clock.
    let mut decoder = Evt3Decoder::live(SENSOR);
    let words = [0x0001, 0x8064, 0x6009, 0x2001, 0x6005, 0x2001, 0x8060, 0x2001, 0x8061, 0x2001];
    decoder.decode(&bytes_of(&words), &mut batch);
    let first = (100 << 12) + 9;
    let restart = first + RESTART_LEAP_US;
    assert_eq!(times(&batch), [first, first, restart, restart + 4096]);
    assert_eq!((decoder.damage().timestamp_resets, decoder.damage().time_jumps), (1, 1));
    // DAVIS: a time that falls means that a wrap word was lost; a reset leaps.
    let mut decoder = DavisWordDecoder::live();
    batch.clear();
    let words = [0x8009, 0x1001, 0x2001, 0x8005, 0x2001, 0x0001, 0x2001, 0x8007, 0x2001, 0x7002, 0x2001];
    decoder.decode(&bytes_of(&words), &mut batch);
    let restart = (1 << 15) + 5 + RESTART_LEAP_US;
    assert_eq!(times(&batch), [9, (1 << 15) + 5, restart, restart + 7, restart + (2 << 15)]);
    assert_eq!((decoder.damage().timestamp_resets, decoder.damage().time_jumps), (1, 2));
}

#[test]
fn four_thousand_wraps_in_a_row_are_that_much_time() {
    let (batch, _) = davis(&[0x7001; 4096]);
    assert_eq!(batch.reached, Some(CameraMicros(4096 << 15)));
    let (batch, decoder) = davis(&[0x7FFF, 0x8001]);
    assert_eq!((batch.reached, decoder.damage().time_jumps), (Some(CameraMicros((4095 << 15) + 1)), 1));
}

#[test]
fn a_stream_of_zeros_is_no_events_and_no_time() {
    let zeros = vec![0; 1 << 20];
    let (mut batch, mut evt3, mut davis) =
        (EventBatch::default(), Evt3Decoder::live(SENSOR), DavisWordDecoder::live());
    evt3.decode(&zeros, &mut batch);
    davis.decode(&zeros, &mut batch);
    assert_eq!((batch.events.len(), batch.reached, batch.lost), (0, None, 0));
    // To EVT3 a zero is the first row; a DAVIS346 never sends one.
    assert!(evt3.damage().is_none());
    assert_eq!(davis.damage(), Damage { unknown_words: 1 << 19, ..Damage::default() });
}

/// 65,536 wraps of 16.8 s are 12.7 days, and a batch keeps what is not farther from its first event.
#[test]
fn events_days_after_the_first_of_their_batch_are_lost_and_counted() {
    let mut words = vec![0x0001, 0x8000, 0x2001];
    words.extend([0x8FFF, 0x8000].repeat(65_537));
    words.extend([0x2001, 0x2001, 0x3001, 0x4003]);
    let (batch, decoder) = evt3(&words);
    assert_eq!((batch.events, batch.lost), (EventList::of([event(0, 1, 1, false)]).unwrap(), 4));
    assert_eq!(decoder.damage().too_far_in_time, 4);

    let mut words = vec![0x8000, 0x1001, 0x2001];
    words.extend([0x7FFF].repeat(8200));
    words.extend([0x2001, 0x2001]);
    let (batch, decoder) = davis(&words);
    assert_eq!((batch.events, batch.lost), (EventList::of([event(0, 1, 1, false)]).unwrap(), 2));
    assert_eq!(decoder.damage().too_far_in_time, 2);
    // The next batch begins anew.
    let (mut next, mut decoder) = (EventBatch::default(), decoder);
    decoder.decode(&bytes_of(&[0x2001]), &mut next);
    assert_eq!(next.events, [event(8200 * (4095 << 15), 1, 1, false)]);
}

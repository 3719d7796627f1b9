//! How fast events are counted and decoded from the words of cameras, on one core: `cargo bench -p evfocus-core --bench words`.
//! For each transfer the shortest of several repeats counts, since noise only ever adds time. The sum of the same bytes shows what
//! memory gives at best.
#![expect(clippy::print_stdout, reason = "the figures are what this program is for")]
#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use core::hint::black_box;
use core::time::Duration;
use std::time::Instant;

use evfocus_core::decode::{DavisWordCounter, DavisWordDecoder, Evt3Counter, Evt3Decoder};
use evfocus_core::{EventBatch, Geometry};

const REPEATS: usize = 12;
/// Bytes of a stream: more than the caches hold.
const STREAM_BYTES: usize = 64 << 20;
/// Bytes of a transfer.
const TRANSFER_BYTES: usize = 16 << 10;
const SENSOR: Geometry = Geometry { width: 1280, height: 720 };
/// Width of the counter's bins, microseconds.
const BIN_US: u32 = 20;

/// A generator of numbers that look random (xorshift).
struct Random(u32);

impl Random {
    fn next(&mut self) -> u16 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        (self.0 >> 8) as u16
    }

    fn below(&mut self, end: u16) -> u16 {
        self.next() % end
    }
}

/// EVT 3.0 words: in each microsecond `rows` rows, in each of them single events or a vector.
fn evt3(rows: u16, singles: u16) -> Vec<u8> {
    let mut random = Random(1);
    let mut words = Vec::with_capacity(STREAM_BYTES / 2);
    let mut time = 0_u32;
    while words.len() < STREAM_BYTES / 2 - 1000 {
        if time.is_multiple_of(16) {
            words.push(0x8000 | (time >> 12) as u16 & 0xFFF);
        }
        words.push(0x6000 | time as u16 & 0xFFF);
        for _ in 0..rows {
            words.push(random.below(SENSOR.height));
            let polarity = random.below(2) << 11;
            if singles > 0 {
                for _ in 0..singles {
                    words.push(0x2000 | polarity | random.below(SENSOR.width));
                }
            } else {
                words.push(0x3000 | polarity | random.below(SENSOR.width - 32));
                words.push(0x4000 | (random.next() | random.next()) & 0xFFF);
                words.push(0x4000 | (random.next() | random.next()) & 0xFFF);
                words.push(0x5000 | (random.next() | random.next()) & 0xFF);
            }
        }
        time += 1;
    }
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// DAVIS346 words: each microsecond a row with `columns` events.
fn davis(columns: u16) -> Vec<u8> {
    let mut random = Random(1);
    let mut words = Vec::with_capacity(STREAM_BYTES / 2);
    let mut time = 0_u32;
    while words.len() < STREAM_BYTES / 2 - 100 {
        time += 1;
        words.push(if time.is_multiple_of(1 << 15) { 0x7001 } else { 0x8000 | time as u16 });
        words.push(0x1000 | random.below(346));
        words.extend((0..columns).map(|_| 0x2000 | (random.below(2) << 12) | random.below(260)));
    }
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// How long `work` takes on all transfers, seconds, and what it returns for them; `begin` makes its state.
fn shortest<State>(
    bytes: &[u8],
    begin: impl Fn() -> State,
    work: impl Fn(&mut State, &[u8]) -> u64,
) -> (f64, u64) {
    let mut times = vec![Duration::MAX; bytes.len().div_ceil(TRANSFER_BYTES)];
    let mut result = 0;
    for _ in 0..REPEATS {
        let mut state = begin();
        result = 0;
        for (time, transfer) in times.iter_mut().zip(bytes.chunks(TRANSFER_BYTES)) {
            let since = Instant::now();
            result += black_box(work(&mut state, black_box(transfer)));
            *time = since.elapsed().min(*time);
        }
    }
    (times.iter().sum::<Duration>().as_secs_f64(), result)
}

fn line(what: &str, bytes: usize, (seconds, events): (f64, u64), sum_s: f64) {
    let per_event = seconds * 1e9 / events as f64;
    let rate = bytes as f64 / seconds / 1e9;
    println!(
        "  {what:<8} {per_event:6.2} ns/event  {rate:6.2} GB/s  {:3.0} % of the sum",
        100.0 * sum_s / seconds
    );
}

fn measure<Counter, Decoder>(
    name: &str,
    bytes: &[u8],
    counter: impl Fn() -> Counter,
    count: impl Fn(&mut Counter, &[u8]) -> u64,
    decoder: impl Fn() -> Decoder,
    decode: impl Fn(&mut Decoder, &[u8], &mut EventBatch),
) {
    let sum = |(): &mut (), transfer: &[u8]| {
        let eights = transfer.as_chunks::<8>().0.iter();
        eights.fold(0, |sum: u64, &eight| sum.wrapping_add(u64::from_le_bytes(eight))) & 1
    };
    let (sum_s, _) = shortest(bytes, || (), sum);
    println!("{name}: {:.1} GB/s summed", bytes.len() as f64 / sum_s / 1e9);
    line("count", bytes.len(), shortest(bytes, counter, count), sum_s);
    let begin = || (decoder(), EventBatch::with_capacity(TRANSFER_BYTES * Evt3Decoder::MAX_EVENTS_PER_BYTE));
    let decoded = shortest(bytes, begin, |(decoder, batch), transfer| {
        batch.clear();
        decode(decoder, transfer, batch);
        batch.events.len() as u64
    });
    line("decode", bytes.len(), decoded, sum_s);
}

fn main() {
    for (name, rows, singles) in [
        ("EVT3, 20 million events/s", 5, 4),
        ("EVT3, 200 million events/s", 8, 0),
        ("EVT3, 1000 million events/s", 40, 0),
    ] {
        let bytes = evt3(rows, singles);
        let count = |counter: &mut Evt3Counter, transfer: &[u8]| {
            let mut total = 0;
            counter.count(transfer, |_, events| total += events);
            total
        };
        let decode = |decoder: &mut Evt3Decoder, transfer: &[u8], batch: &mut EventBatch| {
            decoder.decode(transfer, batch);
        };
        measure(name, &bytes, || Evt3Counter::new(BIN_US), count, || Evt3Decoder::live(SENSOR), decode);
    }
    let bytes = davis(10);
    let count = |counter: &mut DavisWordCounter, transfer: &[u8]| {
        let mut total = 0;
        counter.count(transfer, |_, events| total += events);
        total
    };
    let decode = |decoder: &mut DavisWordDecoder, transfer: &[u8], batch: &mut EventBatch| {
        decoder.decode(transfer, batch);
    };
    let name = "DAVIS346, 10 million events/s";
    measure(name, &bytes, || DavisWordCounter::new(BIN_US), count, DavisWordDecoder::live, decode);
}

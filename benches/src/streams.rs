//! Streams as cameras send them, made by rule, with as many events as are said.

use evfocus_core::Geometry;

/// The sensor of the EVT3 streams.
pub const SENSOR: Geometry = Geometry { width: 1280, height: 720 };
/// Width of the bins that are counted into, microseconds.
pub const BIN_US: u32 = 20;
/// Bytes of a stream: more than the caches hold. Its time must not wrap, or the peer sees the second pass as one in the past.
const STREAM_BYTES: usize = 16 << 20;

/// Words, and how many events they hold.
pub struct Stream {
    pub name: &'static str,
    pub bytes: Vec<u8>,
    pub events: u64,
}

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

/// EVT 3.0 words of 20, 200 and 1000 million events a second.
pub fn evt3() -> [Stream; 3] {
    [
        one_evt3("EVT3, 20 million events/s", 5, 4),
        one_evt3("EVT3, 200 million events/s", 8, 0),
        one_evt3("EVT3, 1000 million events/s", 40, 0),
    ]
}

/// In each microsecond `rows` rows, in each of them so many single events in the mean or, for 0 of those, a vector of 32 pixels.
fn one_evt3(name: &'static str, rows: u16, singles: u16) -> Stream {
    let mut random = Random(1);
    let mut words: Vec<u16> = Vec::with_capacity(STREAM_BYTES / 2);
    let mut events = 0;
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
                let run = 1 + random.below(2 * singles - 1);
                words.extend((0..run).map(|_| 0x2000 | polarity | random.below(SENSOR.width)));
                events += u64::from(run);
            } else {
                words.push(0x3000 | polarity | random.below(SENSOR.width - 32));
                for (kind, mask) in [(0x4000, 0xFFF), (0x4000, 0xFFF), (0x5000, 0xFF)] {
                    let valid = (random.next() | random.next()) & mask;
                    events += u64::from(valid.count_ones());
                    words.push(kind | valid);
                }
            }
        }
        time += 1;
    }
    Stream { name, bytes: bytes_of(&words), events }
}

/// DAVIS346 words: in each microsecond a row, of ten events in the mean, and of two.
pub fn davis() -> [Stream; 2] {
    [one_davis("DAVIS346, rows of 10 events", 10), one_davis("DAVIS346, rows of 2 events", 2)]
}

fn one_davis(name: &'static str, columns: u16) -> Stream {
    let mut random = Random(1);
    let mut words: Vec<u16> = Vec::with_capacity(STREAM_BYTES / 2);
    let (mut time, mut events) = (0_u32, 0);
    while words.len() < STREAM_BYTES / 2 - 100 {
        time += 1;
        words.push(if time.is_multiple_of(1 << 15) { 0x7001 } else { 0x8000 | time as u16 });
        words.push(0x1000 | random.below(346));
        let run = 1 + random.below(2 * columns - 1);
        words.extend((0..run).map(|_| 0x2000 | (random.below(2) << 12) | random.below(260)));
        events += u64::from(run);
    }
    Stream { name, bytes: bytes_of(&words), events }
}

fn bytes_of(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

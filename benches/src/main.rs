//! How fast events are counted and decoded from the words of cameras, beside the crate `neuromorphic-drivers` and beside the sum of the
//! same bytes, which is what memory gives: `benches/run`.
//!
//! Each round measures all of them on the same bytes, one after the other, so that what disturbs the machine disturbs all; a ratio is
//! the median of the rounds' ratios.

mod ours;
mod peer;
mod streams;

use std::hint::black_box;
use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

use streams::Stream;

/// Rounds of which the median counts.
const ROUNDS: usize = 11;
/// Bytes handed over at a time, whose events stay in the cache.
const TRANSFER_BYTES: usize = 16 << 10;
/// What a saturated EVK4 sends, bytes a second.
const SATURATED: f64 = 400e6;

/// One contestant.
pub trait Work {
    /// Begins with a new stream; memory is kept.
    fn begin(&mut self);
    /// Works on a transfer and says how many events it found.
    fn transfer(&mut self, bytes: &[u8]) -> u64;
}

/// The processor's time that this thread has had: what others take from it meanwhile does not count.
fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}

/// Seconds of the processor for all transfers of a stream, and the events found.
fn timed(work: &mut dyn Work, bytes: &[u8]) -> (f64, u64) {
    work.begin();
    let since = processor_time();
    let events = bytes.chunks(TRANSFER_BYTES).map(|transfer| work.transfer(black_box(transfer))).sum();
    ((processor_time() - since).as_secs_f64(), black_box(events))
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The sum of the bytes.
struct Sum;

impl Work for Sum {
    fn begin(&mut self) {}

    fn transfer(&mut self, bytes: &[u8]) -> u64 {
        let eights = bytes.as_chunks::<8>().0.iter();
        eights.fold(0, |sum: u64, &eight| sum.wrapping_add(u64::from_le_bytes(eight))) & 1
    }
}

/// What a contest is about, and how many times as fast ours is to be.
struct Contest<'a> {
    name: &'a str,
    target: f64,
    ours: Box<dyn Work>,
    peer: Box<dyn Work>,
}

fn run(stream: &Stream, contests: Vec<Contest<'_>>, named: &str) {
    let bytes = &stream.bytes;
    println!("{}: {:.1} words an event", stream.name, bytes.len() as f64 / 2.0 / stream.events as f64);
    for Contest { name, target, mut ours, mut peer } in contests {
        if !format!("{} {name}", stream.name).contains(named) {
            continue;
        }
        let (mut ratios, mut shares, mut our_s, mut peer_s) = (vec![], vec![], vec![], vec![]);
        for round in 0..=ROUNDS {
            let (sum_s, _) = timed(&mut Sum, bytes);
            let (ours_s, ours_events) = timed(ours.as_mut(), bytes);
            let (theirs_s, theirs_events) = timed(peer.as_mut(), bytes);
            assert_eq!(ours_events, stream.events, "{name}: ours finds the events that were made");
            assert_eq!(theirs_events, stream.events, "{name}: theirs finds the events that were made");
            // The first round warms up.
            if round > 0 {
                ratios.push(theirs_s / ours_s);
                shares.push(sum_s / ours_s);
                our_s.push(ours_s);
                peer_s.push(theirs_s);
            }
        }
        let (ratio, our_s, peer_s) = (median(ratios), median(our_s), median(peer_s));
        let (size, events) = (bytes.len() as f64, stream.events as f64);
        println!(
            "  {name:<6} {:6.2} GB/s {:6.3} ns/event | theirs {:5.2} GB/s | {ratio:5.1} x (at least {target}) {} | {:3.0} % of memory \
             | 400 MB/s take {:4.1} % of a core",
            size / our_s / 1e9,
            our_s * 1e9 / events,
            size / peer_s / 1e9,
            if ratio >= target { "reached" } else { "MISSED " },
            100.0 * median(shares),
            100.0 * SATURATED * our_s / size,
        );
    }
}

fn main() {
    let named = std::env::args().nth(1).unwrap_or_default();
    for (stream, counting) in streams::evt3().iter().zip([6.0, 10.0, 10.0]) {
        let count = Contest {
            name: "count",
            target: counting,
            ours: Box::new(ours::Evt3Count::new()),
            peer: Box::new(peer::Evt3Count::new()),
        };
        let decode = Contest {
            name: "decode",
            target: 4.0,
            ours: Box::new(ours::Evt3Decode::new()),
            peer: Box::new(peer::Evt3Decode::new()),
        };
        run(stream, vec![count, decode], &named);
    }
    for stream in streams::davis() {
        let count = Contest {
            name: "count",
            target: 5.0,
            ours: Box::new(ours::DavisCount::new()),
            peer: Box::new(peer::DavisCount::new()),
        };
        let decode = Contest {
            name: "decode",
            target: 2.0,
            ours: Box::new(ours::DavisDecode::new()),
            peer: Box::new(peer::DavisDecode::new()),
        };
        run(&stream, vec![count, decode], &named);
    }
}

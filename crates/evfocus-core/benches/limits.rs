//! The promised figures, measured and held against their limits: `cargo bench -p evfocus-core --bench limits`. Ends with an error
//! when a figure is above its limit. The best of several repeats counts, since noise only ever adds time.
#![expect(clippy::print_stdout, reason = "the figures are what this program is for")]
#![expect(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

use core::cell::RefCell;
use core::hint::black_box;
use core::time::Duration;
use std::error::Error;
use std::process::ExitCode;
use std::time::Instant;

use evfocus_core::search::Travel;
use evfocus_core::{
    Analyzer, CameraMicros, CumulativeCounter, Event, Events, Geometry, LegReport, Method, Question,
    Searcher, SharpnessMeter, SweepCapacity, SweepLimits, SweepRecorder,
};

#[path = "support/sweep.rs"]
mod sweep;

const MOST_NS_PER_EVENT: f64 = 2.0;
const MOST_US_PER_SEARCH: f64 = 100.0;
/// The search takes differences of sums, so ten times the events may not cost more than noise.
const MOST_TIMES_LONGER: f64 = 1.5;
/// `structure` goes over every event; a million, a busy sweep of this sensor, then take no longer than a lens does to start.
const MOST_NS_PER_EVENT_READ: f64 = 25.0;
/// All that `auto` does of an event, live and afterwards.
const MOST_NS_PER_EVENT_OF_AUTO: f64 = 60.0;
/// And nobody waits for the answer, even of a sweep of two million events.
const MOST_MS_FOR_A_RESULT: f64 = 50.0;
/// What watching for lost focus costs, day and night.
const MOST_NS_PER_EVENT_WATCHED: f64 = 5.0;
/// Whether the sweep may end is asked while events come in.
const MOST_MS_TO_DECIDE: f64 = 5.0;
const SMALL: Geometry = Geometry { width: 346, height: 260 };
const REPEATS: usize = 8;
/// Batches of [`sweep::BATCH`] events: 100 million events.
const BATCHES: usize = 100;

/// Nanoseconds an event that `work` spends on 100 million events, as a hundred batches that follow one another in time; only the work
/// is measured, not the making of events. For each batch the shortest of all repeats counts: on a busy machine no repeat goes
/// through from begin to end undisturbed, but each batch, a millisecond, does at some time.
fn ns_per_event(length_us: i64, begin: impl FnMut(), work: impl FnMut(Events<'_>)) -> f64 {
    ns_per_event_at(sweep::GEOMETRY, length_us, begin, work)
}

/// The same for another sensor.
fn ns_per_event_at(
    geometry: Geometry,
    length_us: i64,
    mut begin: impl FnMut(),
    mut work: impl FnMut(Events<'_>),
) -> f64 {
    let mut batch = sweep::batch(0, length_us);
    for event in &mut batch {
        event.x %= geometry.width;
        event.y %= geometry.height;
    }
    let mut shortest = [Duration::MAX; BATCHES];
    for _ in 0..REPEATS {
        begin();
        for shortest in &mut shortest {
            let list = sweep::list(&batch);
            let since = Instant::now();
            work(black_box(&list).as_slice());
            *shortest = since.elapsed().min(*shortest);
            sweep::delay(&mut batch, length_us);
        }
        sweep::delay(&mut batch, -length_us * BATCHES as i64);
    }
    shortest.iter().sum::<Duration>().as_secs_f64() * 1e9 / (BATCHES * sweep::BATCH) as f64
}

/// How long a search takes on each of `sweeps` (events counted, of these kept). In turns, so that a machine that changes its speed
/// does so for all of them; the shortest of many counts.
fn searches<const N: usize>(sweeps: [(usize, usize); N]) -> Result<[Duration; N], Box<dyn Error>> {
    let recorded = sweeps.map(|(events, kept)| sweep::sweep(events, kept));
    let mut searcher = Searcher::new(sweep::GEOMETRY);
    // A search takes about a microsecond: many together, or the clock's own grain would be measured.
    let together = 100;
    let mut shortest = [Duration::MAX; N];
    for _ in 0..400 {
        for ((recorder, trace), shortest) in recorded.iter().zip(&mut shortest) {
            let sweep = recorder.sweep(trace).ok_or("no sweep")?;
            let begin = Instant::now();
            for _ in 0..together {
                black_box(searcher.search(Method::Egs, black_box(&sweep), Duration::ZERO))?;
            }
            *shortest = (*shortest).min(begin.elapsed() / together);
        }
    }
    Ok(shortest)
}

/// Nanoseconds that `structure` takes for each event, and milliseconds for the result whatever their number; on events that are all over the sensor: the
/// hardest for the caches.
fn structure() -> Result<(f64, f64), Box<dyn Error>> {
    let mut events = sweep::batch(0, sweep::SWEEP_US);
    for event in &mut events {
        event.x %= SMALL.width;
        event.y %= SMALL.height;
    }
    let half = events.len() / 2;
    let [some, all] = structure_of([&events[..half], &events])?;
    let each = (all - some) / (events.len() - half) as f64;
    Ok((each * 1e9, (some - each * half as f64) * 1e3))
}

/// Seconds for each of `sweeps`, in turn, so that both see the computer in the same moods.
fn structure_of<const N: usize>(sweeps: [&[Event]; N]) -> Result<[f64; N], Box<dyn Error>> {
    let recorders = sweeps.map(|events| {
        let mut recorder =
            SweepRecorder::new(SMALL, SweepCapacity { events: events.len(), ..SweepCapacity::default() });
        recorder.start(CameraMicros(0));
        recorder.feed(sweep::list(events).as_slice());
        recorder
    });
    let trace = sweep::trace();
    let mut searcher = Searcher::new(SMALL);
    let mut shortest = [Duration::MAX; N];
    for _ in 0..20 * REPEATS {
        for (recorder, shortest) in recorders.iter().zip(&mut shortest) {
            let sweep = recorder.sweep(&trace).ok_or("no sweep")?;
            let begin = Instant::now();
            // Events by chance make no picture: the refusal is the answer, and all the work is done before it.
            assert!(
                black_box(searcher.search(Method::Structure, black_box(&sweep), Duration::ZERO)).is_err()
            );
            *shortest = begin.elapsed().min(*shortest);
        }
    }
    Ok(shortest.map(|shortest| shortest.as_secs_f64()))
}

/// What `auto` costs in a run.
struct Auto {
    ns_per_event: f64,
    ms_for_the_result: f64,
    ms_to_decide: f64,
}

/// A sweep of two million events, taken live as the controller does it, batch by batch.
fn auto() -> Result<Auto, Box<dyn Error>> {
    let mut events = sweep::batch(0, sweep::SWEEP_US / 2);
    events.extend(
        sweep::batch(0, sweep::SWEEP_US / 2)
            .into_iter()
            .map(|event| Event { t: CameraMicros(event.t.0 + sweep::SWEEP_US / 2), ..event }),
    );
    for event in &mut events {
        event.x %= SMALL.width;
        event.y %= SMALL.height;
    }
    let trace = sweep::trace();
    let (from, to) = (trace.first().ok_or("no trace")?.1, trace.last().ok_or("no trace")?.1);
    let mut recorder =
        SweepRecorder::new(SMALL, SweepCapacity { events: events.len(), ..SweepCapacity::default() });
    let mut analyzer = Analyzer::new(SMALL);
    let question = Question {
        method: Method::Auto,
        interval: Duration::from_millis(55),
        limits: SweepLimits::default(),
        ask_all: false,
    };
    let mut report = LegReport::empty();
    // The shortest of all repeats for each batch, as in `ns_per_event`.
    let mut live = [Duration::MAX; BATCHES];
    let (mut result, mut decision) = (Duration::MAX, Duration::MAX);
    for _ in 0..8 * REPEATS {
        recorder.start(CameraMicros(0));
        analyzer.begin(Travel::new(from, to)?);
        for (batch, shortest) in events.chunks(events.len().div_ceil(BATCHES)).zip(&mut live) {
            recorder.feed(sweep::list(batch).as_slice());
            let begin = Instant::now();
            analyzer.take(&recorder, &trace);
            *shortest = begin.elapsed().min(*shortest);
        }
        let begin = Instant::now();
        black_box(analyzer.has_passed_peak());
        decision = decision.min(begin.elapsed());
        let begin = Instant::now();
        // Events by chance make no picture; all the work is done before that is said.
        assert!(black_box(analyzer.analyze(&recorder, &trace, question, &mut report)).is_err());
        result = result.min(begin.elapsed());
    }
    Ok(Auto {
        ns_per_event: (live.iter().sum::<Duration>() + result).as_secs_f64() * 1e9 / events.len() as f64,
        ms_for_the_result: result.as_secs_f64() * 1e3,
        ms_to_decide: decision.as_secs_f64() * 1e3,
    })
}

fn within(what: &str, figure: f64, limit: f64, unit: &str) -> bool {
    let verdict = if figure <= limit { "pass" } else { "FAIL" };
    println!("{verdict}  {what}: {figure:.3} {unit}, limit {limit} {unit}, {:.2} of it", figure / limit);
    figure <= limit
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let mut all_within = true;
    let reading = ns_per_event(
        40_000,
        || (),
        |events| {
            black_box(events.iter().map(|event| event.polarity as u64).sum::<u64>());
        },
    );
    println!("      for comparison, only reading the events: {reading:.3} ns/event");
    let counter = CumulativeCounter::new(CumulativeCounter::DEFAULT_BIN, Duration::from_secs(20));
    let counter = RefCell::new(counter);
    for (rate, length_us, size) in
        [("25 M/s", 40_000, 16_384), ("25 M/s", 40_000, 512), ("6 M/s", 160_000, 16_384)]
    {
        let begin = || counter.borrow_mut().start(CameraMicros(0));
        let figure = ns_per_event(length_us, begin, |batch| {
            let mut counter = counter.borrow_mut();
            for from in (0..batch.len()).step_by(size) {
                counter.count(batch.range(from..from + size));
            }
        });
        assert_eq!(counter.borrow().totals().0 + counter.borrow().totals().1, 100_000_000);
        let what = format!("count 100 M events at {rate}, {size} at a time");
        all_within &= within(&what, figure, MOST_NS_PER_EVENT, "ns/event");
    }
    // A million events a second, a busy scene, and ten of them.
    for (rate, length_us) in [("1 M/s", 1_000_000), ("10 M/s", 100_000)] {
        let meter = RefCell::new(SharpnessMeter::new(SMALL));
        let figure = ns_per_event_at(
            SMALL,
            length_us,
            || meter.borrow_mut().restart(),
            |batch| {
                for from in (0..batch.len()).step_by(512) {
                    black_box(meter.borrow_mut().take(batch.range(from..from + 512)));
                }
            },
        );
        let what = format!("watch for lost focus at {rate}, 346 x 260");
        all_within &= within(&what, figure, MOST_NS_PER_EVENT_WATCHED, "ns/event");
    }
    let micros = |spent: Duration| spent.as_secs_f64() * 1e6;
    let spent = searches([(10_000_000, 0), (100_000_000, 0), (10_000_000, 10_000_000)])?;
    let [ten, hundred, kept] = spent.map(micros);
    all_within &= within("EGS on 10 M events, counted only", ten, MOST_US_PER_SEARCH, "us");
    all_within &= within("EGS on 100 M events, counted only", hundred, MOST_US_PER_SEARCH, "us");
    all_within &= within("EGS on 10 M events, all kept", kept, MOST_US_PER_SEARCH, "us");
    all_within &= within("EGS on 100 M by EGS on 10 M", hundred / ten, MOST_TIMES_LONGER, "times");
    let (each, result) = structure()?;
    let what = "structure on 1 M events at 346 x 260, for each";
    all_within &= within(what, each, MOST_NS_PER_EVENT_READ, "ns/event");
    let what = "structure, for the result after the last event";
    all_within &= within(what, result, MOST_MS_FOR_A_RESULT, "ms");
    let auto = auto()?;
    let what = "auto on 2 M events at 346 x 260, for each";
    all_within &= within(what, auto.ns_per_event, MOST_NS_PER_EVENT_OF_AUTO, "ns/event");
    let what = "auto on 2 M events, for the result after the last event";
    all_within &= within(what, auto.ms_for_the_result, MOST_MS_FOR_A_RESULT, "ms");
    all_within &= within("auto, whether the sweep may end", auto.ms_to_decide, MOST_MS_TO_DECIDE, "ms");
    Ok(if all_within { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

//! Recorded sweeps against what independent reference implementations answered for them.
//!
//! `EVFOCUS_SWEEPS=FOLDER` goes over another folder of the same make instead of the sweeps that come with the repository.

use core::time::Duration;
use std::path::PathBuf;

use evfocus_core::search::{ApexFinder, Bookings};
use evfocus_core::{
    Analyzer, Answer, CameraMicros, Event, EventList, Failure, Flag, LegReport, LensPosition, LensRange,
    Method, Polarity, Question, Rules, SearchError, Searcher, SweepCapacity, SweepLimits, SweepQuality,
    SweepRecorder, answer,
};
use evfocus_tests::recorded_sweeps::{RecordedSweep, Reference, committed};

/// The method, its accumulation interval in milliseconds, the column of the table, and how far an answer may be from the table's,
/// lens counts.
const COLUMNS: [(Method, u64, &str, f64); 5] = [
    (Method::Egs, 55, "egs", TOLERANCE),
    (Method::EgsOfficial, 55, "egs_official", TOLERANCE),
    (Method::ErFixed, 55, "er_fixed_55ms", TOLERANCE),
    (Method::ErFixed, 65, "er_fixed_65ms", TOLERANCE),
    (Method::Structure, 55, "structure_one_pass_no_lag", STRUCTURE_TOLERANCE),
];

/// Searches on counts: the table's own rounding, and half as much again.
const TOLERANCE: f64 = 0.15;

/// A fifth of the width of a bin: which bins belong to the top of the peak is a matter of rounding.
const STRUCTURE_TOLERANCE: f64 = 2.0;

/// Sweeps whose peak is no parabola, so that one bin more or less at its top moves the vertex by ten counts, and one in which focus is
/// so near to the start that we go over the events twice, which the table's answer does not: the largest difference allowed.
const LOOSE: [(&str, f64); 3] =
    [("low_texture_light_static", 10.0), ("saturated_light_shake", 4.0), ("near_start_light_shake", 60.0)];

fn tolerance_of(method: Method, tolerance: f64, name: &str) -> f64 {
    let loose = LOOSE.iter().find(|(loose, _)| *loose == name && method == Method::Structure);
    loose.map_or(tolerance, |&(_, tolerance)| tolerance)
}

fn folder() -> PathBuf {
    std::env::var_os("EVFOCUS_SWEEPS").map_or_else(committed, PathBuf::from)
}

/// Errors of the methods of [`COLUMNS`] in one leg.
fn errors(sweep: &RecordedSweep, leg: &SweepRecorder) -> anyhow::Result<Vec<f64>> {
    let recorded = leg.sweep(&sweep.trace).ok_or_else(|| anyhow::anyhow!("no events"))?;
    let mut searcher = Searcher::new(sweep.geometry);
    let mut errors = Vec::new();
    for (method, milliseconds, ..) in COLUMNS {
        let answer = searcher.search(method, &recorded, Duration::from_millis(milliseconds))?;
        errors.push(answer.position.counts_from(sweep.truth));
    }
    Ok(errors)
}

#[test]
fn answers_agree_with_the_reference_table() -> anyhow::Result<()> {
    let folder = folder();
    let mut failures = Vec::new();
    for row in Reference::read_all(&folder)? {
        let sweep = RecordedSweep::read(&folder, &row.name)?;
        let legs = sweep.legs();
        let [leg] = legs.as_slice() else { anyhow::bail!("{}: {} legs, not one", row.name, legs.len()) };
        print!("{:28}", row.name);
        for ((method, _, column, tolerance), error) in COLUMNS.into_iter().zip(errors(&sweep, leg)?) {
            let expected = row.get(column)?;
            print!("  {column} {error:+.1} ({expected:+.1})");
            if (error - expected).abs() > tolerance_of(method, tolerance, &row.name) {
                failures.push(format!("{}: {column} {error:+.1}, reference {expected:+.1}", row.name));
            }
        }
        println!();
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    Ok(())
}

#[test]
fn sweeps_both_ways_are_split_at_the_turn() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        let legs = sweep.legs();
        let ways = if name.ends_with("both_directions") { 2 } else { 1 };
        assert_eq!(legs.len(), ways, "{name}");
        if ways == 2 {
            for leg in &legs {
                println!("{name}: {:?} events, errors {:.1?}", leg.store().len(), errors(&sweep, leg)?);
            }
            // What is left of the error one way is delay: the way back turns its sign.
            let [there, back] = [&legs[0], &legs[1]].map(|leg| structure(&sweep, leg));
            let (there, back) = (there??, back??);
            assert!(there > 0.0 && back < 0.0, "{name}: {there:+.1} {back:+.1}");
            assert!(f64::midpoint(there, back).abs() < 12.0, "{name}: {there:+.1} {back:+.1}");
        }
        if name == "light_static_both_directions" {
            let expected = [(197_154, -76.2), (178_972, 66.4)];
            for (leg, (events, error)) in legs.iter().zip(expected) {
                assert_eq!(leg.store().len(), events);
                assert!((errors(&sweep, leg)?[0] - error).abs() < TOLERANCE);
            }
        }
    }
    Ok(())
}

/// The error of `structure`, or why there is no answer; outside of it, why there is no sweep.
fn structure(sweep: &RecordedSweep, leg: &SweepRecorder) -> anyhow::Result<Result<f64, SearchError>> {
    let recorded = leg.sweep(&sweep.trace).ok_or_else(|| anyhow::anyhow!("no events"))?;
    let answer = Searcher::new(sweep.geometry).search(Method::Structure, &recorded, Duration::ZERO);
    Ok(answer.map(|answer| answer.position.counts_from(sweep.truth)))
}

/// What `auto` makes of it, by the daemon's rules.
fn judged(sweep: &RecordedSweep, leg: &SweepRecorder) -> anyhow::Result<Result<Answer, Failure>> {
    let (low, high) = sweep.trace.extent().unwrap_or_default();
    let question = Question {
        method: Method::Auto,
        interval: Duration::from_millis(55),
        limits: SweepLimits::default(),
        ask_all: false,
    };
    let mut report = LegReport::empty();
    let verdict = Analyzer::new(sweep.geometry).analyze(leg, &sweep.trace, question, &mut report);
    let rules = Rules::for_range(LensRange::new(low, high)?);
    Ok(verdict.and_then(|()| answer(&report, None, Method::Auto, &rules)))
}

/// `sweep` with other events.
fn with_events(sweep: &RecordedSweep, events: &[Event]) -> SweepRecorder {
    let capacity = SweepCapacity { events: events.len(), ..SweepCapacity::default() };
    let mut recorder = SweepRecorder::new(sweep.geometry, capacity);
    recorder.start(events.first().map_or_else(Default::default, |event| event.t));
    let mut list = EventList::with_capacity(events.len());
    assert_eq!(list.append(events.iter().copied()), 0, "a sweep takes no days");
    recorder.feed(list.as_slice());
    recorder
}

/// Numbers that are the same on every machine (xorshift64).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % limit
    }
}

#[test]
fn structure_says_that_pixels_in_disorder_are_no_picture() -> anyhow::Result<()> {
    let folder = folder();
    for row in Reference::read_all(&folder)? {
        let sweep = RecordedSweep::read(&folder, &row.name)?;
        let (width, mut random) = (usize::from(sweep.geometry.width), Random(7));
        let mut places: Vec<usize> = (0..sweep.geometry.pixels()).collect();
        for index in (1..places.len()).rev() {
            places.swap(index, random.below(index + 1));
        }
        let mut events = sweep.events.clone();
        for event in &mut events {
            let place = places[usize::from(event.y) * width + usize::from(event.x)];
            (event.x, event.y) = ((place % width) as u16, (place / width) as u16);
        }
        // What is left of the picture's energy without its structure is highest at focus too, if it has the right sign by chance.
        let answer = judged(&sweep, &with_events(&sweep, &events))?;
        println!("{:28} {answer:?}", row.name);
        let is_weak = answer.map_or_else(
            |failure| matches!(failure, Failure::Weak { .. } | Failure::Saturated),
            |answer| answer.flags.contains(Flag::Weak) && answer.confidence.is_some_and(|sure| sure < 0.9),
        );
        assert!(is_weak, "{}: {answer:?}", row.name);
    }
    Ok(())
}

#[test]
fn structure_does_not_mind_events_that_have_nothing_to_do_with_the_picture() -> anyhow::Result<()> {
    let sweep = RecordedSweep::read(&committed(), "light_static")?;
    let (mut random, last) = (Random(7), sweep.events.last().map_or(0, |event| event.t.0));
    let mut events = sweep.events.clone();
    for _ in 0..sweep.events.len() / 2 {
        events.push(Event {
            t: CameraMicros(random.below(last as usize) as i64),
            x: random.below(sweep.geometry.width.into()) as u16,
            y: random.below(sweep.geometry.height.into()) as u16,
            polarity: Polarity::from_on(random.below(2) == 1),
        });
    }
    events.sort_by_key(|event| event.t);
    let clean = structure(&sweep, &with_events(&sweep, &sweep.events))??;
    let noisy = structure(&sweep, &with_events(&sweep, &events))??;
    println!("clean {clean:+.1}, half as many events by chance {noisy:+.1}");
    assert!((noisy - clean).abs() < 15.0, "{clean:+.1} {noisy:+.1}");
    Ok(())
}

/// A star, a specimen: all that there is to see lies in a small part of the picture.
#[test]
fn one_small_object_is_enough() -> anyhow::Result<()> {
    let sweep = RecordedSweep::read(&committed(), "light_static")?;
    for (x, y) in [(120, 70), (180, 140)] {
        let within = |event: &&Event| (x..x + 50).contains(&event.x) && (y..y + 50).contains(&event.y);
        let events: Vec<Event> = sweep.events.iter().filter(within).copied().collect();
        let answer =
            judged(&sweep, &with_events(&sweep, &events))?.map_err(|failure| anyhow::anyhow!("{failure}"))?;
        let (error, bar) = (answer.position.counts_from(sweep.truth), answer.error_bar.unwrap_or(f64::NAN));
        println!("{} events around {x}, {y}: {error:+.1} ± {bar:.1}", events.len());
        assert!(error.abs() < 2.0 * bar && bar < 20.0, "{answer:?}");
    }
    Ok(())
}

/// Without the rule for turning points a pixel lags: its events after a turn come a threshold or two late.
#[test]
fn structure_without_its_rule_for_turning_points_lags() -> anyhow::Result<()> {
    let sweep = RecordedSweep::read(&committed(), "light_static")?;
    let (low, high) = sweep.trace.extent().unwrap_or_default();
    let bins_per_count = (Bookings::BINS - 1) as f64 / high.distance(low);
    let stride = usize::from(sweep.geometry.width) + 4;
    let mut state = vec![0_i64; stride * (usize::from(sweep.geometry.height) + 4)];
    let mut growth = [0_i64; Bookings::BINS];
    for event in &sweep.events {
        let position = sweep.trace.position_near(event.t.0 as f64).unwrap_or_default();
        let place = (usize::from(event.y) + 2) * stride + usize::from(event.x) + 2;
        let sign = if event.polarity.is_on() { 1 } else { -1 };
        let cross = |reach: usize| {
            let (along, across) = (reach, reach * stride);
            state[place - along] + state[place + along] + state[place - across] + state[place + across]
        };
        growth[(position.counts_from(low) * bins_per_count) as usize] += sign * (cross(1) - cross(2));
        state[place] += sign;
    }
    let mut energy = 0.0;
    let curve: Vec<f64> = growth
        .iter()
        .map(|&growth| {
            energy += growth as f64;
            energy
        })
        .collect();
    let apex = ApexFinder::new().find(&curve, 0.85).ok_or_else(|| anyhow::anyhow!("no curve"))?;
    let plain = low.0 + apex.at / bins_per_count - sweep.truth.0;
    let ours = structure(&sweep, &with_events(&sweep, &sweep.events))??;
    println!("plain {plain:+.1}, with the rule {ours:+.1}");
    assert!((10.0..40.0).contains(&(plain - ours)), "{plain:+.1} {ours:+.1}");
    Ok(())
}

#[test]
fn only_the_saturated_sweep_is_called_saturated_and_none_flat() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        for leg in sweep.legs() {
            let recorded = leg.sweep(&sweep.trace).ok_or_else(|| anyhow::anyhow!("no events"))?;
            let quality = SweepQuality::of(&recorded)?;
            println!("{name:32} {quality:.3?}");
            assert_eq!(quality.is_saturated(), name.starts_with("saturated"), "{name}");
            assert!(!quality.is_flat(), "{name}");
            assert_eq!(quality.has_flicker(), name.starts_with("flicker"), "{name}");
        }
    }
    Ok(())
}

#[test]
fn a_truth_lies_within_the_range_swept() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        let (low, high) = sweep.trace.extent().unwrap_or_default();
        let LensPosition(truth) = sweep.truth;
        assert!(low.0 < truth && truth < high.0, "{name}");
    }
    Ok(())
}

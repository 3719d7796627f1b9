//! From lens positions to sweeps: the ways that are long enough, without the rests at their ends.

use std::path::Path;

use anyhow::{Context, bail};
use evfocus_core::{CameraMicros, Leg, LensPosition, LensSpeed, LensTrace};
use evfocus_ipc::Direction;

use super::shown;

/// A motion back by less than this share of the positions' extent is overshoot or read-out noise.
const TURN_SHARE: f64 = 0.01;
/// A way shorter than this share of the longest one leads to the start of a sweep or to its answer, and is no sweep.
const SWEEP_SHARE: f64 = 0.6;
/// A rest before or after a sweep belongs to it, as in the paper's recordings, unless it is longer than this...
const SHORTEST_REST_US: i64 = 150_000;
/// ...and than this share of the way's time: then it would draw the search away from the motion.
const SHORTEST_REST_SHARE: f64 = 0.1;
/// Within this share of a way from its end the lens has not started yet, or has arrived.
const REST_SHARE: f64 = 0.002;
/// A trace that turns round more often is no sweep.
const MOST_LEGS: usize = 64;
/// A sweep takes seconds; ten minutes of counts are 50 MB.
const LONGEST_SWEEP_US: i64 = 600_000_000;
/// 100 days, rests included.
const LONGEST_TRACE_US: i64 = 100 * 86_400_000_000;

/// One way of the lens.
#[derive(Debug)]
pub(super) struct SweepLeg {
    pub(super) direction: Direction,
    /// Positions from the start of the motion to its end, ends included.
    pub(super) trace: LensTrace<CameraMicros>,
    /// Events from here on belong to the sweep,
    pub(super) start: CameraMicros,
    /// and from here on do not.
    pub(super) end: CameraMicros,
    /// Begin of the rest before the sweep, if one was cut off.
    pub(super) rest_since: Option<CameraMicros>,
    /// Whether a rest after the sweep was cut off.
    rests_after: bool,
    /// Speed in the middle half of the way.
    pub(super) speed: LensSpeed,
}

/// The sweeps of a trace, and what was left out.
#[derive(Debug)]
pub(super) struct SweepLegs {
    pub(super) sweeps: Vec<SweepLeg>,
    pub(super) warnings: Vec<String>,
}

/// Cuts `trace` into sweeps.
pub(super) fn sweep_legs(trace: &LensTrace<CameraMicros>, path: &Path) -> anyhow::Result<SweepLegs> {
    let Some((low, high)) = trace.extent() else { bail!("{}: no positions", shown(path)) };
    check_span(trace, path)?;
    let legs = trace.legs(TURN_SHARE * high.distance(low));
    if legs.is_empty() {
        bail!(
            "{}: the lens never moves: all {} positions are {low}; a sweep needs the positions of a lens in motion",
            shown(path),
            trace.len()
        );
    }
    if legs.len() > MOST_LEGS {
        bail!(
            "{}: the positions turn round {} times between {low} and {high}: this is no sweep but a lens at rest or \
             noise; log the positions of a lens in motion",
            shown(path),
            legs.len() - 1
        );
    }
    let longest = legs.iter().map(|leg| leg.to.distance(leg.from)).fold(0.0, f64::max);
    let mut warnings = Vec::new();
    let mut sweeps = Vec::new();
    for leg in &legs {
        if leg.to.distance(leg.from) >= SWEEP_SHARE * longest {
            sweeps.push(SweepLeg::new(trace, leg).with_context(|| {
                format!(
                    "{}: the lens jumps from {} to {}; a sweep needs positions in between",
                    shown(path),
                    leg.from,
                    leg.to
                )
            })?);
        } else {
            warnings.push(format!(
                "the lens's way from {} to {} is too short for a sweep and was left out",
                leg.from, leg.to
            ));
        }
    }
    Ok(SweepLegs { sweeps, warnings })
}

/// Refuses times that lie further apart than any logger runs: those are no microseconds, or no times.
fn check_span(trace: &LensTrace<CameraMicros>, path: &Path) -> anyhow::Result<()> {
    if let Some(((first, _), (last, _))) = trace.first().zip(trace.last())
        && last.micros_since(first) > LONGEST_TRACE_US
    {
        bail!(
            "{}: the times go from {} to {} us, which is more than {} days; write t_us in microseconds of the camera's clock",
            shown(path),
            first.0,
            last.0,
            LONGEST_TRACE_US / 86_400_000_000
        );
    }
    Ok(())
}

impl SweepLegs {
    /// Refuses a sweep that takes longer than any: the counter's memory grows with its time.
    pub(super) fn check_lengths(&self, positions: &Path) -> anyhow::Result<()> {
        for sweep in &self.sweeps {
            let micros = sweep.end.micros_since(sweep.start);
            if micros > LONGEST_SWEEP_US {
                bail!(
                    "{}: the sweep from {} to {} us takes {:.0} s; at most {} s can be analyzed. Is t_us in microseconds? \
                     Else cut the positions and the recording to the time in which the lens moves",
                    shown(positions),
                    sweep.start.0,
                    sweep.end.0,
                    micros as f64 * 1e-6,
                    LONGEST_SWEEP_US / 1_000_000
                );
            }
        }
        Ok(())
    }

    /// Lets the sweeps at the ends take the events for which there are no positions any more: a few milliseconds at most.
    pub(super) fn stretch_to(&mut self, (first, last): (CameraMicros, CameraMicros)) {
        if let Some(sweep) = self.sweeps.first_mut().filter(|sweep| sweep.rest_since.is_none()) {
            sweep.start = sweep.start.min(first);
        }
        if let Some(sweep) = self.sweeps.last_mut().filter(|sweep| !sweep.rests_after) {
            sweep.end = sweep.end.max(CameraMicros(last.0.saturating_add(1)));
        }
    }
}

impl SweepLeg {
    fn new(trace: &LensTrace<CameraMicros>, leg: &Leg<CameraMicros>) -> Option<Self> {
        let tolerance = REST_SHARE * leg.to.distance(leg.from);
        let within = || trace.samples().filter(|&(time, _)| time >= leg.start && time <= leg.end);
        let departed = within()
            .take_while(|(_, position)| position.distance(leg.from) <= tolerance)
            .last()
            .map_or(leg.start, |(time, _)| time);
        let arrived = within()
            .find(|(_, position)| position.distance(leg.to) <= tolerance)
            .map_or(leg.end, |(time, _)| time);
        let shortest = (leg.end.micros_since(leg.start) as f64 * SHORTEST_REST_SHARE) as i64;
        let is_rest = |micros: i64| micros >= shortest.max(SHORTEST_REST_US);
        let rests_before = is_rest(departed.micros_since(leg.start));
        let rests_after = is_rest(leg.end.micros_since(arrived));
        let start = if rests_before { departed } else { leg.start };
        let end = if rests_after { arrived } else { leg.end };
        let trace = cut(trace, start, end);
        let direction = if leg.to > leg.from { Direction::Forward } else { Direction::Backward };
        let speed = middle_speed(&trace, leg)?;
        let rest_since = rests_before.then_some(leg.start);
        Some(Self { direction, trace, start, end, rest_since, rests_after, speed })
    }

    /// How far the lens goes on after `time`, as a share of its way.
    pub(super) fn share_after(&self, time: CameraMicros) -> f64 {
        let ends = (self.trace.first(), self.trace.last(), self.trace.position_near(time.0 as f64));
        match ends {
            (Some((_, from)), Some((_, to)), Some(position)) if to != from => {
                to.distance(position) / to.distance(from)
            }
            _ => 0.0,
        }
    }
}

/// The samples from `start` to `end`, with interpolated ones at the ends.
fn cut(trace: &LensTrace<CameraMicros>, start: CameraMicros, end: CameraMicros) -> LensTrace<CameraMicros> {
    let inside = || trace.samples().filter(|&(time, _)| time > start && time < end);
    let mut part = LensTrace::with_capacity(inside().count() + 2);
    let at = |time: CameraMicros| trace.position_near(time.0 as f64).map(|position| (time, position));
    for (time, position) in at(start).into_iter().chain(inside()).chain(at(end)) {
        part.push_if_later(time, position);
    }
    part
}

/// The speed in the middle half of the way, where the lens neither starts nor stops; nothing if it jumps there.
fn middle_speed(trace: &LensTrace<CameraMicros>, leg: &Leg<CameraMicros>) -> Option<LensSpeed> {
    let way = leg.to.counts_from(leg.from);
    let passed = |share: f64| trace.crossings(LensPosition(leg.from.0 + share * way)).next();
    LensSpeed::new(0.5 * way.abs() / (passed(0.75)? - passed(0.25)?) * 1e6).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rest of 0.3 s, 2 s to 3750, a rest, 2 s back, a short way up again; one sample a millisecond.
    fn there_and_back() -> LensTrace<CameraMicros> {
        let mut trace = LensTrace::with_capacity(10_000);
        let mut time = 0;
        let mut go = |from: f64, to: f64, millis: i64| {
            for step in 0..millis {
                let share = step as f64 / millis as f64;
                trace.push_if_later(CameraMicros(time), LensPosition(from + share * (to - from)));
                time += 1000;
            }
        };
        go(220.0, 220.0, 300);
        go(220.0, 3750.0, 2000);
        go(3750.0, 3750.0, 100);
        go(3750.0, 220.0, 2000);
        go(220.0, 1985.0, 1000);
        trace
    }

    #[test]
    fn a_way_there_and_back_is_two_sweeps_without_the_long_rest() {
        let legs = sweep_legs(&there_and_back(), Path::new("p.csv")).unwrap();
        let [forward, backward] = legs.sweeps.as_slice() else { panic!("{legs:?}") };
        assert_eq!(forward.direction, Direction::Forward);
        assert_eq!(backward.direction, Direction::Backward);
        assert!((forward.start.0 - 300_000).abs() < 6_000, "{}", forward.start);
        assert!((forward.end.0 - 2_350_000).abs() < 6_000, "{}", forward.end);
        assert_eq!(backward.start, forward.end);
        assert!((forward.speed.counts_per_second() - 1765.0).abs() < 2.0);
        assert_eq!(forward.rest_since, Some(CameraMicros(0)));
        assert_eq!(legs.warnings.len(), 1);
    }

    #[test]
    fn a_lens_at_rest_is_no_sweep() {
        let mut trace = LensTrace::with_capacity(100);
        for index in 0..100 {
            trace.push(CameraMicros(index * 1000), LensPosition(500.0)).unwrap();
        }
        let error = sweep_legs(&trace, Path::new("p.csv")).unwrap_err().to_string();
        assert!(
            error.contains("p.csv") && error.contains("never moves") && error.contains("500.0"),
            "{error}"
        );
    }
}

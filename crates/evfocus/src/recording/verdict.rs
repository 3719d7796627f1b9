//! One answer from the sweeps of a recording, by the rules of the controller.

use evfocus_core::{
    ControllerConfig, Failure, LensPosition, LensRange, Method, SweepLimits, combine, is_at_edge,
};
use evfocus_ipc::Direction;

use super::SweepAnalysis;

/// Where the picture is sharp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Answer {
    pub(crate) position: LensPosition,
    /// Camera time at which the first sweep passed it.
    pub(crate) t_us: f64,
}

/// The answer of all sweeps together.
#[derive(Debug)]
pub(crate) struct Verdict {
    pub(crate) outcome: Result<Answer, Failure>,
    /// Half the difference of the two directions' answers as a time: lag plus backlash.
    pub(crate) delay_us: Option<f64>,
}

impl Verdict {
    /// The mean of the two directions; with one direction, what that one says.
    pub(super) fn of(sweeps: &[SweepAnalysis], method: Method) -> Self {
        let mut delay_us = None;
        let outcome = answer(sweeps, method, &mut delay_us);
        Self { outcome, delay_us }
    }
}

fn answer(sweeps: &[SweepAnalysis], method: Method, delay_us: &mut Option<f64>) -> Result<Answer, Failure> {
    let nothing = Failure::TooFewEvents { events: 0, needed: SweepLimits::default().fewest_events };
    let first = sweeps.first().ok_or(nothing)?;
    for sweep in sweeps {
        sweep.verdict?;
    }
    let range = extent(sweeps).ok_or(nothing)?;
    let rules = ControllerConfig::for_lens(range, first.speed);
    let position = match (mean(sweeps, method, Direction::Forward), mean(sweeps, method, Direction::Backward))
    {
        (Some(forward), Some(backward)) => {
            let combined = combine(forward, backward, range, rules.largest_mismatch_share)?;
            *delay_us = Some(combined.half_difference / first.speed.counts_per_second() * 1e6);
            combined.position
        }
        (Some(only), None) | (None, Some(only)) => only,
        (None, None) => return Err(nothing),
    };
    if is_at_edge(position, range, rules.edge_share) {
        return Err(Failure::PeakAtEdge { position });
    }
    Ok(Answer { position, t_us: first.passed(position, method) })
}

/// The mean of what the sweeps in one direction say.
fn mean(sweeps: &[SweepAnalysis], method: Method, direction: Direction) -> Option<LensPosition> {
    let said: Vec<f64> = sweeps
        .iter()
        .filter(|sweep| sweep.direction == direction)
        .filter_map(|sweep| Some(sweep.report.estimate(method)?.ok()?.position.0))
        .collect();
    (!said.is_empty()).then(|| LensPosition(said.iter().sum::<f64>() / said.len() as f64))
}

/// The positions swept.
fn extent(sweeps: &[SweepAnalysis]) -> Option<LensRange> {
    let ends = || sweeps.iter().flat_map(|sweep| [sweep.report.from.0, sweep.report.to.0]);
    let low = ends().fold(f64::INFINITY, f64::min);
    let high = ends().fold(f64::NEG_INFINITY, f64::max);
    LensRange::new(LensPosition(low), LensPosition(high)).ok()
}

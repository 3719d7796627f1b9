//! What `analyze --json` prints.

use evfocus_core::{Answer, Estimate, Failure, Flags, LegReport, Method, SearchError, SweepQuality};
use evfocus_ipc::{Curve, Direction, FocusMap, State, Structure, WindowAnswer};
use evfocusd::{parts_report, sweep_report};
use serde::Serialize;

use crate::recording::{RecordingAnalysis, Request, SweepAnalysis};

/// Positions, widths and error bars in lens counts, times in microseconds of the camera's clock, rates in events per second.
#[derive(Debug, Serialize)]
pub(super) struct Analysis {
    recording: String,
    positions: String,
    format: &'static str,
    method: &'static str,
    interval_us: f64,
    state: State,
    reason: Option<&'static str>,
    message: String,
    position: Option<f64>,
    /// One standard deviation.
    error_bar: Option<f64>,
    /// The probability that the position is right to within 1 % of the range.
    confidence: Option<f64>,
    flags: Vec<&'static str>,
    /// The estimator whose answer this is.
    decided_by: Option<&'static str>,
    second_depth: Option<f64>,
    /// The number of the window that decided, from 0.
    window: Option<u8>,
    /// What each window says, in their order.
    windows: Vec<WindowAnswer>,
    /// Where each part of the picture is sharp.
    map: Option<FocusMap>,
    /// When the first sweep passed the position.
    t_us: Option<f64>,
    /// Half the difference of the two directions as a time: lag plus backlash.
    delay_us: Option<f64>,
    events: u64,
    iterations: u64,
    /// What each estimator said of the first sweep.
    estimators: Vec<Estimator>,
    /// Of the first sweep.
    curve: Curve,
    sweeps: Vec<Sweep>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Sweep {
    direction: Direction,
    from: f64,
    to: f64,
    start_us: i64,
    end_us: i64,
    speed_counts_per_s: f64,
    state: State,
    reason: Option<&'static str>,
    message: Option<String>,
    position: Option<f64>,
    t_us: Option<f64>,
    events: u64,
    on: u64,
    off: u64,
    lost: u64,
    not_kept: u64,
    hot_pixels: usize,
    iterations: u64,
    estimators: Vec<Estimator>,
    /// What the fine structure says; positions with the delay of the pixels still in them.
    structure: Option<Structure>,
    quality: Quality,
    curve: Curve,
}

#[derive(Debug, Serialize)]
struct Estimator {
    method: &'static str,
    state: State,
    reason: Option<&'static str>,
    message: Option<String>,
    position: Option<f64>,
    t_us: Option<f64>,
    iterations: u64,
    interval_us: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Quality {
    peak_rate: f64,
    share_at_ceiling: f64,
    ceiling_dispersion: f64,
    regularity: f64,
    dispersion: f64,
    flicker_hz: u32,
    flicker_depth: f64,
    saturated: bool,
    flat: bool,
    flicker: bool,
}

impl Analysis {
    pub(super) fn of(analysis: &RecordingAnalysis, request: &Request) -> Self {
        let outcome = &analysis.verdict.outcome;
        let found: Option<&Answer> = outcome.as_ref().ok();
        let sweeps: Vec<Sweep> =
            analysis.sweeps.iter().map(|sweep| Sweep::of(sweep, analysis.method)).collect();
        Self {
            recording: request.recording.display().to_string(),
            positions: request.positions.display().to_string(),
            format: analysis.format.name(),
            method: analysis.method.name(),
            interval_us: request.interval.as_secs_f64() * 1e6,
            state: state(outcome.is_ok()),
            reason: outcome.as_ref().err().map(Failure::name),
            message: match outcome {
                Ok(answer) => format!("focus is at {} counts", answer.position),
                Err(failure) => failure.to_string(),
            },
            position: found.map(|answer| answer.position.0),
            error_bar: found.and_then(|answer| answer.error_bar),
            confidence: found.and_then(|answer| answer.confidence),
            flags: names(analysis.flags()),
            decided_by: found.map(|answer| answer.decided_by.name()),
            second_depth: found.and_then(|answer| Some(answer.second_depth?.0)),
            window: found.and_then(|answer| answer.window),
            windows: analysis.verdict.windows.iter().copied().map(parts_report::window).collect(),
            map: analysis.verdict.map.as_ref().map(parts_report::map),
            t_us: analysis.verdict.t_us,
            delay_us: analysis.verdict.delay_us,
            events: sweeps.iter().map(|sweep| sweep.events).sum(),
            iterations: sweeps.iter().map(|sweep| sweep.iterations).sum(),
            estimators: analysis.sweeps.first().map(|sweep| estimators(&sweep.report)).unwrap_or_default(),
            curve: sweeps.first().map(|sweep| sweep.curve.clone()).unwrap_or_default(),
            sweeps,
            warnings: analysis.warnings.clone(),
        }
    }
}

impl Sweep {
    fn of(sweep: &SweepAnalysis, method: Method) -> Self {
        let report = &sweep.report;
        let said = report.estimate(method).and_then(Result::ok);
        let answer = said.filter(|_| sweep.verdict.is_ok());
        Self {
            direction: sweep.direction,
            from: report.from.0,
            to: report.to.0,
            start_us: report.start.0,
            end_us: report.end.0,
            speed_counts_per_s: sweep.speed.counts_per_second(),
            state: state(sweep.verdict.is_ok()),
            reason: sweep.verdict.as_ref().err().map(Failure::name),
            message: sweep.verdict.as_ref().err().map(ToString::to_string),
            position: answer.map(|estimate| estimate.position.0),
            t_us: answer.map(|estimate| estimate.t_us),
            events: report.on + report.off,
            on: report.on,
            off: report.off,
            lost: report.lost,
            not_kept: report.not_kept,
            hot_pixels: sweep.hot_pixels,
            iterations: said.map_or(0, |estimate| estimate.iterations.into()),
            estimators: estimators(report),
            structure: sweep_report::structure(report),
            quality: Quality::of(&report.quality, report.peak_rate.0),
            curve: curve(report),
        }
    }
}

impl Quality {
    fn of(quality: &SweepQuality, peak_rate: f64) -> Self {
        Self {
            peak_rate,
            share_at_ceiling: quality.share_at_ceiling,
            ceiling_dispersion: quality.ceiling_dispersion,
            regularity: quality.regularity,
            dispersion: quality.dispersion,
            flicker_hz: quality.flicker_hz,
            flicker_depth: quality.flicker_depth,
            saturated: quality.is_saturated(),
            flat: quality.is_flat(),
            flicker: quality.has_flicker(),
        }
    }
}

fn names(flags: Flags) -> Vec<&'static str> {
    flags.iter().map(evfocus_core::Flag::name).collect()
}

fn estimators(report: &LegReport) -> Vec<Estimator> {
    let asked = Method::ALL.into_iter().filter_map(|method| Some((method, report.estimate(method)?)));
    asked.map(|(method, said)| estimator(method, said)).collect()
}

fn estimator(method: Method, said: Result<Estimate, SearchError>) -> Estimator {
    let (estimate, error) = (said.ok(), said.err());
    Estimator {
        method: method.name(),
        state: state(estimate.is_some()),
        reason: error.map(|error| Failure::of_search(error).name()),
        message: error.map(|error| error.to_string()),
        position: estimate.map(|estimate| estimate.position.0),
        t_us: estimate.map(|estimate| estimate.t_us),
        iterations: estimate.map_or(0, |estimate| estimate.iterations.into()),
        interval_us: estimate.map(|estimate| estimate.interval_us),
    }
}

fn curve(report: &LegReport) -> Curve {
    let points = report.curve.points();
    Curve {
        position: points.iter().map(|point| point.position.0).collect(),
        rate: points.iter().map(|point| point.rate.0).collect(),
        t_us: points.iter().map(|point| point.t_us.round() as i64).collect(),
    }
}

fn state(focused: bool) -> State {
    if focused { State::Focused } else { State::Failed }
}

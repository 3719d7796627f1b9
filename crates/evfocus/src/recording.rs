//! A sweep on disk: the events of a recording with the positions of the lens, through the daemon's own analysis.
//!
//! Not its job: reading formats (`evfocus_record`), judging sweeps (`evfocus_core::Analyzer`).

mod coverage;
mod legs;
mod read;
mod verdict;

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use evfocus_core::controller::check_windows;
use evfocus_core::{
    CameraMicros, Failure, Flags, Geometry, LegReport, LensPosition, LensSpeed, LensTrace, Method, Prefer,
    Windows,
};
use evfocus_ipc::{Direction, FocusWindow};
use evfocus_record::{Format, Summary, positions};
use evfocusd::windows;

use crate::exit::UsageError;
use crate::files::must_not_be_folder;
pub(crate) use verdict::Verdict;

/// What to analyze, and how.
#[derive(Debug, Clone)]
pub(crate) struct Request {
    pub(crate) recording: PathBuf,
    pub(crate) positions: PathBuf,
    pub(crate) format: Option<Format>,
    pub(crate) method: Method,
    pub(crate) interval: Duration,
    pub(crate) windows: Vec<FocusWindow>,
    pub(crate) prefer: Prefer,
}

/// What one way of the lens says.
#[derive(Debug)]
pub(crate) struct SweepAnalysis {
    /// Forward is towards higher positions.
    pub(crate) direction: Direction,
    /// How fast the lens went through the middle of its way.
    pub(crate) speed: LensSpeed,
    /// Where the lens was.
    pub(crate) trace: LensTrace<CameraMicros>,
    pub(crate) report: LegReport,
    pub(crate) hot_pixels: usize,
    pub(crate) verdict: Result<(), Failure>,
}

impl SweepAnalysis {
    /// Camera time at which the lens passed `position`: that of the estimate if it is the sweep's own.
    fn passed(&self, position: LensPosition, method: Method) -> f64 {
        let own = self.report.estimate(method).and_then(Result::ok);
        own.filter(|own| own.position == position)
            .map(|own| own.t_us)
            .or_else(|| self.trace.crossings(position).next())
            .unwrap_or(self.report.start.0 as f64)
    }
}

/// What a recording says.
#[derive(Debug)]
pub(crate) struct RecordingAnalysis {
    pub(crate) format: Format,
    pub(crate) method: Method,
    pub(crate) sweeps: Vec<SweepAnalysis>,
    pub(crate) verdict: Verdict,
    pub(crate) warnings: Vec<String>,
}

impl RecordingAnalysis {
    /// What is odd about the answer.
    pub(crate) fn flags(&self) -> Flags {
        self.verdict.outcome.as_ref().map(|answer| answer.flags).unwrap_or_default()
    }
}

/// Analyzes a recording: one pass to learn its size, one to count its events.
pub(crate) fn analyze(request: &Request) -> anyhow::Result<RecordingAnalysis> {
    must_not_be_folder(&request.recording, "recording")?;
    must_not_be_folder(&request.positions, "positions")?;
    let summary = Summary::of_file(&request.recording, request.format)?;
    let trace = positions::read(&request.positions)?;
    let mut legs = legs::sweep_legs(&trace, &request.positions)?;
    let mut warnings = std::mem::take(&mut legs.warnings);
    let sweeps = if let Some(recorded) = coverage::span(&summary) {
        coverage::check_positions(&trace, recorded, &request.positions, &request.recording)?;
        let geometry = summary
            .geometry
            .with_context(|| format!("{}: the size of the sensor is unknown", request.recording.display()))?;
        warnings.extend(coverage::check_recording(&legs.sweeps, &summary, recorded, &request.recording)?);
        legs.stretch_to(recorded);
        legs.check_lengths(&request.positions)?;
        let windows = windows_on(geometry, request)?;
        read::analyze_sweeps(request, geometry, &windows, summary.events, &legs.sweeps)?
    } else {
        Vec::new()
    };
    let verdict = Verdict::of(&sweeps, request.method, request.prefer);
    Ok(RecordingAnalysis { format: summary.format, method: request.method, sweeps, verdict, warnings })
}

/// The windows asked for, in pixels of the recording's sensor.
fn windows_on(geometry: Geometry, request: &Request) -> Result<Windows, UsageError> {
    let windows =
        windows::in_pixels(&request.windows, geometry).map_err(|error| UsageError(in_options(&error)))?;
    check_windows(&windows, request.prefer, request.method, geometry)
        .map_err(|refusal| UsageError(format!("--window, --prefer: {refusal}")))?;
    Ok(windows)
}

/// The daemon's words for what is wrong, with the name of the option.
fn in_options(error: &evfocus_ipc::Error) -> String {
    let evfocus_ipc::Error::InvalidArgument { value, remedy, .. } = error else { return error.to_string() };
    format!("--window is {value}: {remedy}")
}

/// The name of a file for messages.
fn shown(path: &Path) -> std::path::Display<'_> {
    path.display()
}

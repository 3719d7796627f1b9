//! What `demo` says at the end.

use std::io::Write;

use evfocus_core::{Flag, LensPosition, Method, Outcome, Phase, RunReport};
use hil_sim::RigConfig;
use serde::Serialize;
use serde_json::{Map, Value};

use crate::output::Output;
use crate::quantity::{answer, count, half_difference};

/// Positions in lens counts, times in seconds of the rig's virtual time.
#[derive(Debug, Serialize)]
pub(super) struct DemoOutcome {
    state: &'static str,
    reason: Option<&'static str>,
    message: String,
    position: Option<f64>,
    /// Where the scene is sharp; of two depths, the one nearer to the answer.
    truth: f64,
    error: Option<f64>,
    /// One standard deviation, as far as the run knows.
    error_bar: Option<f64>,
    /// The probability that the position is right to within 1 % of the range, as far as the run knows.
    confidence: Option<f64>,
    /// What the run found odd.
    flags: Vec<&'static str>,
    /// Where a good part of the picture is sharp beside the position.
    second_depth: Option<f64>,
    /// Where the lens came to rest.
    lens_position: f64,
    method: &'static str,
    decided_by: Option<&'static str>,
    delay_us: Option<f64>,
    /// Of the sweeps, in counts per second.
    #[serde(skip)]
    speed: f64,
    elapsed_s: f64,
    events: u64,
    seed: u64,
    scene: &'static str,
    camera: String,
    estimators: Vec<Said>,
    timings: Map<String, Value>,
}

#[derive(Debug, Serialize)]
struct Said {
    method: &'static str,
    /// 1 for the first sweep, 2 for the way back.
    sweep: usize,
    position: f64,
    error: f64,
    iterations: u32,
}

impl DemoOutcome {
    pub(super) fn of(report: &RunReport, truth: &[LensPosition], rig: &RigConfig) -> Self {
        let position = match report.outcome {
            Outcome::Focused { position } => Some(position),
            Outcome::Failed(_) | Outcome::Aborted => None,
        };
        let truth = nearest(truth, position.unwrap_or(rig.focus)).unwrap_or(rig.focus);
        let (state, reason, message) = match &report.outcome {
            Outcome::Focused { position } => ("focused", None, format!("focus is at {position} counts")),
            Outcome::Failed(failure) => ("failed", Some(failure.name()), failure.to_string()),
            Outcome::Aborted => ("idle", Some("aborted"), String::from("the run was aborted")),
        };
        Self {
            state,
            reason,
            message,
            position: position.map(|position| position.0),
            truth: truth.0,
            error: position.map(|position| position.counts_from(truth)),
            error_bar: report.answer.and_then(|answer| answer.error_bar),
            confidence: report.answer.and_then(|answer| answer.confidence),
            flags: report.answer.iter().flat_map(|answer| answer.flags.iter()).map(Flag::name).collect(),
            second_depth: report.answer.and_then(|answer| answer.second_depth).map(|second| second.0),
            lens_position: report.position_after.0,
            method: report.plan.method.name(),
            decided_by: report.answer.map(|answer| answer.decided_by.name()),
            delay_us: report.delay_us,
            speed: report.plan.speed.counts_per_second(),
            elapsed_s: report.elapsed().as_secs_f64(),
            events: report.sweeps().map(|sweep| sweep.on + sweep.off).sum(),
            seed: rig.seed,
            scene: rig.scene.name(),
            camera: rig.sensor.model.clone(),
            estimators: said(report, truth),
            timings: timings(report),
        }
    }

    pub(super) fn is_focused(&self) -> bool {
        self.position.is_some()
    }

    pub(super) fn print(&self, out: &mut Output) -> anyhow::Result<()> {
        if let (Some(position), Some(error)) = (self.position, self.error) {
            let found = answer(position, self.error_bar, self.confidence);
            writeln!(out, "focused at {found} ({})", self.decided_by.unwrap_or(self.method))?;
            writeln!(out, "truth      {:.1} counts, error {error:+.1}", self.truth)?;
        } else {
            writeln!(out, "failed: {}: {}", self.reason.unwrap_or("unknown"), self.message)?;
            writeln!(out, "truth      {:.1} counts", self.truth)?;
        }
        if let Some(second) = self.second_depth {
            writeln!(out, "second     {second:.1} counts")?;
        }
        if !self.flags.is_empty() {
            writeln!(out, "odd        {}", self.flags.join(", ").replace('-', " "))?;
        }
        writeln!(out, "lens       {:.1} counts", self.lens_position)?;
        if let Some(delay_us) = self.delay_us {
            writeln!(out, "{}", half_difference(delay_us, Some(self.speed)))?;
        }
        for said in &self.estimators {
            let way = if said.sweep == 1 { "there" } else { "back" };
            writeln!(
                out,
                "  {:<12} {way:<5} {:>8.1} counts, error {:+.1}, {} steps",
                said.method, said.position, said.error, said.iterations
            )?;
        }
        let timings: Vec<String> = self
            .timings
            .iter()
            .filter_map(|(phase, seconds)| Some(format!("{phase} {:.2} s", seconds.as_f64()?)))
            .collect();
        writeln!(out, "time       {:.2} s: {}", self.elapsed_s, timings.join(", "))?;
        writeln!(out, "events     {} from {} before {}", count(self.events), self.camera, self.scene)?;
        writeln!(out, "seed       {}", self.seed)?;
        Ok(())
    }
}

fn nearest(truth: &[LensPosition], position: LensPosition) -> Option<LensPosition> {
    truth.iter().copied().min_by(|a, b| a.distance(position).total_cmp(&b.distance(position)))
}

fn said(report: &RunReport, truth: LensPosition) -> Vec<Said> {
    let mut said = Vec::new();
    for (index, sweep) in report.sweeps().enumerate() {
        for method in Method::ALL {
            if let Some(Ok(estimate)) = sweep.estimate(method) {
                said.push(Said {
                    method: method.name(),
                    sweep: index + 1,
                    position: estimate.position.0,
                    error: estimate.position.counts_from(truth),
                    iterations: estimate.iterations,
                });
            }
        }
    }
    said
}

/// Seconds spent in each phase that the run was in.
fn timings(report: &RunReport) -> Map<String, Value> {
    Phase::ALL
        .iter()
        .zip(&report.phases)
        .filter(|(_, spent)| !spent.is_zero())
        .map(|(phase, spent)| (phase.name().to_owned(), spent.as_secs_f64().into()))
        .collect()
}

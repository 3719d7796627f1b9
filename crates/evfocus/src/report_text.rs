//! A run's report in words.

use std::io::Write;

use evfocus_ipc::{Report, State};

use crate::output::Output;
use crate::quantity::{count, half_difference, rate};

/// The outcome in one line, and what was odd.
pub(crate) fn print_outcome(report: &Report, out: &mut Output) -> anyhow::Result<()> {
    let result = &report.result;
    match (result.state, result.position) {
        (State::Focused, Some(position)) => {
            let method = result.method.as_deref().unwrap_or("no method");
            writeln!(out, "focused at {position:.1} counts ({method}) in {:.1} s", report.elapsed_s)?;
        }
        (State::Idle, _) => writeln!(out, "{}", result.message)?,
        _ => writeln!(out, "failed: {}: {}", result.reason.as_deref().unwrap_or("unknown"), result.message)?,
    }
    for warning in &report.warnings {
        writeln!(out, "note: {warning}")?;
    }
    Ok(())
}

/// Everything that the report says.
pub(crate) fn print(report: &Report, out: &mut Output) -> anyhow::Result<()> {
    writeln!(
        out,
        "run {} with camera {}, lens {}",
        report.run_id, report.devices.camera, report.devices.lens
    )?;
    print_outcome(report, out)?;
    if let Some(position) = report.result.lens_position {
        writeln!(out, "the lens stands at {position:.1} counts")?;
    }
    if let Some(delay_us) = report.delay_us {
        writeln!(out, "{}", half_difference(delay_us, report.request.speed_counts_per_s))?;
    }
    let events = &report.events;
    writeln!(
        out,
        "{} events ({} ON, {} OFF), {} lost, {} not kept; peak {}",
        count(events.counted),
        count(events.on),
        count(events.off),
        count(events.lost),
        count(events.dropped_from_buffer),
        rate(report.sweeps.iter().flat_map(|sweep| &sweep.curve.rate).copied().fold(0.0, f64::max))
    )?;
    for sweep in &report.sweeps {
        writeln!(out, "sweep from {:.1} to {:.1} counts", sweep.from, sweep.to)?;
        for said in &sweep.estimators {
            let answer = match (said.position, &said.reason) {
                (Some(position), _) => format!("{position:>8.1} counts in {} steps", said.iterations),
                (None, Some(reason)) => format!("no answer: {reason}"),
                (None, None) => String::from("no answer"),
            };
            writeln!(out, "  {:<12} {answer}", said.method)?;
        }
    }
    if let Some(map) = report.clock_map {
        writeln!(out, "clocks: drift {:.1} ppm, residual {:.0} us", map.drift_ppm, map.residual_us)?;
    }
    let timings: Vec<String> =
        report.timings.iter().map(|timing| format!("{} {:.2} s", timing.phase, timing.seconds)).collect();
    writeln!(out, "time: {}", timings.join(", "))?;
    Ok(())
}

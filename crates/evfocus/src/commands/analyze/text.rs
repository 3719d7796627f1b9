//! What `analyze` prints for people.

use std::io::Write;

use evfocus_core::Method;
use evfocusd::parts_report;

use crate::output::Output;
use crate::quantity::{answer, count, half_difference, rate, seconds};
use crate::recording::{RecordingAnalysis, SweepAnalysis};
use crate::report_text::print_windows;

pub(super) fn print(analysis: &RecordingAnalysis, out: &mut Output) -> anyhow::Result<()> {
    match &analysis.verdict.outcome {
        Ok(found) => {
            let said = answer(found.position.0, found.error_bar, found.confidence);
            writeln!(out, "focused at {said} ({})", found.decided_by)?;
            for flag in found.flags.iter() {
                writeln!(out, "note: {}", flag.name().replace('-', " "))?;
            }
            if let Some(number) = found.window {
                writeln!(out, "window {number} decided")?;
            }
            if let Some(second) = found.second_depth {
                writeln!(out, "second depth at {second} counts")?;
            }
        }
        Err(failure) => writeln!(out, "failed: {}: {failure}", failure.name())?,
    }
    if let Some(delay_us) = analysis.verdict.delay_us {
        let speed = analysis.sweeps.first().map(|sweep| sweep.speed.counts_per_second());
        writeln!(out, "{}", half_difference(delay_us, speed))?;
    }
    let windows: Vec<_> = analysis.verdict.windows.iter().copied().map(parts_report::window).collect();
    print_windows(&windows, out)?;
    for sweep in &analysis.sweeps {
        print_sweep(sweep, analysis, out)?;
    }
    Ok(())
}

fn print_sweep(sweep: &SweepAnalysis, analysis: &RecordingAnalysis, out: &mut Output) -> anyhow::Result<()> {
    let report = &sweep.report;
    writeln!(
        out,
        "sweep from {} to {} counts in {}: {} events, peak {}",
        report.from,
        report.to,
        seconds(report.end.micros_since(report.start) as f64),
        count(report.on + report.off),
        rate(report.peak_rate.0)
    )?;
    // What has been said of the whole need not be said again.
    if let Err(failure) = &sweep.verdict
        && analysis.verdict.outcome.as_ref().err() != Some(failure)
    {
        writeln!(out, "  failed: {}: {failure}", failure.name())?;
    }
    if report.quality.has_flicker() && sweep.verdict.is_ok() {
        writeln!(out, "  many events follow the {} Hz of the mains", report.quality.flicker_hz)?;
    }
    writeln!(out, "  each method on this sweep alone, as if the pixels answered at once:")?;
    for method in Method::ALL {
        let mark = if method == analysis.method { '*' } else { ' ' };
        match report.estimate(method) {
            Some(Ok(said)) => writeln!(
                out,
                " {mark} {:<12} {:>8} counts at {}, {} steps, last interval {:.1} ms",
                method.name(),
                said.position.to_string(),
                seconds(said.t_us),
                said.iterations,
                said.interval_us * 1e-3
            )?,
            Some(Err(error)) => writeln!(out, " {mark} {:<12} no answer: {error}", method.name())?,
            None => {}
        }
    }
    Ok(())
}

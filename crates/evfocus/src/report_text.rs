//! A run's report in words.

use std::io::Write;

use evfocus_ipc::{Calibration, Report, RigDelay, State, Sweep, WindowAnswer};

use crate::output::Output;
use crate::quantity::{answer, count, half_difference, rate};

/// What is odd about an answer, in as few words as there are.
pub(crate) fn flags(names: &[String]) -> String {
    names.join(", ").replace('-', " ")
}

/// The outcome in one line, what else is known of the answer, and what was odd.
pub(crate) fn print_outcome(report: &Report, out: &mut Output) -> anyhow::Result<()> {
    let result = &report.result;
    match (result.state, result.position) {
        (State::Focused, Some(position)) => {
            let method = result.decided_by.as_ref().or(result.method.as_ref());
            writeln!(
                out,
                "focused at {} ({}) in {:.1} s",
                answer(position, result.error_bar, result.confidence),
                method.map_or("no method", String::as_str),
                report.elapsed_s
            )?;
        }
        (State::Idle, _) => writeln!(out, "{}", result.message)?,
        _ => writeln!(out, "failed: {}: {}", result.reason.as_deref().unwrap_or("unknown"), result.message)?,
    }
    if let Some(number) = result.window {
        let place = report.request.windows.get(number as usize).map(|window| {
            format!(", {} x {} pixels at {}, {}", window.width, window.height, window.x, window.y)
        });
        writeln!(out, "window {number} decided{}", place.unwrap_or_default())?;
    }
    if let Some(second) = result.second_depth {
        writeln!(out, "second depth at {second:.1} counts")?;
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
    if let Some(RigDelay { base_us, us_per_hz, measurements }) = report.rig_delay {
        let (base, slope) = (base_us * 1e-3, us_per_hz * 1e-3);
        let learnt = match measurements {
            0 => String::from("assumed"),
            1 => String::from("learnt from 1 run"),
            more => format!("learnt from {more} runs"),
        };
        writeln!(
            out,
            "delay of the pixels  {base:.1} ms and {slope:.1} ms for each Hz of their noise, {learnt}"
        )?;
    }
    if let Some(known) = &report.calibration {
        writeln!(out, "measured of the lens  {}", calibration(known))?;
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
    print_windows(&report.windows, out)?;
    for sweep in &report.sweeps {
        print_sweep(sweep, out)?;
    }
    if let Some(map) = report.clock_map {
        writeln!(out, "clocks: drift {:.1} ppm, residual {:.0} us", map.drift_ppm, map.residual_us)?;
    }
    let timings: Vec<String> =
        report.timings.iter().map(|timing| format!("{} {:.2} s", timing.phase, timing.seconds)).collect();
    writeln!(out, "time: {}", timings.join(", "))?;
    Ok(())
}

/// What each window says.
pub(crate) fn print_windows(windows: &[WindowAnswer], out: &mut Output) -> anyhow::Result<()> {
    for (number, window) in windows.iter().enumerate() {
        let answer = match (window.position, &window.message) {
            (Some(position), _) => answer(position, window.error_bar, window.confidence),
            (None, message) => format!("no answer: {}", message.as_deref().unwrap_or("unknown")),
        };
        writeln!(out, "window {number}: {answer}")?;
    }
    Ok(())
}

/// What was measured of a lens, in a line.
pub(crate) fn calibration(known: &Calibration) -> String {
    format!(
        "{:.0} counts/s, {}, {:.0} positions/s, obeys after {:.0} ms",
        known.speed_counts_per_s,
        play(known),
        known.read_back_hz,
        known.command_latency_us * 1e-3
    )
}

fn play(known: &Calibration) -> String {
    match (known.backlash, known.backlash_error_bar) {
        (Some(counts), Some(error_bar)) => format!("play {counts:.1} ± {error_bar:.1} counts"),
        (Some(counts), None) => format!("play {counts:.1} counts"),
        (None, _) => String::from("play unknown"),
    }
}

/// Everything that was measured of a lens.
pub(crate) fn print_calibration(known: &Calibration, out: &mut Output) -> anyhow::Result<()> {
    let millis = |micros: f64| micros * 1e-3;
    writeln!(out, "lens         {}", known.lens)?;
    writeln!(out, "range        {:.1} to {:.1} counts", known.range.min, known.range.max)?;
    writeln!(out, "speed        {:.1} counts/s", known.speed_counts_per_s)?;
    writeln!(
        out,
        "positions    {:.0} a second, {:.1} ms from question to answer, noise {:.2} counts",
        known.read_back_hz,
        millis(known.read_back_us),
        known.read_noise
    )?;
    writeln!(out, "obeys after  {:.1} ms", millis(known.command_latency_us))?;
    writeln!(out, "stops in     {:.0} ms, {:.1} counts", millis(known.stop_us), known.stop_counts)?;
    writeln!(out, "             {}", play(known))?;
    if let Some(lag_us) = known.lag_us {
        writeln!(out, "             pixels and positions {:.1} ms late", millis(lag_us))?;
    }
    Ok(())
}

fn print_sweep(sweep: &Sweep, out: &mut Output) -> anyhow::Result<()> {
    writeln!(out, "sweep from {:.1} to {:.1} counts", sweep.from, sweep.to)?;
    for said in &sweep.estimators {
        let answer = match (said.position, &said.reason) {
            (Some(position), _) => format!("{position:>8.1} counts in {} steps", said.iterations),
            (None, Some(reason)) => format!("no answer: {reason}"),
            (None, None) => String::from("no answer"),
        };
        writeln!(out, "  {:<12} {answer}", said.method)?;
    }
    if let Some(said) = sweep.structure {
        writeln!(
            out,
            "  peak         {:.0} counts wide, {:.0} times what chance makes; pixel noise {:.2} Hz",
            said.width, said.significance, said.noise_hz
        )?;
    }
    Ok(())
}

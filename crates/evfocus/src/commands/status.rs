//! `evfocus status`: what the daemon is doing.

use std::io::Write;

use clap::Args;
use evfocus_ipc::{LastRun, PauseState, State, Status};

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;
use crate::quantity::{answer, count, rate};
use crate::report_text::{calibration, flags};

/// Say what the daemon is doing: mode, state, lens, events, last run
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus status
  evfocus status --json | jq .lens_position

Units: lens positions in counts, event_rate in events per second, uptime_s in seconds.

States: idle (no run yet, or the last was aborted), scanning (a run is under way), focused, failed (see evfocus report).")]
pub struct Arguments {
    #[command(flatten)]
    socket: SocketArguments,
}

/// Prints the status.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let status = block_on(async { Ok(connect(&arguments.socket).await?.status().await?) })?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&status)?;
    } else {
        print(&status, &mut out)?;
    }
    Ok(Exit::Done)
}

fn print(status: &Status, out: &mut Output) -> anyhow::Result<()> {
    match status.run_id {
        Some(id) => writeln!(out, "state     {}, run {id}: {}", status.state, status.phase)?,
        None => writeln!(out, "state     {}", status.state)?,
    }
    writeln!(out, "mode      {}", mode(status))?;
    if let Some(share) = status.sharpness {
        writeln!(out, "sharpness {:.0} % of that in focus", 100.0 * share)?;
    }
    writeln!(out, "camera    {}", status.camera.as_deref().unwrap_or("none"))?;
    writeln!(out, "lens      {}", status.lens.as_deref().unwrap_or("none"))?;
    writeln!(out, "position  {}", position(status))?;
    if let Some(known) = &status.calibration {
        writeln!(out, "measured  {}", calibration(known))?;
    }
    writeln!(out, "events    {}, {} lost so far", rate(status.event_rate), count(status.events_lost))?;
    if let Some(last) = &status.last_run {
        writeln!(out, "last run  {}", last_run(last))?;
    }
    for grant in &status.real_time {
        let refused = grant.remedy.as_ref().map(|remedy| format!(", not granted: {remedy}"));
        writeln!(out, "real time {}: {}{}", grant.what, grant.asked, refused.unwrap_or_default())?;
    }
    if let Some(fault) = &status.fault {
        writeln!(out, "fault     {fault}")?;
    }
    writeln!(out, "daemon    version {}, up for {:.0} s", status.version, status.uptime_s)?;
    Ok(())
}

/// The mode, and whether it rests.
fn mode(status: &Status) -> String {
    match status.pause {
        PauseState::Running => status.mode.to_string(),
        state @ (PauseState::Pausing | PauseState::Paused) => format!("{}, {}", status.mode, state.name()),
    }
}

/// Where the lens is, and whether it moves.
pub(super) fn position(status: &Status) -> String {
    let place = status.lens_position.map_or_else(|| String::from("unknown"), |at| format!("{at:.1} counts"));
    let moving = if status.lens_moving { ", moving" } else { "" };
    let range = status.lens_range.map(|range| format!(" of {:.0} to {:.0}", range.min, range.max));
    format!("{place}{}{moving}", range.unwrap_or_default())
}

/// How the last run ended.
fn last_run(run: &LastRun) -> String {
    let how = match run.state {
        State::Idle => String::from("aborted"),
        State::Scanning => String::from("under way"),
        State::Focused => run.position.map_or_else(
            || String::from("focused"),
            |at| format!("focused at {}", answer(at, run.error_bar, run.confidence)),
        ),
        State::Failed => format!("failed: {}", run.reason.as_deref().unwrap_or("no reason given")),
    };
    let flags = if run.flags.is_empty() { String::new() } else { format!("; {}", flags(&run.flags)) };
    format!("{}: {how}{flags}", run.id)
}

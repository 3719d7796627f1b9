//! `evfocus record`: what the camera sends, in a file.

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use evfocusd::recorder::{RecordPlan, Recorded, StopRecording, positions_beside, record};
use serde::Serialize;
use tokio::signal::unix::{SignalKind, signal};

use crate::arguments::ConfigArguments;
use crate::connection::block_on;
use crate::exit::Exit;
use crate::files::must_have_folder;
use crate::output::{self, Output};
use crate::quantity::count;

/// Record what the camera sends, with the lens positions beside it
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus record sweep.raw --config evk4.toml --sweep       the lens goes up and down its range meanwhile
  evfocus record desk.aedat4 --config davis346.toml --seconds 10
  evfocus analyze sweep.raw --positions sweep.positions.csv

FILE.raw is Prophesee RAW (EVT3), FILE.aedat4 is iniVation's AEDAT 4; any camera can be recorded as either. The lens positions go \
into FILE.positions.csv: t_us,position (camera time in microseconds, lens counts).

It opens the devices itself: a daemon that has them must be stopped first. Ctrl-C ends the recording, and nothing that has arrived \
is lost.")]
pub struct Arguments {
    /// The recording to write: FILE.raw or FILE.aedat4
    file: PathBuf,
    /// How long to record, in seconds [default: until Ctrl-C, or the end of the sweep]
    #[arg(long, value_name = "N", value_parser = seconds, allow_negative_numbers = true)]
    seconds: Option<f64>,
    /// Move the lens to the lower end of its range, then up and down again at full speed
    #[arg(long)]
    sweep: bool,
    /// Replace files that are there
    #[arg(long)]
    overwrite: bool,
    /// Print what was recorded as JSON instead of text
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    config: ConfigArguments,
}

/// How long a recording may take: a day.
const SECONDS: RangeInclusive<f64> = 0.01..=86_400.0;

/// What is printed.
#[derive(Debug, Serialize)]
struct Record {
    recording: PathBuf,
    positions_file: PathBuf,
    events: u64,
    lost: u64,
    positions: u64,
    seconds: f64,
}

/// Records, and says what is in the files.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    must_have_folder(&[("FILE", &arguments.file)])?;
    let config = arguments.config.read()?;
    let plan = RecordPlan {
        file: arguments.file.clone(),
        duration: arguments.seconds.map(Duration::from_secs_f64),
        sweep: arguments.sweep,
        overwrite: arguments.overwrite,
    };
    let stop = StopRecording::default();
    let told = stop.clone();
    let recorded = block_on(async move {
        let (mut interrupt, mut terminate) =
            (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
        let recording = tokio::task::spawn_blocking(move || {
            record(&config, &plan, &told, || output::say("recording; Ctrl-C ends it"))
        });
        tokio::pin!(recording);
        loop {
            tokio::select! {
                ended = &mut recording => break Ok(ended.context("the recorder has panicked")??),
                _ = interrupt.recv() => stop.stop(),
                _ = terminate.recv() => stop.stop(),
            }
        }
    })?;
    report(arguments, &recorded)?;
    Ok(Exit::Done)
}

fn report(arguments: &Arguments, recorded: &Recorded) -> anyhow::Result<()> {
    if recorded.lens_failed {
        output::warn(
            "the lens failed meanwhile, so positions are missing; `evfocus info` says what the recording holds",
        );
    }
    if recorded.positions_lost > 0 {
        output::warn(&format!(
            "the camera's clock started anew, so {} positions from just before are missing",
            recorded.positions_lost
        ));
    }
    let mut out = Output::new();
    if arguments.json {
        out.json(&Record {
            recording: arguments.file.clone(),
            positions_file: positions_beside(&arguments.file),
            events: recorded.events,
            lost: recorded.lost,
            positions: recorded.positions,
            seconds: recorded.seconds,
        })?;
    } else {
        writeln!(
            out,
            "{} events in {:.2} s, {} lost; {} lens positions in {}",
            count(recorded.events),
            recorded.seconds,
            count(recorded.lost),
            count(recorded.positions),
            positions_beside(&arguments.file).display()
        )?;
    }
    Ok(())
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if SECONDS.contains(&value) => Ok(value),
        _ => {
            Err(format!("{text:?} is not a number of seconds from {} to {}", SECONDS.start(), SECONDS.end()))
        }
    }
}

//! `evfocus simulate`: a sweep on a simulated rig, as a recording.

use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use evfocus_core::{LensRange, LensSpeed};
use hil_sim::Scene;

use crate::arguments::{RigArguments, duration, speed};
use crate::exit::{Exit, UsageError};
use crate::files::{must_differ, must_have_folder};
use crate::output::Output;
use crate::quantity::count;
use crate::simulation::{Plan, simulate};

/// Simulate a sweep and write it as a recording, with the lens positions and the truth
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus simulate --out s.raw --positions s.csv --truth s.json --seed 7
  evfocus simulate --out s.raw --positions s.csv --truth s.json --shake 2 --light dark --both-directions
  evfocus simulate --out s.raw --positions s.csv --truth s.json --frames frames --fps 1000
  evfocus analyze s.raw --positions s.csv

The recording is Prophesee RAW (EVT3). The same options give the same files, byte for byte.

Frames are the light on the sensor before noise and thresholds: 16-bit grey PNGs of linear intensity, 128 steps per DN (black 0, \
white 255 DN = 32640), for other simulators to be run on; frames.csv lists their times.

Units: positions in lens counts, speeds in counts per second, t_us in microseconds, rests with their unit (60ms).")]
pub struct Arguments {
    /// The recording to write
    #[arg(long, value_name = "FILE.raw")]
    out: PathBuf,
    /// The lens positions to write: CSV, t_us,position (microseconds, lens counts)
    #[arg(long, value_name = "FILE.csv")]
    positions: PathBuf,
    /// The truth to write: where the scene is sharp (lens counts), and what was simulated
    #[arg(long, value_name = "FILE.json")]
    truth: PathBuf,
    /// Speed of the sweep, in counts per second [default: 1765, the whole range in 2 s]
    #[arg(long, value_name = "SPEED", value_parser = speed, allow_negative_numbers = true, conflicts_with = "sweep_s")]
    speed: Option<LensSpeed>,
    /// Time of the sweep at full speed, in seconds, instead of the speed
    #[arg(long, value_name = "SECONDS", value_parser = seconds, allow_negative_numbers = true)]
    sweep_s: Option<f64>,
    /// Sweep back as well
    #[arg(long)]
    both_directions: bool,
    /// How long the lens stands before, between and after the sweeps, with its unit
    #[arg(long, value_name = "DURATION", default_value = "60ms", value_parser = rest)]
    rest: Duration,
    /// Write frames of linear intensity into this folder
    #[arg(long, value_name = "DIR", requires = "fps")]
    frames: Option<PathBuf>,
    /// Frames per second of simulated time
    #[arg(long, value_name = "N", requires = "frames", value_parser = frames_per_second)]
    fps: Option<f64>,
    /// Print the truth as JSON instead of text
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rig: RigArguments,
}

/// How long a sweep may take, in seconds, whether it is given as a time or as a speed. A recording is as long.
const SWEEP_S: RangeInclusive<f64> = 0.01..=1000.0;
/// The longest rest.
const LONGEST_REST: Duration = Duration::from_secs(100);

/// Simulates, writes the files and says what is in them.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let rig = arguments.rig.rig(Scene::DeadLeaves)?;
    let speed = sweep_speed(arguments, rig.lens.range)?.unwrap_or(rig.lens.max_speed);
    let frame_list = arguments.frames.as_ref().map(|folder| folder.join("frames.csv"));
    let mut files: Vec<(&str, &Path)> =
        vec![("--out", &arguments.out), ("--positions", &arguments.positions), ("--truth", &arguments.truth)];
    must_have_folder(&files)?;
    files.extend(frame_list.as_deref().map(|list| ("--frames", list)));
    must_differ(&files)?;
    let truth = simulate(&Plan {
        rig,
        recording: arguments.out.clone(),
        positions: arguments.positions.clone(),
        truth: arguments.truth.clone(),
        speed,
        both_directions: arguments.both_directions,
        rest: arguments.rest,
        frames: arguments.frames.clone().zip(arguments.fps),
    })?;
    let mut out = Output::new();
    if arguments.json {
        out.json(&truth)?;
    } else {
        writeln!(out, "{} events, {} lost, seed {}", count(truth.events), count(truth.lost), truth.seed)?;
        writeln!(out, "sharp at {:.1} counts", truth.position)?;
    }
    Ok(Exit::Done)
}

/// The speed that the options name, if one does.
fn sweep_speed(arguments: &Arguments, range: LensRange) -> anyhow::Result<Option<LensSpeed>> {
    let length = range.length();
    if let Some(speed) = arguments.speed.map(LensSpeed::counts_per_second)
        && !SWEEP_S.contains(&(length / speed))
    {
        let (shortest, longest) = SWEEP_S.into_inner();
        return Err(UsageError(format!(
            "--speed {speed} is out of range: a sweep of the {length:.0} counts takes from {shortest} to {longest} s, so the \
             speed must be from {} to {} counts per second",
            length / longest,
            length / shortest
        ))
        .into());
    }
    let from_time = arguments.sweep_s.map(|seconds| LensSpeed::new(length / seconds)).transpose()?;
    Ok(arguments.speed.or(from_time))
}

fn rest(text: &str) -> Result<Duration, String> {
    let rest = duration(text)?;
    if rest > LONGEST_REST {
        return Err(format!("{text} is longer than {} s", LONGEST_REST.as_secs()));
    }
    Ok(rest)
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if SWEEP_S.contains(&value) => Ok(value),
        _ => {
            let (shortest, longest) = SWEEP_S.into_inner();
            Err(format!("{text:?} is not a number of seconds from {shortest} to {longest}"))
        }
    }
}

fn frames_per_second(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.1..=100_000.0).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a number of frames per second from 0.1 to 100000")),
    }
}

//! `evfocus simulate`: a sweep on a simulated rig, as a recording.

use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use evfocus_core::LensSpeed;
use hil_sim::Scene;

use crate::arguments::{RigArguments, duration, speed};
use crate::exit::Exit;
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
    #[arg(long, value_name = "DURATION", default_value = "60ms", value_parser = duration)]
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

/// Simulates, writes the files and says what is in them.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let rig = arguments.rig.rig(Scene::DeadLeaves)?;
    let speed = match (arguments.speed, arguments.sweep_s) {
        (Some(speed), _) => speed,
        (None, Some(seconds)) => LensSpeed::new(rig.lens.range.length() / seconds)?,
        (None, None) => rig.lens.max_speed,
    };
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

fn seconds(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.01..=1000.0).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a number of seconds from 0.01 to 1000")),
    }
}

fn frames_per_second(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if (0.1..=100_000.0).contains(&value) => Ok(value),
        _ => Err(format!("{text:?} is not a number of frames per second from 0.1 to 100000")),
    }
}

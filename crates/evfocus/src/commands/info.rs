//! `evfocus info`: what a recording holds.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use evfocus_record::{Format, Summary};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::arguments::choices;
use crate::exit::Exit;
use crate::files::must_not_be_folder;
use crate::output::Output;
use crate::quantity::{count, rate, seconds};

/// Say what a recording holds: format, sensor, events, times, rates, damage
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus info sweep.raw
  evfocus info sweep.raw --json | jq .events

Units: times in microseconds of the camera's clock (t_us), rates in events per second. The peak rate is that of the busiest \
10 ms; a gap is a silence of more than 0.1 s.")]
pub struct Arguments {
    /// The recording: Prophesee RAW (EVT3, EVT2), AEDAT4, CSV or DAVIS346 USB words
    recording: PathBuf,
    /// Read the file as this format instead of recognising it by its content
    #[arg(long, value_name = "NAME", value_parser = choices(&Format::ALL, Format::name))]
    format: Option<Format>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Info {
    recording: String,
    format: &'static str,
    width: Option<u16>,
    height: Option<u16>,
    geometry_inferred: bool,
    events: u64,
    on: u64,
    off: u64,
    first_t_us: Option<i64>,
    last_t_us: Option<i64>,
    duration_us: Option<i64>,
    mean_rate: Option<f64>,
    peak_rate: Option<f64>,
    gaps: u64,
    longest_silence_us: i64,
    /// Sums over all events, to compare two readers by.
    sum_x: u64,
    sum_y: u64,
    sum_t_us: i128,
    triggers: Option<u64>,
    damaged: bool,
    damage: Map<String, Value>,
}

/// Prints the summary.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    must_not_be_folder(&arguments.recording, "recording")?;
    let summary = Summary::of_file(&arguments.recording, arguments.format)?;
    let info = Info::of(arguments, &summary);
    let mut out = Output::new();
    if arguments.json {
        out.json(&info)?;
    } else {
        info.print(&mut out)?;
    }
    Ok(Exit::Done)
}

impl Info {
    fn of(arguments: &Arguments, summary: &Summary) -> Self {
        let damage = summary.damage.counters();
        Self {
            recording: arguments.recording.display().to_string(),
            format: summary.format.name(),
            width: summary.geometry.map(|geometry| geometry.width),
            height: summary.geometry.map(|geometry| geometry.height),
            geometry_inferred: summary.geometry_inferred,
            events: summary.events,
            on: summary.on,
            off: summary.off,
            first_t_us: summary.first_t_us,
            last_t_us: summary.last_t_us,
            duration_us: summary
                .first_t_us
                .zip(summary.last_t_us)
                .map(|(first, last)| last.saturating_sub(first)),
            mean_rate: summary.mean_rate.map(|rate| rate.0),
            peak_rate: summary.peak_rate.map(|rate| rate.0),
            gaps: summary.gaps,
            longest_silence_us: summary.longest_silence_us,
            sum_x: summary.sum_x,
            sum_y: summary.sum_y,
            sum_t_us: summary.sum_t_us,
            triggers: summary.triggers,
            damaged: !summary.damage.is_none(),
            damage: damage.into_iter().map(|(name, number)| (name.to_owned(), number.into())).collect(),
        }
    }

    fn print(&self, out: &mut Output) -> anyhow::Result<()> {
        writeln!(out, "recording  {}", self.recording)?;
        writeln!(out, "format     {}", self.format)?;
        if let (Some(width), Some(height)) = (self.width, self.height) {
            let inferred = if self.geometry_inferred { " or more (the file does not say)" } else { "" };
            writeln!(out, "sensor     {width} x {height} pixels{inferred}")?;
        }
        writeln!(out, "events     {} ({} ON, {} OFF)", count(self.events), count(self.on), count(self.off))?;
        if let (Some(first), Some(last)) = (self.first_t_us, self.last_t_us) {
            writeln!(out, "time       {first} to {last} us, {}", seconds(last.saturating_sub(first) as f64))?;
        }
        if let Some(mean) = self.mean_rate {
            writeln!(out, "mean rate  {}", rate(mean))?;
        }
        if let Some(peak) = self.peak_rate {
            writeln!(out, "peak rate  {} (busiest 10 ms)", rate(peak))?;
        }
        writeln!(
            out,
            "silences   {} of more than 100 ms, the longest {:.1} ms",
            self.gaps,
            self.longest_silence_us as f64 * 1e-3
        )?;
        if let Some(triggers) = self.triggers.filter(|&triggers| triggers > 0) {
            writeln!(out, "triggers   {triggers}")?;
        }
        if self.damaged {
            for (name, number) in self.damage.iter().filter(|(_, number)| number.as_u64() != Some(0)) {
                writeln!(out, "damage     {}: {number}", name.replace('_', " "))?;
            }
        } else {
            writeln!(out, "damage     none")?;
        }
        Ok(())
    }
}

//! `evfocus demo`: a focus run on a simulated rig.

mod live;
mod outcome;

use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use evfocus_core::controller::FocusRequest;
use evfocus_core::{LensPosition, Method, RunReport};
use evfocusd::{Config, VirtualRig};
use hil_sim::Scene;

use crate::arguments::{RigArguments, choices};
use crate::exit::Exit;
use crate::output::Output;
use crate::plot::FocusPlot;

/// Show a focus run on a simulated rig, with the daemon's own code; needs no hardware and no daemon
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus demo
  evfocus demo --scene text --light dark --shake 2 --seed 7
  evfocus demo --report curve.svg --json

The same options print the same result: the rig lives in virtual time. On a terminal the run is slowed down to real time and \
the focus curve drawn while the lens sweeps.

Units: positions in lens counts, elapsed_s in seconds of the simulated rig's time.

Exit status: 0 focused, 1 an error, 2 wrong usage, 3 the run ended without focus.")]
pub struct Arguments {
    /// Focus measure and search; the daemon's default if left out
    #[arg(long, value_name = "NAME", value_parser = choices(&Method::ALL, Method::name))]
    method: Option<Method>,
    /// Draw the focus curves, every method's answer and the truth into this file
    #[arg(long, value_name = "FILE.svg")]
    report: Option<PathBuf>,
    /// Print one JSON object instead of text
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    rig: RigArguments,
}

/// Makes the run and says how it went.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let mut out = Output::new();
    let config = Config { rig: arguments.rig.rig(Scene::Text)?, ..Config::simulated()? };
    let mut live = if out.is_terminal() && !arguments.json {
        live::LiveDemo::on_terminal(config.rig.lens.range)
    } else {
        live::LiveDemo::silent()
    };
    let mut rig = VirtualRig::new(&config)?;
    let request = FocusRequest { method: arguments.method, ..FocusRequest::default() };
    let report = rig.focus(request, |now, snapshot, curve| live.show(now, snapshot, curve, &mut out))?;
    live.finish()?;
    let truth = rig.truth();
    if let Some(path) = &arguments.report {
        let plot = plot_of(&report, &truth, &config.rig);
        plot.write(path).with_context(|| format!("{}: cannot draw the plot", path.display()))?;
    }
    let outcome = outcome::DemoOutcome::of(&report, &truth, &config.rig);
    if arguments.json {
        out.json(&outcome)?;
    } else {
        outcome.print(&mut out)?;
    }
    Ok(Exit::of_run(outcome.is_focused()))
}

fn plot_of(report: &RunReport, truth: &[LensPosition], rig: &hil_sim::RigConfig) -> FocusPlot {
    let mut plot = FocusPlot::new(format!("{} before {}, seed {}", rig.sensor.model, rig.scene, rig.seed));
    for sweep in report.sweeps() {
        plot.add_sweep(sweep);
    }
    if let evfocus_core::Outcome::Focused { position } = report.outcome {
        plot.set_answer(position, report.plan.method);
    }
    plot.set_truth(truth);
    plot
}

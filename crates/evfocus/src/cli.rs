//! The command line: its subcommands.

use clap::{CommandFactory, Parser, Subcommand};

use crate::commands::{
    abort, analyze, calibrate, completions, demo, devices, doctor, eval, focus, info, man, measure, mode,
    move_lens, pause, record, reload, replay, report, simulate, status, watch,
};
use crate::exit::Exit;

const AFTER_HELP: &str = "\
Examples:
  evfocus demo                                          see a focus run on a simulated rig
  evfocus focus                                         focus the camera of the running daemon
  evfocus analyze sweep.raw --positions lens.csv        find focus in a recorded sweep
  evfocus simulate --out s.raw --positions s.csv --truth s.json && evfocus analyze s.raw --positions s.csv

Units: lens positions are in the lens's own counts, speeds in counts/s, event rates in events/s. Durations on the command line \
carry their unit (55ms, 0.055s, 800us); in JSON the name ends in the unit (t_us, elapsed_s).

Exit status: 0 focused or done, 1 an error, 2 wrong usage, 3 the run ended without focus.";

/// Focus an event camera with a motorised lens: trigger the daemon, analyze recordings, simulate.
#[derive(Debug, Parser)]
#[command(name = "evfocus", version, after_help = AFTER_HELP, max_term_width = 120, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Focus(focus::Arguments),
    Abort(abort::Arguments),
    Status(status::Arguments),
    Watch(watch::Arguments),
    Move(move_lens::Arguments),
    Mode(mode::Arguments),
    Pause(pause::Arguments),
    Resume(pause::ResumeArguments),
    Calibrate(calibrate::Arguments),
    Devices(devices::Arguments),
    Doctor(doctor::Arguments),
    Report(report::Arguments),
    Reload(reload::Arguments),
    Analyze(analyze::Arguments),
    Info(info::Arguments),
    Record(record::Arguments),
    Replay(replay::Arguments),
    Simulate(simulate::Arguments),
    Demo(demo::Arguments),
    Eval(eval::Arguments),
    Measure(measure::Arguments),
    Completions(completions::Arguments),
    #[command(hide = true)]
    Man(man::Arguments),
}

impl Cli {
    /// Does what was asked for.
    pub fn run(self) -> anyhow::Result<Exit> {
        match self.command {
            Command::Focus(arguments) => focus::run(&arguments),
            Command::Abort(arguments) => abort::run(&arguments),
            Command::Status(arguments) => status::run(&arguments),
            Command::Watch(arguments) => watch::run(&arguments),
            Command::Move(arguments) => move_lens::run(&arguments),
            Command::Mode(arguments) => mode::run(&arguments),
            Command::Pause(arguments) => pause::run(&arguments),
            Command::Resume(arguments) => pause::resume(&arguments),
            Command::Calibrate(arguments) => calibrate::run(&arguments),
            Command::Devices(arguments) => devices::run(&arguments),
            Command::Doctor(arguments) => doctor::run(&arguments),
            Command::Report(arguments) => report::run(&arguments),
            Command::Reload(arguments) => reload::run(&arguments),
            Command::Analyze(arguments) => analyze::run(&arguments),
            Command::Info(arguments) => info::run(&arguments),
            Command::Record(arguments) => record::run(&arguments),
            Command::Replay(arguments) => replay::run(&arguments),
            Command::Simulate(arguments) => simulate::run(&arguments),
            Command::Demo(arguments) => demo::run(&arguments),
            Command::Eval(arguments) => eval::run(&arguments),
            Command::Measure(arguments) => measure::run(&arguments),
            Command::Completions(arguments) => completions::run(&arguments, &mut Self::command()),
            Command::Man(arguments) => man::run(&arguments, Self::command()),
        }
    }
}

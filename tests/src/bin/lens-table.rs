//! A focus run of the daemon's loop through each lens driver and the model of its device, against the simulated lens without a
//! protocol before it; virtual time, as Markdown: `cargo run --release -p evfocus-tests --bin lens-table`. Names of drivers as
//! arguments make a table of those only.
#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use std::collections::BTreeSet;
use std::time::Duration;

use anyhow::{Context, Result, bail};
use evfocus_core::controller::FocusRequest;
use evfocus_core::{LensPosition, Outcome, Phase};
use evfocus_tests::lenses::{EmulatedLens, LENSES, config};
use evfocusd::config::LensBackend;
use evfocusd::{Config, VirtualRig};
use hil_sim::MotionConfig;

/// Where focus lies, as shares of the range: between the whole counts, for some lenses can only be sent to those.
const FOCUSES: [f64; 6] = [0.21, 0.33, 0.45, 0.57, 0.69, 0.81];
/// The shake of the camera, pixels RMS: in a still scene errors are fractions of a count, so that those of the lens show; in a shaken one
/// they are mostly the scene's.
const STILL: f64 = 0.0;
const SHAKEN: f64 = 2.0;

/// One run.
struct Run {
    error: f64,
    sweep: Duration,
    /// Positions per second in the first sweep.
    read_back_hz: f64,
    elapsed: Duration,
}

fn run(config: &Config) -> Result<Run> {
    let mut rig = VirtualRig::new(config)?;
    let mut times = BTreeSet::new();
    let report = rig.focus(FocusRequest::default(), |_, snapshot, _| {
        if let (Some(Phase::Sweeping), Some(lens)) = (snapshot.phase, snapshot.lens) {
            times.insert(lens.time());
        }
    })?;
    let truth = *rig.truth().first().context("a truth")?;
    let Outcome::Focused { position } = report.outcome else {
        bail!("seed {}: {:?}", config.rig.seed, report.outcome)
    };
    let sweep = Phase::ALL.into_iter().zip(report.phases).find(|(phase, _)| *phase == Phase::Sweeping);
    let (first, last) = (times.first().context("positions")?, times.last().context("positions")?);
    Ok(Run {
        error: position.counts_from(truth),
        sweep: sweep.context("a sweep")?.1,
        read_back_hz: (times.len() - 1) as f64 / last.since(*first).as_secs_f64(),
        elapsed: report.elapsed(),
    })
}

/// Runs through `lens`, and without its protocol, with the camera shaken by `shake`.
fn runs(lens: &EmulatedLens, shake: f64) -> Result<[Vec<Run>; 2]> {
    let (mut behind, mut plain) = (Vec::new(), Vec::new());
    for (seed, share) in (1..).zip(FOCUSES) {
        let mut config = config(lens.section, seed)?;
        let range = config.rig.lens.range;
        config.rig.focus = LensPosition(range.min().0 + share * range.length());
        config.rig.motion =
            MotionConfig { shake_px_rms: shake, roll_rad_rms: 0.0015 * shake, ..MotionConfig::default() };
        behind.push(run(&config).with_context(|| lens.name)?);
        plain.push(run(&Config { lens: LensBackend::Simulated, ..config }).context("without protocol")?);
    }
    Ok([behind, plain])
}

fn mean(runs: &[Run], value: fn(&Run) -> f64) -> f64 {
    runs.iter().map(value).sum::<f64>() / runs.len() as f64
}

fn row(lens: &EmulatedLens) -> Result<String> {
    let error = |runs: &[Run]| mean(runs, |run| run.error.abs());
    let [still, plain] = runs(lens, STILL)?;
    let [shaken, plain_shaken] = runs(lens, SHAKEN)?;
    Ok(format!(
        "| {} | {:.2} | {:.2} | {:.2} | {:+.2} | {:.1} | {:.1} | {:.0} | {:.2} | {:.2} |",
        lens.name,
        error(&still),
        error(&plain),
        error(&still) / error(&plain),
        mean(&still, |run| run.error),
        error(&shaken),
        error(&plain_shaken),
        mean(&still, |run| run.read_back_hz),
        mean(&still, |run| run.sweep.as_secs_f64()),
        mean(&still, |run| run.elapsed.as_secs_f64()),
    ))
}

fn main() -> Result<()> {
    let asked: Vec<String> = std::env::args().skip(1).collect();
    let lenses: Vec<_> =
        LENSES.iter().filter(|lens| asked.is_empty() || asked.iter().any(|name| name == lens.name)).collect();
    println!(
        "Mean absolute error against truth in counts of 3530 ({} runs each), and the same of the simulated lens without a protocol before it, \
         on the same seeds: in a still scene with the ratio of the two and the mean error with its sign, and with the camera shaken by 2 \
         pixels, where the error is mostly the scene's. Positions per second in the first sweep; seconds of that sweep, which ends beyond the \
         peak, and of the whole run.\n",
        FOCUSES.len()
    );
    println!(
        "| driver | still | without protocol | ratio | mean | shaken | without protocol | positions/s | sweep, s | run, s |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    // Two at a time: the rigs are what takes the memory.
    for pair in lenses.chunks(2) {
        let rows: Vec<Result<String>> = std::thread::scope(|scope| {
            let rows: Vec<_> = pair.iter().map(|lens| scope.spawn(|| row(lens))).collect();
            rows.into_iter().map(|row| row.join().unwrap_or_else(|_| bail!("a run panicked"))).collect()
        });
        for row in rows {
            println!("{}", row?);
        }
    }
    Ok(())
}

//! `evfocus eval`: how far off every method is, on sweeps whose focus is known.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use evfocus_eval::dataset::{Dataset, ead, elp, simulated, stress_suite, sweep_files};
use evfocus_eval::result::SequenceResult;
use evfocus_eval::tables::NamedScore;
use evfocus_eval::{Cache, cache, evaluate, figures, tables};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::exit::{Exit, UsageError};
use crate::output::Output;

/// Say how far off every method is, on sweeps whose focus is known
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus eval --suite simulated --markdown
  evfocus eval --suite simulated --markdown --figures figures/ > results.md
  evfocus eval --sweeps recordings/ --json | jq '.[0].results[].answers'

The simulated suite is shaped like the data set of \"Autofocus for Event Cameras\" (Lin et al., CVPR 2022): 7 scenes, light and \
dark, still and shaken; the stress suite has one thing wrong at a time. What is finished is kept in the cache: an interrupted \
command goes on where it was, and a new build of the program judges anew.

Units: errors in lens counts; in milliseconds of the sweep for --elp, whose positions are not known.")]
pub struct Arguments {
    /// Simulated sequences: the paper's conditions, or one difficulty at a time; may be given several times
    #[arg(long = "suite", value_name = "NAME", value_enum)]
    suites: Vec<Suite>,
    /// A folder with sweeps: NAME.raw, NAME.positions.csv, NAME.truth.json
    #[arg(long, value_name = "DIR")]
    sweeps: Option<PathBuf>,
    /// The paper's data set, EAD: MAT files of version 7
    #[arg(long, value_name = "DIR")]
    ead: Option<PathBuf>,
    /// The data set of the event-based Laplacian product, ELP: npy files
    #[arg(long, value_name = "DIR")]
    elp: Option<PathBuf>,
    /// Print tables as Markdown; the default
    #[arg(long)]
    markdown: bool,
    /// Print the tables, every answer and every curve as JSON instead
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// Draw the errors, focus curves and the golden search's steps into this folder, as SVG
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Sequences judged at the same time; all cores if left out
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Where simulated sweeps and finished results are kept; it may be deleted at any time
    #[arg(long, value_name = "DIR", default_value = "evfocus-eval-cache")]
    cache: PathBuf,
    /// Make everything again, whatever the cache holds
    #[arg(long)]
    fresh: bool,
}

/// Simulated sequences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Suite {
    /// 28 sequences shaped like the paper's.
    Simulated,
    /// The same before pixels of two other simulators' kinds.
    Foreign,
    /// Sweeps with one thing wrong at a time.
    Stress,
}

#[derive(Serialize)]
struct Judged<'a> {
    dataset: &'a str,
    about: &'a str,
    scores: Vec<NamedScore>,
    results: &'a [SequenceResult],
}

impl Arguments {
    fn datasets(&self) -> anyhow::Result<Vec<Dataset>> {
        let mut datasets = Vec::new();
        for suite in &self.suites {
            datasets.push(match suite {
                Suite::Simulated => simulated::dataset(),
                Suite::Foreign => simulated::foreign(),
                Suite::Stress => stress_suite(),
            });
        }
        datasets.extend(self.sweeps.as_deref().map(sweep_files::dataset).transpose()?);
        datasets.extend(self.ead.as_deref().map(ead::dataset).transpose()?);
        datasets.extend(self.elp.as_deref().map(elp::dataset).transpose()?);
        if datasets.is_empty() {
            return Err(
                UsageError(String::from("nothing to judge; name --suite, --sweeps, --ead or --elp")).into()
            );
        }
        Ok(datasets)
    }
}

/// Judges every method on every sequence named. Nothing is printed before all of it is there: half a table is none.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let datasets = arguments.datasets()?;
    let program = std::env::current_exe().and_then(std::fs::read).context("cannot read this program")?;
    let cache = Cache::new(arguments.cache.clone(), cache::fingerprint(&program), arguments.fresh)?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let threads = arguments.threads.map_or(cores, usize::from);
    let mut judged = Vec::with_capacity(datasets.len());
    for dataset in &datasets {
        judged.push((dataset, judge(dataset, &cache, threads)?));
    }
    if let Some(folder) = &arguments.figures {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        for (dataset, results) in &judged {
            figures::draw(&dataset.name, results, folder)?;
        }
    }
    let mut out = Output::new();
    if arguments.json {
        let judged: Vec<Judged> = judged
            .iter()
            .map(|(Dataset { name, about, .. }, results)| Judged {
                dataset: name,
                about,
                scores: tables::scores(results),
                results,
            })
            .collect();
        out.json(&judged)?;
    } else {
        let words: Vec<String> = std::env::args().skip(1).collect();
        writeln!(out, "# Results\n\nMade by `evfocus {}`.\n", words.join(" "))?;
        for (dataset, results) in &judged {
            writeln!(out, "{}", tables::markdown(dataset, results))?;
        }
    }
    Ok(Exit::of_run(true))
}

fn judge(dataset: &Dataset, cache: &Cache, threads: usize) -> anyhow::Result<Vec<SequenceResult>> {
    let bar = ProgressBar::new(dataset.entries.len() as u64).with_prefix(dataset.name.clone());
    if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {eta} {msg}") {
        bar.set_style(style);
    }
    let results = evaluate(dataset, cache, threads, &|name| {
        bar.set_message(name.to_owned());
        bar.inc(1);
    });
    bar.finish_and_clear();
    results
}

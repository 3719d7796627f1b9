//! Makes whole focus runs over random scenes, lights, shakes, lenses and faults in virtual time, and prints how they ended as
//! Markdown: `cargo run --release -p evfocus-tests --bin random-runs -- [NUMBER [FIRST_SEED [FILE.jsonl]]]`.
#![expect(clippy::print_stdout, reason = "the tables are what this program is for")]

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::process::ExitCode;

use anyhow::{Context, Result};
use evfocus_core::controller::Pace;
use evfocus_core::{Flag, Outcome};
use evfocus_tests::random_runs::{Ended, Trial, Verdict, run_all};

type Run = (u64, Trial, Ended);

/// Exit status if a run was wrong or misled; 1 is an error.
const UNSOUND: u8 = 3;

fn main() -> Result<ExitCode> {
    let mut words = std::env::args().skip(1);
    let number = |word: Option<String>, otherwise: u64| {
        word.map_or(Ok(otherwise), |word| word.parse().with_context(|| format!("{word:?} is no number")))
    };
    let (runs, first) = (number(words.next(), 1000)?, number(words.next(), 1)?);
    let seeds: Vec<u64> = (first..first + runs).collect();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let runs = run_all(&seeds, threads)?;
    if let Some(path) = words.next() {
        dump(&path, &runs)?;
    }
    println!("{} runs, seeds {first} to {}.\n", runs.len(), first + runs.len() as u64 - 1);
    outcomes(&runs);
    reasons(&runs);
    reliability(&runs);
    let mut sound = true;
    for (seed, trial, ended) in &runs {
        let verdict = ended.verdict(trial);
        if matches!(verdict, Verdict::Wrong | Verdict::Misled) {
            sound = false;
            println!("- seed {seed}, {} in the way: {}", trial.hindrance.title(), unsound(verdict, ended));
        }
    }
    Ok(if sound { ExitCode::SUCCESS } else { ExitCode::from(UNSOUND) })
}

/// What was wrong with a run.
fn unsound(verdict: Verdict, ended: &Ended) -> String {
    let answer = ended.report.answer.and_then(|answer| Some((answer.error_bar?, answer.confidence?)));
    match (ended.error, answer) {
        (Some(error), Some((bar, confidence))) => {
            format!("{}: {error:+.1} counts, error bar {bar:.1}, confidence {confidence:.2}", verdict.title())
        }
        _ => format!("{}: {}", verdict.title(), ended.reason()),
    }
}

fn dump(path: &str, runs: &[Run]) -> Result<()> {
    let mut file = BufWriter::new(File::create(path).with_context(|| format!("cannot write {path}"))?);
    for (seed, trial, ended) in runs {
        let rig = &trial.config.rig;
        let answer = ended.report.answer;
        let line = serde_json::json!({
            "seed": seed,
            "hindrance": trial.hindrance.title(),
            "pace": trial.request.pace.map(Pace::name),
            "sensor": rig.sensor.model,
            "cutoff_hz": rig.sensor.cutoff_hz,
            "scene": rig.scene.to_string(),
            "shake": rig.motion.shake_px_rms,
            "moving": rig.motion.velocity_px_per_s.0,
            "fan": rig.fan.is_some(),
            "speed": rig.lens.max_speed.counts_per_second(),
            "focus": rig.focus.0,
            "reason": ended.reason(),
            "verdict": ended.verdict(trial).title(),
            "error": ended.error,
            "depth_of_focus": ended.depth_of_focus,
            "error_bar": answer.and_then(|answer| answer.error_bar),
            "confidence": answer.and_then(|answer| answer.confidence),
            "width": answer.and_then(|answer| answer.width),
            "flags": answer.map(|answer| answer.flags.iter().map(Flag::name).collect::<Vec<_>>()),
            "legs": ended.report.sweeps().count(),
            "elapsed": ended.report.elapsed().as_secs_f64(),
            "sweeps": ended.report.sweeps().filter_map(|leg| leg.structure).map(|said| said.map_or_else(
                |error| serde_json::json!(error.to_string()),
                |said| serde_json::json!({
                    "position": said.position.0, "width": said.width, "scatter": said.scatter,
                    "significance": said.significance, "noise_hz": said.noise_hz, "velocity": said.velocity,
                    "coarse": said.is_coarse,
                }),
            )).collect::<Vec<_>>(),
        });
        writeln!(file, "{line}")?;
    }
    Ok(file.flush()?)
}

fn outcomes(runs: &[Run]) {
    println!("| what stood in the way | runs | {} |", Verdict::ALL.map(Verdict::title).join(" | "));
    println!("| --- | ---: |{}", " ---: |".repeat(Verdict::ALL.len()));
    let mut rows: BTreeMap<_, [usize; Verdict::ALL.len()]> = BTreeMap::new();
    for (_, trial, ended) in runs {
        let verdict = ended.verdict(trial);
        let row = rows.entry(trial.hindrance).or_default();
        for (cell, _) in row.iter_mut().zip(Verdict::ALL).filter(|(_, column)| *column == verdict) {
            *cell += 1;
        }
    }
    for (hindrance, row) in rows {
        let cells = row.map(|cell| cell.to_string()).join(" | ");
        println!("| {} | {} | {cells} |", hindrance.title(), row.iter().sum::<usize>());
    }
    println!();
}

fn reasons(runs: &[Run]) {
    let mut named: BTreeMap<&str, usize> = BTreeMap::new();
    for (_, _, ended) in runs {
        *named.entry(ended.reason()).or_default() += 1;
    }
    let named: Vec<String> = named.into_iter().map(|(name, number)| format!("{name} {number}")).collect();
    println!("How they ended: {}.\n", named.join(", "));
}

fn reliability(runs: &[Run]) {
    println!(
        "| speed | answers | within 1 error bar | within 2 | within 3 | of confidence 0.9 or more | right of these |"
    );
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let percent = |part: usize, all: usize| {
        if all == 0 { String::from("-") } else { format!("{:.1} %", 100.0 * part as f64 / all as f64) }
    };
    for pace in Pace::ALL.into_iter().map(Some).chain([None]) {
        let answers: Vec<(&Trial, f64, f64, f64, f64)> = runs
            .iter()
            .filter(|(_, trial, _)| pace.is_none() || trial.request.pace == pace)
            .filter(|(_, _, ended)| matches!(ended.report.outcome, Outcome::Focused { .. }))
            .filter_map(|(_, trial, ended)| {
                let answer = ended.report.answer?;
                Some((trial, ended.error?.abs(), answer.error_bar?, answer.confidence?, ended.depth_of_focus))
            })
            .collect();
        let within = |bars: f64| answers.iter().filter(|answer| answer.1 <= bars * answer.2).count();
        let sure: Vec<_> = answers.iter().filter(|answer| answer.3 >= 0.9).collect();
        let right = sure.iter().filter(|answer| {
            let range = answer.0.config.rig.lens.range.length();
            answer.1 <= answer.4.max(0.01 * range)
        });
        println!(
            "| {} | {} | {} | {} | {} | {} | {} |",
            pace.map_or("all", Pace::name),
            answers.len(),
            percent(within(1.0), answers.len()),
            percent(within(2.0), answers.len()),
            percent(within(3.0), answers.len()),
            sure.len(),
            percent(right.count(), sure.len()),
        );
    }
    println!();
}

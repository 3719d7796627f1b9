//! Makes runs with things going wrong, and prints how they ended: `fault-laboratory [N [SEED]]`, 1000 from seed 1 unless given. Exit
//! status 3 if an invariant was broken, with the seed.

#![expect(clippy::print_stdout, reason = "this is what the program is for")]

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, Result};
use evfocus_tests::fault_laboratory::{Ended, Trial};

const BROKEN: u8 = 3;

fn main() -> Result<ExitCode> {
    let mut words = std::env::args().skip(1);
    let mut number = |otherwise: u64| {
        words
            .next()
            .map_or(Ok(otherwise), |word| word.parse().with_context(|| format!("{word:?} is no number")))
    };
    let (trials, first) = (number(1000)?, number(1)?);
    let ended = all(first..first + trials)?;
    println!("{trials} trials, seeds {first} to {}.\n", first + trials - 1);
    table(&ended);
    let broken: Vec<_> = ended.iter().filter(|(_, _, ended)| !ended.broken.is_empty()).collect();
    for (seed, trial, ended) in &broken {
        println!("- seed {seed}, {:?}: {}", trial.mishaps, ended.broken.join("; "));
    }
    let megabytes = resident_kib().unwrap_or(0) / 1024;
    println!("\n{} trials broke an invariant; {megabytes} MiB resident at the end", broken.len());
    Ok(if broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(BROKEN) })
}

type Row = (u64, Trial, Ended);

fn all(seeds: std::ops::Range<u64>) -> Result<Vec<Row>> {
    let (next, rows) = (AtomicU64::new(seeds.start), Mutex::new(Vec::new()));
    let work = || -> Result<()> {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return Ok(());
            }
            let trial = Trial::draw(seed)?;
            let ended = trial.run().with_context(|| format!("seed {seed}"))?;
            rows.lock().map_err(|_| anyhow::anyhow!("a thread came to grief"))?.push((seed, trial, ended));
        }
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        threads
            .into_iter()
            .try_for_each(|thread| thread.join().map_err(|_| anyhow::anyhow!("a thread came to grief"))?)
    })?;
    let mut rows = rows.into_inner().map_err(|_| anyhow::anyhow!("a thread came to grief"))?;
    rows.sort_by_key(|(seed, ..)| *seed);
    Ok(rows)
}

/// Runs by what went wrong in their trial and by how they ended. A trial with several mishaps stands in several rows.
fn table(rows: &[Row]) {
    let outcomes: BTreeSet<&str> =
        rows.iter().flat_map(|(_, _, ended)| ended.outcomes.iter().copied()).collect();
    let mut counts: BTreeMap<String, (usize, BTreeMap<&str, usize>)> = BTreeMap::new();
    for (_, trial, ended) in rows {
        let mut names: Vec<String> = trial.mishaps.iter().map(|mishap| format!("{mishap:?}")).collect();
        if names.is_empty() {
            names.push("nothing".to_owned());
        }
        for name in names {
            let (trials, row) = counts.entry(name).or_default();
            *trials += 1;
            for outcome in &ended.outcomes {
                *row.entry(outcome).or_default() += 1;
            }
        }
    }
    println!("| what went wrong | trials | how the runs ended |\n| --- | ---: | --- |");
    for (name, (trials, row)) in &counts {
        let mut cells: Vec<(&str, usize)> = row.iter().map(|(name, count)| (*name, *count)).collect();
        cells.sort_by_key(|(name, count)| (std::cmp::Reverse(*count), *name));
        let cells: Vec<String> = cells.iter().map(|(name, count)| format!("{name} {count}")).collect();
        println!("| {name} | {trials} | {} |", cells.join(", "));
    }
    println!("\n{} kinds of ends: {}.", outcomes.len(), outcomes.into_iter().collect::<Vec<_>>().join(", "));
}

fn resident_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok())
}

//! Makes runs with things going wrong, and prints how they ended as Markdown:
//! `cargo run --release -p evfocus-tests --bin fault-laboratory -- [N | FIRST..END] [--threads T] [--record FILE]`.
//!
//! 1000 trials from seed 1 unless given. With a file to record in, trials that it holds are not made again, so that a long series can
//! be stopped and taken up. Exit status 3 if an invariant was broken, with the seed.

#![expect(clippy::print_stdout, reason = "the page is what this program is for")]
#![expect(clippy::print_stderr, reason = "the progress of an hour's work")]

use std::ops::Range;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context, Result, anyhow, bail};
use evfocus_tests::fault_laboratory::Trial;
use evfocus_tests::fault_laboratory::page::page;
use evfocus_tests::fault_laboratory::record::{Record, Row};

const BROKEN: u8 = 3;
/// Trials between two words on the progress.
const WORD_EACH: usize = 100;

fn main() -> Result<ExitCode> {
    let Arguments { seeds, threads, record } = Arguments::parse(std::env::args().skip(1))?;
    let (record, known) = Record::open(record.as_deref())?;
    let rows = all(&seeds, threads, record, known)?;
    let rows: Vec<Row> = rows.into_iter().filter(|row| seeds.contains(&row.seed)).collect();
    print!("{}", page(&rows));
    eprintln!("{} MiB resident at the end", resident_kib().unwrap_or(0) / 1024);
    let is_sound = rows.iter().all(|row| row.broken.is_empty());
    Ok(if is_sound { ExitCode::SUCCESS } else { ExitCode::from(BROKEN) })
}

/// What was asked for.
struct Arguments {
    seeds: Range<u64>,
    threads: usize,
    record: Option<PathBuf>,
}

impl Arguments {
    fn parse(mut words: impl Iterator<Item = String>) -> Result<Self> {
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let mut arguments = Self { seeds: 1..1001, threads, record: None };
        while let Some(word) = words.next() {
            let mut value = || words.next().with_context(|| format!("{word} needs a value"));
            match word.as_str() {
                "--threads" => arguments.threads = number(&value()?)? as usize,
                "--record" => arguments.record = Some(PathBuf::from(value()?)),
                option if option.starts_with('-') => bail!("{option} is no option"),
                seeds => {
                    arguments.seeds = match seeds.split_once("..") {
                        Some((first, end)) => number(first)?..number(end)?,
                        None => 1..1 + number(seeds)?,
                    }
                }
            }
        }
        Ok(arguments)
    }
}

fn number(word: &str) -> Result<u64> {
    word.parse().with_context(|| format!("{word:?} is no number"))
}

/// Makes the trials that are not `known` yet, and returns all.
fn all(seeds: &Range<u64>, threads: usize, record: Record, known: Vec<Row>) -> Result<Vec<Row>> {
    let done: std::collections::BTreeSet<u64> = known.iter().map(|row| row.seed).collect();
    let next = AtomicU64::new(seeds.start);
    let kept = Mutex::new((record, known));
    let work = || -> Result<()> {
        loop {
            let seed = next.fetch_add(1, Ordering::Relaxed);
            if seed >= seeds.end {
                return Ok(());
            }
            if done.contains(&seed) {
                continue;
            }
            let trial = Trial::draw(seed)?;
            let row = Row::new(seed, &trial, trial.run().with_context(|| format!("seed {seed}"))?);
            let mut kept = kept.lock().map_err(|_| anyhow!("a thread came to grief"))?;
            let (record, rows) = &mut *kept;
            record.add(&row)?;
            if !row.broken.is_empty() {
                eprintln!("{}", row.complaint());
            }
            rows.push(row);
            if rows.len() % WORD_EACH == 0 {
                let broken = rows.iter().filter(|row| !row.broken.is_empty()).count();
                eprintln!("{} trials, {broken} with a broken invariant", rows.len());
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads.max(1)).map(|_| scope.spawn(work)).collect();
        threads
            .into_iter()
            .try_for_each(|thread| thread.join().map_err(|_| anyhow!("a thread came to grief"))?)
    })?;
    let (_, mut rows) = kept.into_inner().map_err(|_| anyhow!("a thread came to grief"))?;
    rows.sort_by_key(|row| row.seed);
    Ok(rows)
}

fn resident_kib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok())
}

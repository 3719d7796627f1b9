//! The laboratory's page: what went wrong and how the runs ended, as Markdown.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::time::Duration;

use super::record::Row;

const HEAD: &str = "\
<!-- Made by the command below; do not edit. -->

# What goes wrong in the fault laboratory, and how the runs end

Made by `cargo run --release -p evfocus-tests --bin fault-laboratory --";

const JUDGED: &str = "\
A trial is the daemon's controller on the simulated rig with a small sensor, in virtual time, with up to three mishaps at random
moments; a quarter of the trials are in continuous mode. Whatever goes wrong:

- every run ends within 75 s, and with a report; nothing panics;
- the lens stands still 2.5 s after the last reason to move, unless no order reaches its motor, and is never sent out of its range;
- every event that the camera hands over is counted, and every one that it says it has lost;
- no run starts by itself but in continuous mode, and none while that is paused;
- memory does not grow by more than 16 MiB;
- whatever becomes of a write, what was said to be written is there and can be read, and so is all else in the state directory.

What clients may do to the socket is judged by `crates/evfocusd/tests/crowd.rs`, also in virtual time: the status is answered within
100 ms. The real process is put to the test by `crates/evfocusd/tests/process`.
";

/// With earlier draws than today's.
const FOUND: &str = "\
Nothing in the daemon. Seed 372 of earlier draws, a camera that is away when the process starts again, made no run and was let through:
a gap in the judging, since closed.
";

/// The page on `rows`, which are of consecutive seeds.
pub fn page(rows: &[Row]) -> String {
    let (first, last) = (rows.first().map_or(0, |row| row.seed), rows.last().map_or(0, |row| row.seed));
    let broken: Vec<&Row> = rows.iter().filter(|row| !row.broken.is_empty()).collect();
    let runs: usize = rows.iter().map(|row| row.outcomes.len()).sum();
    let hours = rows.iter().map(|row| row.lasted).sum::<Duration>().as_secs_f64() / 3600.0;
    let grown = rows.iter().map(|row| row.grown).max().unwrap_or(0) as f64 / f64::from(1 << 20);
    let of_broken: Vec<String> = broken.iter().map(|row| format!("- {}\n", row.complaint())).collect();
    format!(
        "{HEAD} {first}..{}`.\n\n{JUDGED}\n**{} trials, seeds {first} to {last}; {} broke an invariant.** {runs} runs in {hours:.1} \
         hours of virtual time; memory grew by {grown:.1} MiB at the most.\n\n{}\n{}\n## What it found on the way\n\n{FOUND}",
        last + 1,
        rows.len(),
        broken.len(),
        of_broken.concat(),
        table(rows),
    )
}

/// Runs by what went wrong in their trial and by how they ended.
fn table(rows: &[Row]) -> String {
    let mut counts: BTreeMap<&str, (usize, BTreeMap<&str, usize>)> = BTreeMap::new();
    let (mut all, nothing) = (BTreeMap::new(), ["nothing".to_owned()]);
    for row in rows {
        let mishaps = if row.mishaps.is_empty() { &nothing[..] } else { &row.mishaps };
        for outcome in &row.outcomes {
            *all.entry(outcome.as_str()).or_default() += 1;
        }
        for mishap in mishaps {
            let (trials, outcomes) = counts.entry(mishap).or_default();
            *trials += 1;
            for outcome in &row.outcomes {
                *outcomes.entry(outcome).or_default() += 1;
            }
        }
    }
    let mut table = "A trial with several mishaps stands in several rows.\n\n| what went wrong | trials | how the runs ended |\n\
                     | --- | ---: | --- |\n"
        .to_owned();
    let lines = counts
        .into_iter()
        .map(|(mishap, (trials, outcomes))| format!("| {mishap} | {trials} | {} |\n", list(outcomes)));
    table.extend(lines);
    table + &format!("| **all** | {} | {} |\n", rows.len(), list(all))
}

/// The most frequent first.
fn list(counts: BTreeMap<&str, usize>) -> String {
    let mut cells: Vec<_> = counts.into_iter().collect();
    cells.sort_by_key(|(name, count)| (Reverse(*count), *name));
    cells.into_iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_by_mishap_and_outcome() {
        let row = |seed, mishaps: &[&str], outcomes: &[&str]| Row {
            seed,
            mishaps: mishaps.iter().map(ToString::to_string).collect(),
            outcomes: outcomes.iter().map(ToString::to_string).collect(),
            broken: Vec::new(),
            lasted: Duration::from_secs(1800),
            grown: 1 << 20,
        };
        let rows = [row(1, &["a", "b"], &["flat", "focused", "focused"]), row(2, &[], &["focused"])];
        let page = page(&rows);
        for line in [
            "| a | 1 | focused 2, flat 1 |",
            "| nothing | 1 | focused 1 |",
            "| **all** | 2 | focused 3, flat 1 |",
            "**2 trials, seeds 1 to 2; 0 broke an invariant.** 4 runs in 1.0 hours",
            "fault-laboratory -- 1..3`",
        ] {
            assert!(page.contains(line), "{line} is not in {page}");
        }
    }
}

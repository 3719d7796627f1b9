//! Asks every candidate about every sequence, on all cores.

mod ask;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, bail};

use crate::Candidate;
use crate::cache::Cache;
use crate::dataset::Entry;
use crate::result::SequenceResult;

/// The results for `entries`, in their order. Each thread has one sequence in memory. What the cache holds is not done again; what is
/// finished is kept there at once. `finished` is told the name of each sequence when it is done.
///
/// # Errors
/// The first sequence that cannot be loaded or kept.
pub fn evaluate(
    entries: &[Entry],
    cache: &Cache,
    threads: usize,
    finished: &(dyn Fn(&str) + Sync),
) -> anyhow::Result<Vec<SequenceResult>> {
    let candidates = Candidate::all();
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(entry) = entries.get(index) else { return };
            let result = one(entry, &candidates, cache)
                .with_context(|| format!("sequence {:?} cannot be judged", entry.label.name));
            if result.is_err() {
                // The others stop after what they are at.
                next.store(entries.len(), Ordering::Relaxed);
            }
            finished(&entry.label.name);
            if let Ok(mut done) = done.lock() {
                done.insert(index, result);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..threads.min(entries.len()) {
            scope.spawn(work);
        }
        work();
    });
    let Ok(done) = done.into_inner() else { bail!("a thread came to grief") };
    done.into_values().collect()
}

fn one(entry: &Entry, candidates: &[Candidate], cache: &Cache) -> anyhow::Result<SequenceResult> {
    let names: Vec<String> = candidates.iter().map(ToString::to_string).collect();
    let key = format!("{} {}", entry.key(), names.join(","));
    if let Some(result) = cache.result(&key) {
        return Ok(result);
    }
    let sequence = entry.load(cache)?;
    let result = ask::ask(&entry.label, &sequence, candidates);
    cache.keep_result(&key, &result)?;
    Ok(result)
}

//! Asks every candidate about every sequence, on all cores.

mod ask;

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, bail};
use evfocus_core::DelayModel;

use crate::Candidate;
use crate::cache::Cache;
use crate::dataset::{Dataset, Entry};
use crate::result::SequenceResult;

/// The results for the entries of `dataset`, in their order, after its teachers have taught the pixels' delay. Each thread has one
/// sequence in memory. What the cache holds is not done again; what is finished is kept there at once. `finished` is told the name of
/// each sequence when it is done.
///
/// # Errors
/// The first sequence that cannot be loaded or kept.
pub fn evaluate(
    dataset: &Dataset,
    cache: &Cache,
    threads: usize,
    finished: &(dyn Fn(&str) + Sync),
) -> anyhow::Result<Vec<SequenceResult>> {
    let delays = taught(&dataset.teachers, cache)?;
    let candidates: Vec<Candidate> = Candidate::all()
        .into_iter()
        .filter(|candidate| delays.is_some() || *candidate != Candidate::Taught)
        .collect();
    let delays = delays.unwrap_or_default();
    let entries = &dataset.entries;
    let next = AtomicUsize::new(0);
    let done = Mutex::new(BTreeMap::new());
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(entry) = entries.get(index) else { return };
            let result = one(entry, &candidates, &delays, cache)
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

/// What `teachers` teach of the pixels' delay; `None` without any.
fn taught(teachers: &[Entry], cache: &Cache) -> anyhow::Result<Option<DelayModel>> {
    let mut delays = DelayModel::default();
    for teacher in teachers {
        let sequence =
            teacher.load(cache).with_context(|| format!("sequence {:?} cannot teach", teacher.label.name))?;
        ask::teach(&sequence, &mut delays);
    }
    Ok((!teachers.is_empty()).then_some(delays))
}

fn one(
    entry: &Entry,
    candidates: &[Candidate],
    delays: &DelayModel,
    cache: &Cache,
) -> anyhow::Result<SequenceResult> {
    let names: Vec<String> = candidates.iter().map(ToString::to_string).collect();
    let key = format!("{} {} {delays:?}", entry.key(), names.join(","));
    if let Some(result) = cache.result(&key) {
        return Ok(result);
    }
    let sequence = entry.load(cache)?;
    let result = ask::ask(&entry.label, &sequence, candidates, delays);
    cache.keep_result(&key, &result)?;
    Ok(result)
}

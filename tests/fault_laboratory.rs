//! A few trials of the fault laboratory; `cargo run --release -p evfocus-tests --bin fault-laboratory -- 10000` makes more.

use anyhow::{Context, Result};
use evfocus_tests::fault_laboratory::{Mishap, Trial};

#[test]
fn no_invariant_is_broken() -> Result<()> {
    let mut seen = std::collections::BTreeSet::new();
    for seed in 1..=150 {
        let trial = Trial::draw(seed)?;
        let ended = trial.run().with_context(|| format!("seed {seed}"))?;
        assert!(ended.broken.is_empty(), "seed {seed}, {:?}: {:?}", trial.mishaps, ended.broken);
        assert!(!ended.outcomes.is_empty(), "seed {seed}: a call to focus came to nothing");
        seen.extend(trial.mishaps);
    }
    assert_eq!(seen.len(), Mishap::ALL.len(), "a mishap that never happens proves nothing: {seen:?}");
    Ok(())
}

#[test]
fn a_trial_is_the_same_each_time() -> Result<()> {
    let once = || -> Result<_> { Ok(Trial::draw(7)?.run()?.outcomes) };
    assert_eq!(once()?, once()?);
    Ok(())
}

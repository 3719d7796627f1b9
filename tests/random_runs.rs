//! A few of the runs that `cargo run --release -p evfocus-tests --bin random-runs` makes by the thousand: none hangs, none is wrong and
//! sure of it, none fails for a reason that misleads.

use anyhow::Result;
use evfocus_core::Directions;
use evfocus_tests::random_runs::{Trial, Verdict, run_all};

#[test]
fn random_runs_end_in_focus_or_with_the_right_reason() -> Result<()> {
    let seeds: Vec<u64> = (2000..2016).collect();
    let runs = run_all(&seeds, 2)?;
    for (seed, trial, ended) in &runs {
        let verdict = ended.verdict(trial);
        println!("seed {seed}: {}, {}, error {:?}", verdict.title(), ended.reason(), ended.error);
        assert!(
            !matches!(verdict, Verdict::Wrong | Verdict::Misled),
            "seed {seed}: {verdict:?}, {}",
            ended.reason()
        );
    }
    let focused = runs.iter().filter(|(_, trial, ended)| ended.verdict(trial) == Verdict::Focused).count();
    assert!(focused >= 6, "{focused} of 16 focused");
    Ok(())
}

#[test]
fn runs_that_start_by_themselves_end_likewise() -> Result<()> {
    for seed in 2000..2006 {
        let trial = Trial::draw(seed)?.in_continuous_mode();
        let ended = trial.run()?;
        let verdict = ended.verdict(&trial);
        println!("seed {seed}: {}, {}, error {:?}", verdict.title(), ended.reason(), ended.error);
        assert!(!matches!(verdict, Verdict::Wrong | Verdict::Misled), "seed {seed}: {}", ended.reason());
    }
    Ok(())
}

/// Fronts of houses that go by: what is at one height is sharp in other bins than what is at another, because they pass in turns.
#[test]
fn readings_that_contradict_each_other_are_unsure() -> Result<()> {
    let mut trial = Trial::draw(122)?;
    // The way back would settle it.
    trial.request.directions = Some(Directions::Forward);
    assert_eq!(trial.run()?.reason(), "unsure");
    Ok(())
}

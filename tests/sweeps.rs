//! Recorded sweeps against what independent reference implementations answered for them.
//!
//! `EVFOCUS_SWEEPS=FOLDER` goes over another folder of the same make instead of the sweeps that come with the repository.

use core::time::Duration;
use std::path::PathBuf;

use evfocus_core::{LensPosition, Method, Searcher, SweepQuality, SweepRecorder};
use evfocus_tests::recorded_sweeps::{RecordedSweep, Reference, committed};

/// The method, its accumulation interval in milliseconds, and the column of the table.
const COLUMNS: [(Method, u64, &str); 4] = [
    (Method::Egs, 55, "egs"),
    (Method::EgsOfficial, 55, "egs_official"),
    (Method::ErFixed, 55, "er_fixed_55ms"),
    (Method::ErFixed, 65, "er_fixed_65ms"),
];

/// How far an answer may be from the table's, lens counts: the table's own rounding, and half as much again.
const TOLERANCE: f64 = 0.15;

fn folder() -> PathBuf {
    std::env::var_os("EVFOCUS_SWEEPS").map_or_else(committed, PathBuf::from)
}

/// Errors of the methods of [`COLUMNS`] in one leg.
fn errors(sweep: &RecordedSweep, leg: &SweepRecorder) -> anyhow::Result<Vec<f64>> {
    let recorded = leg.sweep(&sweep.trace).ok_or_else(|| anyhow::anyhow!("no events"))?;
    let mut searcher = Searcher::new(sweep.geometry);
    let mut errors = Vec::new();
    for (method, milliseconds, _) in COLUMNS {
        let answer = searcher.search(method, &recorded, Duration::from_millis(milliseconds))?;
        errors.push(answer.position.counts_from(sweep.truth));
    }
    Ok(errors)
}

#[test]
fn answers_agree_with_the_reference_table() -> anyhow::Result<()> {
    let folder = folder();
    let mut failures = Vec::new();
    for row in Reference::read_all(&folder)? {
        let sweep = RecordedSweep::read(&folder, &row.name)?;
        let legs = sweep.legs();
        let [leg] = legs.as_slice() else { anyhow::bail!("{}: {} legs, not one", row.name, legs.len()) };
        print!("{:28}", row.name);
        for ((_, _, column), error) in COLUMNS.into_iter().zip(errors(&sweep, leg)?) {
            let expected = row.get(column)?;
            print!("  {column} {error:+.1} ({expected:+.1})");
            if (error - expected).abs() > TOLERANCE {
                failures.push(format!("{}: {column} {error:+.1}, reference {expected:+.1}", row.name));
            }
        }
        println!();
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    Ok(())
}

#[test]
fn sweeps_both_ways_are_split_at_the_turn() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        let legs = sweep.legs();
        let ways = if name.ends_with("both_directions") { 2 } else { 1 };
        assert_eq!(legs.len(), ways, "{name}");
        if ways == 2 {
            for leg in &legs {
                println!("{name}: {:?} events, errors {:.1?}", leg.store().len(), errors(&sweep, leg)?);
            }
        }
        if name == "light_static_both_directions" {
            let expected = [(197_154, -76.2), (178_972, 66.4)];
            for (leg, (events, error)) in legs.iter().zip(expected) {
                assert_eq!(leg.store().len(), events);
                assert!((errors(&sweep, leg)?[0] - error).abs() < TOLERANCE);
            }
        }
    }
    Ok(())
}

#[test]
fn only_the_saturated_sweep_is_called_saturated_and_none_flat() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        for leg in sweep.legs() {
            let recorded = leg.sweep(&sweep.trace).ok_or_else(|| anyhow::anyhow!("no events"))?;
            let quality = SweepQuality::of(&recorded)?;
            println!("{name:32} {quality:.3?}");
            assert_eq!(quality.is_saturated(), name.starts_with("saturated"), "{name}");
            assert!(!quality.is_flat(), "{name}");
            assert_eq!(quality.has_flicker(), name.starts_with("flicker"), "{name}");
        }
    }
    Ok(())
}

#[test]
fn a_truth_lies_within_the_range_swept() -> anyhow::Result<()> {
    let folder = folder();
    for name in RecordedSweep::names(&folder)? {
        let sweep = RecordedSweep::read(&folder, &name)?;
        let (low, high) = sweep.trace.extent().unwrap_or_default();
        let LensPosition(truth) = sweep.truth;
        assert!(low.0 < truth && truth < high.0, "{name}");
    }
    Ok(())
}

//! How often continuous mode rightly starts a run, and how often it does so without need, in virtual time, as Markdown:
//! `cargo run --release -p evfocus-tests --bin continuous-mode -- [TRIALS_OF_EACH [FIRST_SEED [PART_OF_A_TITLE]]]`.
#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use std::time::Duration;

use anyhow::{Context, Result};
use evfocus_tests::continuous::{Ended, Happening, Trial};

const HAPPENINGS: [Happening; 11] = [
    Happening::Focus(150.0),
    Happening::Focus(-300.0),
    Happening::Focus(400.0),
    Happening::Focus(-800.0),
    Happening::Nothing,
    Happening::Pace(0.0),
    Happening::Pace(0.3),
    Happening::Pace(3.0),
    Happening::Light(0.7),
    Happening::Light(1.5),
    Happening::Light(0.3),
];

fn main() -> Result<()> {
    let mut words = std::env::args().skip(1);
    let number = |word: Option<String>, otherwise: u64| {
        word.map_or(Ok(otherwise), |word| word.parse().with_context(|| format!("{word:?} is no number")))
    };
    let (trials, first) = (number(words.next(), 8)?, number(words.next(), 1)?);
    let part = words.next().unwrap_or_default();
    println!("{trials} trials of each, seeds {first} to {}.\n", first + trials - 1);
    println!("| what happens | began in focus | started a run | after | error then, counts | sharpness |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for happening in HAPPENINGS.into_iter().filter(|happening| happening.title().contains(&part)) {
        let mut ended = Vec::new();
        for seed in first..first + trials {
            let trial = Trial::draw(happening, seed)?;
            ended.push((seed, trial.run().with_context(|| format!("seed {seed}"))?));
        }
        row(happening, &ended);
    }
    Ok(())
}

fn row(happening: Happening, ended: &[(u64, Ended)]) {
    let focused: Vec<_> = ended.iter().filter(|(_, ended)| ended.began_focused).collect();
    let ran: Vec<_> = focused.iter().filter(|(_, ended)| ended.noticed_after.is_some()).collect();
    let list = |values: Vec<String>| values.join(" ");
    println!(
        "| {} | {} of {} | {} | {} | {} | {} |",
        happening.title(),
        focused.len(),
        ended.len(),
        ran.len(),
        list(
            ran.iter()
                .filter_map(|(_, e)| e.noticed_after)
                .map(|after: Duration| format!("{:.1}", after.as_secs_f64()))
                .collect()
        ),
        list(ran.iter().map(|(_, ended)| format!("{:+.0}", ended.error)).collect()),
        list(
            focused
                .iter()
                .map(|(seed, e)| format!(
                    "{seed}:{}",
                    e.sharpness.map_or("-".to_owned(), |s| format!("{s:.2}"))
                ))
                .collect()
        ),
    );
}

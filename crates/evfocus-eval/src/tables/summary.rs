//! A line a kind of sequence: what the golden search errs by, and what we do.

use evfocus_core::Method;

use super::put;
use crate::Candidate;
use crate::dataset::{Condition, Label};
use crate::result::{Score, SequenceResult};

/// Stresses that are kinds of their own, or that leave nothing to be right about.
const NOT_HARD: [&str; 5] = ["none", "two depths", "both directions", "saturated read-out", "rate cap"];

const CANDIDATES: [Candidate; 3] =
    [Candidate::Search(Method::Egs), Candidate::Search(Method::Auto), Candidate::Taught];

/// A kind of sequence, and which ones are of it.
type Kind = (&'static str, fn(&Label) -> bool);

const KINDS: [Kind; 7] = [
    ("light, static", |label| plain(label, Condition::LightStatic)),
    ("light, shake", |label| plain(label, Condition::LightDynamic)),
    ("dark, static", |label| plain(label, Condition::DarkStatic)),
    ("dark, shake", |label| plain(label, Condition::DarkDynamic)),
    ("hard, static", |label| hard(label, false)),
    ("hard, moving", |label| hard(label, true)),
    ("both directions", |label| label.stress.as_deref() == Some("both directions")),
];

fn plain(label: &Label, condition: Condition) -> bool {
    label.stress.is_none() && label.condition == Some(condition)
}

fn hard(label: &Label, moving: bool) -> bool {
    let is_hard = label.stress.as_deref().is_some_and(|stress| !NOT_HARD.contains(&stress));
    is_hard && label.condition.is_some_and(|condition| condition.is_shaken() == moving)
}

pub(super) fn table(text: &mut String, results: &[SequenceResult]) {
    put(text, "### In short\n");
    put(text, "Mean absolute error, the largest in brackets, and how many sequences had no answer.\n");
    put(
        text,
        &format!("| | sequences | {} |", CANDIDATES.map(|candidate| candidate.to_string()).join(" | ")),
    );
    put(text, "| --- | ---: | ---: | ---: | ---: |");
    for (kind, belongs) in KINDS {
        let number = results.iter().filter(|result| belongs(&result.label)).count();
        if number > 0 {
            let cells = CANDIDATES.map(|candidate| cell(Score::of(results, candidate, belongs)));
            put(text, &format!("| {kind} | {number} | {} |", cells.join(" | ")));
        }
    }
    two_depths(text, results);
    put(text, "");
}

fn cell(score: Score) -> String {
    let Some((mae, worst)) = score.mae.zip(score.worst) else { return String::from("-") };
    let none = if score.none == 0 { String::new() } else { format!(", {} without", score.none) };
    format!("{mae:.1} ({worst:.0}){none}")
}

/// Of two depths both are to be named: the distance of each from the nearer of the two positions said.
fn two_depths(text: &mut String, results: &[SequenceResult]) {
    let results: Vec<&SequenceResult> =
        results.iter().filter(|result| result.label.stress.as_deref() == Some("two depths")).collect();
    if results.is_empty() {
        return;
    }
    let cells = CANDIDATES.map(|candidate| {
        let name = candidate.to_string();
        let (mut errors, mut none) = (Vec::new(), 0);
        for result in &results {
            let answer = result.answers.iter().find(|answer| answer.method == name);
            let said: Vec<f64> = answer
                .into_iter()
                .flat_map(|answer| [answer.position, answer.second_depth])
                .flatten()
                .collect();
            none += usize::from(said.is_empty() && answer.is_some());
            errors.extend(result.truths.iter().filter(|_| !said.is_empty()).map(|truth| {
                said.iter().map(|position| (position - truth).abs()).fold(f64::INFINITY, f64::min)
            }));
        }
        let number = errors.len().max(1) as f64;
        cell(Score {
            mae: (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / number),
            rmse: None,
            worst: errors.iter().copied().reduce(f64::max),
            answers: errors.len(),
            none,
        })
    });
    put(text, &format!("| two depths, each of them | {} | {} |", results.len(), cells.join(" | ")));
}

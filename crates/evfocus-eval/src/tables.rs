//! Errors in the layout of the paper's Tables 1 and 2, by stress, and how far the error bars can be trusted; as Markdown.

mod reliability;
mod summary;

use evfocus_core::Method;
use serde::Serialize;

use crate::dataset::{Condition, Dataset};
use crate::result::{Score, SequenceResult};
use crate::{Candidate, Operator};

/// The paper's Tables 1 and 2: mean absolute and root mean square errors on its data set, EAD, lens units.
const PAPER: &str = include_str!("../data/paper-tables.tsv");

/// What is compared by stress.
const BY_STRESS: [Candidate; 4] = [
    Candidate::Search(Method::Egs),
    Candidate::Search(Method::MirrorPairs),
    Candidate::Search(Method::Structure),
    Candidate::Search(Method::Auto),
];

/// All tables of `results`, which are those of `dataset`.
pub fn markdown(dataset: &Dataset, results: &[SequenceResult]) -> String {
    let mut text = String::new();
    let unit = dataset.entries.first().map_or("lens counts", |entry| entry.label.unit.title());
    let number = results.len();
    put(
        &mut text,
        &format!("## {}\n\n{number} sequences: {}. Errors in {unit}.\n", dataset.name, dataset.about),
    );
    let plain: Vec<SequenceResult> =
        results.iter().filter(|result| result.label.stress.is_none()).cloned().collect();
    if !plain.is_empty() {
        let searches = || Candidate::searches().into_iter();
        let on_events = Operator::ALL.into_iter().map(Candidate::OnEvents).chain(searches());
        let on_frames = Operator::ALL.into_iter().map(Candidate::OnFrames).chain(searches());
        paper_table(&mut text, '1', "pictures made from events", &plain, on_events);
        paper_table(&mut text, '2', "frames", &plain, on_frames);
    }
    summary::table(&mut text, results);
    stress_table(&mut text, results);
    reliability::table(&mut text, results);
    text
}

/// A cell of the tables: the errors of a method in one condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedScore {
    /// The candidate's name.
    pub method: String,
    /// The condition; `None` for all together.
    pub condition: Option<Condition>,
    /// Its errors.
    #[serde(flatten)]
    pub score: Score,
}

/// The tables of the sequences without stress, cell by cell.
pub fn scores(results: &[SequenceResult]) -> Vec<NamedScore> {
    let plain: Vec<SequenceResult> =
        results.iter().filter(|result| result.label.stress.is_none()).cloned().collect();
    let conditions: Vec<Option<Condition>> = Condition::ALL.into_iter().map(Some).chain([None]).collect();
    let mut scores = Vec::new();
    for candidate in Candidate::all() {
        for &condition in &conditions {
            let score = Score::in_condition(&plain, candidate, condition);
            if score.answers + score.none > 0 {
                scores.push(NamedScore { method: candidate.to_string(), condition, score });
            }
        }
    }
    scores
}

fn put(text: &mut String, line: &str) {
    text.push_str(line);
    text.push('\n');
}

fn paper_table(
    text: &mut String,
    number: char,
    on: &str,
    results: &[SequenceResult],
    candidates: impl Iterator<Item = Candidate>,
) {
    put(text, &format!("### Table {number}: focus operators on {on}, and methods on events as they are\n"));
    put(text, "In brackets the paper's figure for its own data set, EAD.\n");
    let titles: Vec<&str> = Condition::ALL.into_iter().map(Condition::title).collect();
    put(text, &format!("| method | error | {} | total | without answer |", titles.join(" | ")));
    put(text, "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    let columns: Vec<Option<Condition>> = Condition::ALL.into_iter().map(Some).chain([None]).collect();
    for candidate in candidates {
        let scores: Vec<Score> =
            columns.iter().map(|&condition| Score::in_condition(results, candidate, condition)).collect();
        if scores.iter().all(|score| score.answers + score.none == 0) {
            continue;
        }
        for kind in ["MAE", "RMSE"] {
            let mut cells = vec![candidate.to_string(), kind.to_owned()];
            for (index, score) in scores.iter().enumerate() {
                let error = if kind == "MAE" { score.mae } else { score.rmse };
                let ours = error.map_or_else(|| String::from("-"), |error| format!("{error:.1}"));
                let theirs = paper_figure(number, candidate, kind, index)
                    .map_or_else(String::new, |error| format!(" ({error})"));
                cells.push(format!("{ours}{theirs}"));
            }
            cells.push(scores.last().map_or(0, |score| score.none).to_string());
            put(text, &format!("| {} |", cells.join(" | ")));
        }
    }
    put(text, "");
}

/// The figure of the paper's table `number`, in the column of that index.
fn paper_figure(number: char, candidate: Candidate, kind: &str, column: usize) -> Option<&'static str> {
    let name = candidate.name_in_paper()?;
    let rows = PAPER.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let mut rows = rows.filter(|row| row.first() == Some(&if number == '1' { "1" } else { "2" }));
    let row = rows.find(|row| row.get(1) == Some(&name) && row.get(2) == Some(&kind))?;
    row.get(3 + column).copied()
}

fn stress_table(text: &mut String, results: &[SequenceResult]) {
    let mut stresses: Vec<&str> = Vec::new();
    for stress in results.iter().filter_map(|result| result.label.stress.as_deref()) {
        if !stresses.contains(&stress) {
            stresses.push(stress);
        }
    }
    if stresses.is_empty() {
        return;
    }
    put(text, "### What makes it hard\n");
    put(
        text,
        "Mean absolute error, the largest in brackets; \"refused\" counts the sequences without an answer, whose reason is named.\n",
    );
    let names: Vec<String> = BY_STRESS.iter().map(|candidate| format!("{candidate} | refused")).collect();
    put(text, &format!("| stress | {} | flags of auto |", names.join(" | ")));
    put(text, &format!("| --- |{} --- |", " ---: | ---: |".repeat(BY_STRESS.len())));
    for stress in stresses {
        let mut cells = vec![stress.to_owned()];
        for candidate in BY_STRESS {
            let score = Score::of(results, candidate, |label| label.stress.as_deref() == Some(stress));
            let errors = score.mae.zip(score.worst);
            let errors =
                errors.map_or_else(|| String::from("-"), |(mae, worst)| format!("{mae:.1} ({worst:.0})"));
            cells.extend([errors, score.none.to_string()]);
        }
        cells.push(flags_in(results, stress));
        put(text, &format!("| {} |", cells.join(" | ")));
    }
    put(text, "");
}

/// What `auto` found odd under `stress`, flags and reasons, each once.
fn flags_in(results: &[SequenceResult], stress: &str) -> String {
    let mut found: Vec<&str> = Vec::new();
    let auto = Candidate::Search(Method::Auto).to_string();
    let concerned = results.iter().filter(|result| result.label.stress.as_deref() == Some(stress));
    for answer in concerned.flat_map(|result| &result.answers).filter(|answer| answer.method == auto) {
        for flag in answer.flags.iter().chain(&answer.why) {
            if !found.contains(&flag.as_str()) {
                found.push(flag);
            }
        }
    }
    found.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_the_paper_are_found() {
        let egs = Candidate::Search(Method::Egs);
        assert_eq!(paper_figure('1', egs, "MAE", 4), Some("56.3"));
        assert_eq!(paper_figure('2', Candidate::OnFrames(Operator::Acmo), "RMSE", 1), Some("1517.5"));
        assert_eq!(paper_figure('1', Candidate::Search(Method::Auto), "MAE", 0), None);
    }
}

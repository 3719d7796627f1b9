//! What every candidate said of a sequence, and how wrong it was.

use serde::{Deserialize, Serialize};

use crate::Candidate;
use crate::dataset::{Condition, Label};

/// What one candidate said of one sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Answer {
    /// The candidate's name.
    pub method: String,
    /// The mean of the answers for each way of the lens, in the unit of the sequence.
    pub position: Option<f64>,
    /// Where another good part of the picture is sharp, if it is.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub second_depth: Option<f64>,
    /// The answer less the truth; the nearest one, if there are several.
    pub error: Option<f64>,
    /// One standard deviation of the position, as the method itself estimates it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub error_bar: Option<f64>,
    /// The probability of being right to within 1 % of the range, as the method itself estimates it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub confidence: Option<f64>,
    /// What is odd about the answer.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub flags: Vec<String>,
    /// Why there is no answer.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub why: Option<String>,
}

impl Answer {
    /// An answer, or why there is none, held against the truths.
    pub fn new(candidate: Candidate, said: Result<f64, String>, truths: &[f64]) -> Self {
        let (position, why) = match said {
            Ok(position) => (Some(position), None),
            Err(why) => (None, Some(why)),
        };
        let errors =
            position.into_iter().flat_map(|position| truths.iter().map(move |truth| position - truth));
        let error = errors.min_by(|a, b| a.abs().total_cmp(&b.abs()));
        let method = candidate.to_string();
        Self {
            method,
            position,
            second_depth: None,
            error,
            error_bar: None,
            confidence: None,
            flags: Vec::new(),
            why,
        }
    }
}

/// The curve of the event rate goes by this name.
pub(crate) const EVENT_RATE: &str = "event rate";
/// That of the energy of fine structure by this one.
pub(crate) const STRUCTURE: &str = "structure";

/// A focus curve.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// The candidate's name; `event rate` for the rate itself, `structure` for the energy of fine structure.
    pub method: String,
    /// Position, and value in the measure's own unit.
    pub points: Vec<(f64, f64)>,
}

/// What was found for one sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SequenceResult {
    /// Which sequence.
    #[serde(flatten)]
    pub label: Label,
    /// Where the scene is sharp.
    pub truths: Vec<f64>,
    /// Length of the range swept.
    pub range: f64,
    /// Number of events.
    pub events: u64,
    /// What each candidate said; frames are missing where there is no frame camera.
    pub answers: Vec<Answer>,
    /// Focus curves of the first way of the lens.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub curves: Vec<Curve>,
    /// Distance of the golden search's range from the truth after each step; the first way of the lens.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub search_errors: Vec<f64>,
}

/// Errors of one candidate over several sequences.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Score {
    /// Mean absolute error of the answers; `None` without any.
    pub mae: Option<f64>,
    /// Root mean square error of the answers.
    pub rmse: Option<f64>,
    /// Largest absolute error.
    pub worst: Option<f64>,
    /// Number of answers.
    pub answers: usize,
    /// Sequences without an answer.
    pub none: usize,
}

impl Score {
    /// The errors of `candidate` over those of `results` that `belongs` chooses.
    pub fn of(results: &[SequenceResult], candidate: Candidate, belongs: impl Fn(&Label) -> bool) -> Self {
        let method = candidate.to_string();
        let chosen = results.iter().filter(|result| belongs(&result.label));
        let answers: Vec<&Answer> = chosen
            .flat_map(|result| result.answers.iter().filter(|answer| answer.method == method))
            .collect();
        let errors: Vec<f64> = answers.iter().filter_map(|answer| answer.error).collect();
        let mean = |of: fn(&f64) -> f64| {
            (!errors.is_empty()).then(|| errors.iter().map(of).sum::<f64>() / errors.len() as f64)
        };
        Self {
            mae: mean(|error| error.abs()),
            rmse: mean(|error| error * error).map(f64::sqrt),
            worst: errors.iter().map(|error| error.abs()).reduce(f64::max),
            answers: errors.len(),
            none: answers.len() - errors.len(),
        }
    }

    /// The same for one condition, or for all of them together.
    pub fn in_condition(
        results: &[SequenceResult],
        candidate: Candidate,
        condition: Option<Condition>,
    ) -> Self {
        Self::of(results, candidate, |label| condition.is_none() || label.condition == condition)
    }
}

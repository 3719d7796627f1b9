//! How often the truth lies within the error bar, and how often an answer is as right as it says.

use evfocus_core::Method;

use super::put;
use crate::Candidate;
use crate::result::{Answer, SequenceResult};

/// An answer this near to the truth is right, as a share of the range swept.
const RIGHT: f64 = 0.01;

/// An answer of `auto` that has an error, with what is right for it.
struct Claim<'a> {
    answer: &'a Answer,
    error: f64,
    tolerance: f64,
}

pub(super) fn table(text: &mut String, results: &[SequenceResult]) {
    let auto = Candidate::Search(Method::Auto).to_string();
    let mut claims = Vec::new();
    for result in results {
        for answer in result.answers.iter().filter(|answer| answer.method == auto) {
            if let Some(error) = answer.error {
                claims.push(Claim { answer, error: error.abs(), tolerance: RIGHT * result.range });
            }
        }
    }
    if claims.is_empty() {
        return;
    }
    put(text, "### How sure `auto` may be of itself\n");
    put(text, "| the truth lies within | of the answers | a normal distribution would have |");
    put(text, "| --- | ---: | ---: |");
    for (bars, normal) in [(1.0, "68 %"), (2.0, "95 %"), (3.0, "99.7 %")] {
        let within = |claim: &&Claim<'_>| claim.answer.error_bar.is_some_and(|bar| claim.error <= bars * bar);
        let share = share(claims.iter().filter(within).count(), claims.len());
        put(text, &format!("| {bars:.0} error bars | {share} | {normal} |"));
    }
    put(text, "\n| claimed confidence | answers | right to within 1 % of the range |");
    put(text, "| --- | ---: | ---: |");
    for (low, high) in [(0.9, 1.01), (0.7, 0.9), (0.5, 0.7), (0.0, 0.5)] {
        let chosen = claims.iter().filter(|claim| {
            claim.answer.confidence.is_some_and(|confidence| (low..high).contains(&confidence))
        });
        let chosen: Vec<_> = chosen.collect();
        let right = chosen.iter().filter(|claim| claim.error <= claim.tolerance).count();
        let share = share(right, chosen.len());
        put(text, &format!("| {low} to {:.1} | {} | {share} |", f64::min(high, 1.0), chosen.len()));
    }
    put(text, "");
}

fn share(part: usize, whole: usize) -> String {
    if whole == 0 { String::from("-") } else { format!("{:.0} %", 100.0 * part as f64 / whole as f64) }
}

//! One answer from the sweeps of a recording, by the rules of the controller.

use evfocus_core::{
    Answer, Failure, FocusMap, LensPosition, LensRange, Method, Prefer, Rules, SweepLimits, Window, answer,
    focus_map,
};

use super::SweepAnalysis;

/// The answer of all sweeps together.
#[derive(Debug)]
pub(crate) struct Verdict {
    pub(crate) outcome: Result<Answer, Failure>,
    /// What each window says of all sweeps together, as if it had been the one preferred.
    pub(crate) windows: Vec<(Window, Result<Answer, Failure>)>,
    /// Where each tile of the picture is sharp by all sweeps together.
    pub(crate) map: Option<FocusMap>,
    /// Half the difference of the two directions' answers as a time: lag plus backlash.
    pub(crate) delay_us: Option<f64>,
    /// Camera time at which the first sweep passed the answer.
    pub(crate) t_us: Option<f64>,
}

impl Verdict {
    /// What the sweeps say, two successive ones in opposite directions together.
    pub(super) fn of(sweeps: &[SweepAnalysis], method: Method, prefer: Prefer) -> Self {
        let outcome = answer_of_all(sweeps, method, prefer);
        let (found, first) = (outcome.as_ref().ok(), sweeps.first());
        let of_window =
            |(&(window, _), index)| (window, answer_of_all(sweeps, method, Prefer::Window(index)));
        Self {
            delay_us: found.zip(first).and_then(|(found, first)| {
                Some(found.half_difference? / first.speed.counts_per_second() * 1e6)
            }),
            t_us: found.zip(first).map(|(found, first)| first.passed(found.position, method)),
            windows: first
                .iter()
                .flat_map(|first| first.report.windows.iter().flatten().zip(0..))
                .map(of_window)
                .collect(),
            map: extent(sweeps).and_then(|range| {
                let measured = found.and_then(|found| Some(found.measured?.1));
                focus_map(sweeps.iter().map(|sweep| &sweep.report), measured, &Rules::for_range(range))
            }),
            outcome,
        }
    }
}

fn answer_of_all(sweeps: &[SweepAnalysis], method: Method, prefer: Prefer) -> Result<Answer, Failure> {
    let nothing = Failure::TooFewEvents { events: 0, needed: SweepLimits::default().fewest_events };
    for sweep in sweeps {
        if let Err(failure) = sweep.verdict
            && failure.is_final(sweeps.len())
        {
            return Err(failure);
        }
    }
    let rules = Rules { prefer, ..Rules::for_range(extent(sweeps).ok_or(nothing)?) };
    let answers: Vec<Answer> = sweeps
        .chunks(2)
        .map(|pair| match pair {
            [there, back] if there.direction != back.direction => {
                answer(&there.report, Some(&back.report), method, &rules)
            }
            [first, ..] => answer(&first.report, None, method, &rules),
            [] => Err(nothing),
        })
        .collect::<Result<_, _>>()?;
    let mean = answers.iter().map(|answer| answer.position.0).sum::<f64>() / answers.len() as f64;
    // Several pairs of sweeps are together no surer than the least sure of them: what they err by alike does not average out.
    let error_bar = |answer: &Answer| answer.error_bar.unwrap_or(f64::INFINITY);
    let least_sure = answers.iter().max_by(|a, b| error_bar(a).total_cmp(&error_bar(b))).ok_or(nothing)?;
    Ok(Answer { position: LensPosition(mean), ..*least_sure })
}

/// The positions swept.
fn extent(sweeps: &[SweepAnalysis]) -> Option<LensRange> {
    let ends = || sweeps.iter().flat_map(|sweep| [sweep.report.from.0, sweep.report.to.0]);
    let low = ends().fold(f64::INFINITY, f64::min);
    let high = ends().fold(f64::NEG_INFINITY, f64::max);
    LensRange::new(LensPosition(low), LensPosition(high)).ok()
}

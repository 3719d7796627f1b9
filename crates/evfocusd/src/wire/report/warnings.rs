//! What was odd about a run, in words.

use evfocus_core::{Answer, Flag, RunReport};

/// What was odd about `run` and did not make it fail, one sentence each.
pub(super) fn of(run: &RunReport) -> Vec<String> {
    let mut warnings = Vec::new();
    for leg in run.sweeps() {
        let way = format!("sweep from {} to {}", leg.from, leg.to);
        if leg.quality.has_flicker() {
            warnings.push(format!(
                "{way}: the light flickers at {} Hz, depth {:.2}",
                leg.quality.flicker_hz, leg.quality.flicker_depth
            ));
        }
        if leg.lost > 0 {
            warnings.push(format!("{way}: {} events were lost, {} arrived", leg.lost, leg.on + leg.off));
        }
        if leg.not_kept > 0 {
            warnings.push(format!(
                "{way}: {} events were counted but not kept; raise focus.events_kept",
                leg.not_kept
            ));
        }
    }
    if let Some(answer) = &run.answer {
        warnings.extend(answer.flags.iter().filter_map(|flag| in_words(flag, answer)));
    }
    if run.hot_pixels > 0 {
        warnings.push(format!("{} hot pixels were left out", run.hot_pixels));
    }
    warnings
}

/// What `flag` of `answer` means, and what to do about it; nothing for what the sweeps tell with more numbers.
fn in_words(flag: Flag, answer: &Answer) -> Option<String> {
    let words = match flag {
        Flag::Flicker | Flag::EventsLost => return None,
        Flag::TwoDepths => {
            let place = answer.second_depth.map(|second| format!(" at {second}")).unwrap_or_default();
            return Some(format!(
                "a good part of the picture is sharp elsewhere{place}: use a window, or prefer the nearest"
            ));
        }
        Flag::Saturated => "the event rate was capped by the read-out or the link: sweep slower",
        Flag::Weak => "the peak is hardly higher than chance makes one: give light or texture",
        Flag::Unsure => "readings of the same events differ: keep the scene still, or use a window",
        Flag::Edge => "the peak is cut off by an end of the sweep: widen the range",
        Flag::Flat => {
            "the peak is very wide, or the event rate hardly depends on the lens: give light or texture"
        }
        Flag::Coarse => "the fine structure was too weak, so the answer is from coarser structure",
    };
    Some(words.to_owned())
}

//! One answer from one sweep or two, how sure it is, and whether to believe it.

mod both_ways;
mod chosen;
mod parts;

use crate::delay::{Delay, DelayModel};
use crate::flags::{Flag, Flags};
use crate::report::{Failure, LegReport, Suspicion};
use crate::search::{Method, SearchError};
use crate::units::{LensPosition, LensRange};

pub use parts::{FocusMap, TileFocus, focus_map, window_answers};

use both_ways::by_structure_both_ways;
use chosen::{Chosen, leg_flags};

/// Which of several answers counts: of the windows of a request, or of two depths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Prefer {
    /// The one with the highest peak.
    #[default]
    Strongest,
    /// The one whose subject is nearest.
    Nearest,
    /// That of the window of this number, from 0; of two depths the stronger.
    Window(u8),
}

/// No preference has this name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it must be \"strongest\", \"nearest\" or the number of a window, counted from 0")]
pub struct UnknownPreference;

impl core::str::FromStr for Prefer {
    type Err = UnknownPreference;

    fn from_str(name: &str) -> Result<Self, UnknownPreference> {
        match name.trim() {
            "strongest" => Ok(Self::Strongest),
            "nearest" => Ok(Self::Nearest),
            number => number.parse().map(Self::Window).map_err(|_| UnknownPreference),
        }
    }
}

impl core::fmt::Display for Prefer {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Strongest => f.write_str("strongest"),
            Self::Nearest => f.write_str("nearest"),
            Self::Window(number) => write!(f, "{number}"),
        }
    }
}

/// By what answers are judged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// The positions swept.
    pub range: LensRange,
    /// An answer this near to the truth is right, counts: the depth of focus, or 1 % of the range if that is more.
    pub tolerance: f64,
    /// An answer this near to an end of the range, as a share of it, is taken for focus beyond.
    pub edge_share: f64,
    /// The largest half-difference of the two directions, as a share of the range, for methods that know no better.
    pub largest_mismatch_share: f64,
    /// How late the pixels are.
    pub delays: DelayModel,
    /// Known play between what the lens reports and the glass, counts: the way back reads so much less.
    pub backlash: f64,
    /// Which answer counts.
    pub prefer: Prefer,
    /// Whether nearer subjects are sharp at higher positions.
    pub nearest_is_high: bool,
}

impl Rules {
    /// The share of the range within which an answer is right, whatever the depth of focus.
    pub const TOLERANCE_SHARE: f64 = 0.01;

    /// Rules for sweeps of `range` with everything else at its documented default.
    pub fn for_range(range: LensRange) -> Self {
        Self {
            range,
            tolerance: Self::TOLERANCE_SHARE * range.length(),
            edge_share: 0.02,
            largest_mismatch_share: 0.15,
            delays: DelayModel::default(),
            backlash: 0.0,
            prefer: Prefer::Strongest,
            nearest_is_high: true,
        }
    }
}

/// What a run or a recording says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Best focus.
    pub position: LensPosition,
    /// One standard deviation, counts; `None` if nothing is known of it.
    pub error_bar: Option<f64>,
    /// The probability that the position is right to within [`Rules::tolerance`].
    pub confidence: Option<f64>,
    /// The estimator that decided.
    pub decided_by: Method,
    /// What is odd.
    pub flags: Flags,
    /// The other depth, if a good part of the picture is sharp elsewhere.
    pub second_depth: Option<LensPosition>,
    /// The window that won, from 0.
    pub window: Option<u8>,
    /// Half of forward less backward, counts, known backlash taken off: the lag, and what backlash is not known.
    pub half_difference: Option<f64>,
    /// Full width of the peak at half its height, counts.
    pub width: Option<f64>,
    /// The delay that two sweeps measured, with the noise at which they did.
    pub measured: Option<(f64, Delay)>,
}

impl Answer {
    fn bare(position: LensPosition, decided_by: Method, flags: Flags) -> Self {
        Self {
            position,
            error_bar: None,
            confidence: None,
            decided_by,
            flags,
            second_depth: None,
            window: None,
            half_difference: None,
            width: None,
            measured: None,
        }
    }

    fn sure_to(self, error_bar: f64, rules: &Rules) -> Self {
        Self {
            error_bar: Some(error_bar),
            confidence: Some(confidence(error_bar, self.flags, rules.tolerance)),
            ..self
        }
    }
}

/// What one sweep, or two in opposite directions, say by `method`.
///
/// # Errors
/// The [`Failure`] that makes the answer unfit to be believed.
pub fn answer(
    first: &LegReport,
    second: Option<&LegReport>,
    method: Method,
    rules: &Rules,
) -> Result<Answer, Failure> {
    let found = match (method, second) {
        (Method::Structure | Method::Auto, None) => by_structure_one_way(first, rules)?,
        (Method::Structure | Method::Auto, Some(second)) => by_structure_both_ways(first, second, rules)?,
        (
            Method::Egs | Method::EgsOfficial | Method::ErFixed | Method::ErSquared | Method::MirrorPairs,
            _,
        ) => by_other(first, second, method, rules)?,
    };
    if is_at_edge(found.position, rules.range, rules.edge_share) {
        return Err(Failure::PeakAtEdge { position: found.position });
    }
    Ok(found)
}

/// Whether `answer` is so near to an end of `range`, as a share of it, that focus is taken to lie beyond.
pub fn is_at_edge(answer: LensPosition, range: LensRange, edge_share: f64) -> bool {
    let to_edge = answer.distance(range.min()).min(answer.distance(range.max()));
    !range.contains(answer) || to_edge < edge_share * range.length()
}

fn by_structure_one_way(leg: &LegReport, rules: &Rules) -> Result<Answer, Failure> {
    Ok(by_structure(&Chosen::of(leg, rules)?.alone(rules)?, rules))
}

fn by_structure(chosen: &Chosen, rules: &Rules) -> Answer {
    let Chosen { structure, position, second_depth, window, flags } = *chosen;
    let late = libm::fabs(structure.velocity) * chosen.delay(rules).uncertainty_s;
    Answer {
        second_depth: second_depth.map(|second| chosen.without_delay(second, rules)),
        window,
        width: Some(structure.width),
        ..Answer::bare(chosen.without_delay(position, rules), Method::Structure, flags)
    }
    .sure_to(libm::hypot(structure.scatter, late), rules)
}

fn by_other(
    first: &LegReport,
    second: Option<&LegReport>,
    method: Method,
    rules: &Rules,
) -> Result<Answer, Failure> {
    let position_of = |leg: &LegReport| match leg.estimate(method) {
        Some(Ok(estimate)) => Ok(estimate.position),
        Some(Err(error)) => Err(Failure::of_search(error)),
        None => Err(Failure::NoAnswer(SearchError::NoLength { at_us: leg.start.0 })),
    };
    let forward = position_of(first)?;
    let flags = second.map_or_else(|| leg_flags(first), |second| leg_flags(first).or(leg_flags(second)));
    let mut found = Answer::bare(forward, method, flags);
    if let Some(second) = second {
        let backward = position_of(second)?;
        let half_difference = forward.counts_from(backward) / 2.0;
        if libm::fabs(half_difference) > rules.largest_mismatch_share * rules.range.length() {
            return Err(Failure::DirectionMismatch {
                forward,
                backward,
                suspicion: Suspicion::DifferentPeaks,
            });
        }
        found.position = LensPosition(f64::midpoint(forward.0, backward.0));
        found.half_difference = Some(half_difference);
    }
    // These methods do not know how far off they are; where `structure` has an answer, the difference to it tells.
    let structure = match second {
        None => by_structure_one_way(first, rules),
        Some(second) => by_structure_both_ways(first, second, rules),
    };
    Ok(match structure {
        Ok(Answer { position, error_bar: Some(error_bar), .. }) => {
            found.sure_to(libm::hypot(error_bar, position.distance(found.position)), rules)
        }
        Ok(_) | Err(_) => found,
    })
}

/// More are as good as certainty, and their square is still a number.
const MOST_DEVIATIONS: f64 = 1e6;

/// The probability that an error stays within `tolerance`: Student's t with four degrees of freedom, whose tails are heavier than the
/// normal distribution's as those of the errors are; and less where something is odd.
fn confidence(error_bar: f64, flags: Flags, tolerance: f64) -> f64 {
    // Written so that an error bar that is no number is as good as none.
    let t = if error_bar >= 0.0 { tolerance / error_bar.max(f64::MIN_POSITIVE) } else { 0.0 };
    let t = t.min(MOST_DEVIATIONS);
    let u = t * t / (4.0 + t * t);
    let within = libm::sqrt(u) * (1.5 - 0.5 * u);
    let doubts = [
        (Flag::Saturated, 0.0),
        (Flag::TwoDepths, 0.6),
        (Flag::Edge, 0.8),
        (Flag::Flat, 0.8),
        (Flag::Flicker, 0.9),
        (Flag::Coarse, 0.85),
        (Flag::Weak, 0.85),
        (Flag::Unsure, 0.85),
    ];
    doubts.iter().filter(|(flag, _)| flags.contains(*flag)).fold(within, |within, (_, doubt)| within * doubt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::search::{Bookings, StructureAnswer, TileAnswer};

    /// What a good sweep says.
    pub(super) fn structure_answer(position: f64, scatter: f64, velocity: f64) -> StructureAnswer {
        StructureAnswer {
            position: LensPosition(position),
            width: 400.0,
            significance: 60.0,
            scatter,
            noise_hz: 0.0,
            velocity,
            rival: None,
            is_coarse: false,
            is_unsure: false,
            is_at_edge: false,
            is_flat: false,
            tiles: [TileAnswer::default(); Bookings::TILES],
            passes: 1,
            t_us: 0.0,
            interval_us: 0.0,
        }
    }

    pub(super) fn leg(structure: &StructureAnswer) -> LegReport {
        LegReport { structure: Some(Ok(*structure)), ..LegReport::empty() }
    }

    pub(super) fn rules() -> Rules {
        Rules::for_range(LensRange::new(LensPosition(0.0), LensPosition(3500.0)).unwrap())
    }

    fn both(there: &StructureAnswer, back: &StructureAnswer) -> Result<Answer, Failure> {
        answer(&leg(there), Some(&leg(back)), Method::Auto, &rules())
    }

    #[test]
    fn two_weak_ways_that_agree_are_believed_and_one_is_not() {
        let (there, back) = (structure_answer(1006.0, 9.0, 1000.0), structure_answer(994.0, 9.0, -1000.0));
        let weak = |answer, significance| StructureAnswer { significance, ..answer };
        let agreed = both(&weak(there, 9.0), &weak(back, 9.0)).unwrap();
        assert!((agreed.position.0 - 1000.0).abs() < 1.0 && agreed.flags.contains(Flag::Weak), "{agreed:?}");
        let alone = answer(&leg(&weak(there, 9.0)), None, Method::Auto, &rules());
        assert!(matches!(alone, Err(Failure::Weak { .. })), "{alone:?}");
        let elsewhere = structure_answer(2500.0, 9.0, -1000.0);
        let apart = both(&weak(there, 9.0), &elsewhere);
        assert!(matches!(apart, Err(Failure::DirectionMismatch { .. })), "{apart:?}");
        let too_faint = both(&weak(there, 9.0), &weak(back, 5.0));
        assert!(matches!(too_faint, Err(Failure::Weak { .. })), "{too_faint:?}");
    }

    #[test]
    fn a_fairly_high_peak_is_believed_if_its_readings_agree() {
        let fair =
            |scatter| StructureAnswer { significance: 11.0, ..structure_answer(1006.0, scatter, 1000.0) };
        let believed = answer(&leg(&fair(12.0)), None, Method::Auto, &rules()).unwrap();
        assert!(believed.flags.contains(Flag::Weak), "{believed:?}");
        let refused = answer(&leg(&fair(60.0)), None, Method::Auto, &rules());
        assert!(matches!(refused, Err(Failure::Weak { .. })), "{refused:?}");
    }

    #[test]
    fn a_way_that_says_nothing_leaves_the_other() {
        let (there, back) = (structure_answer(1006.0, 9.0, 1000.0), structure_answer(994.0, 9.0, -1000.0));
        let unsure = |answer| StructureAnswer { is_unsure: true, ..answer };
        let far = |answer: StructureAnswer| StructureAnswer { position: LensPosition(3000.0), ..answer };
        for (there, back) in [(there, far(unsure(back))), (far(unsure(there)), back)] {
            let found = both(&there, &back).unwrap();
            assert!((found.position.0 - 1000.0).abs() < 1.0, "{found:?}");
            assert!(found.flags.contains(Flag::Unsure), "{found:?}");
        }
    }

    #[test]
    fn a_peak_within_and_one_at_the_edge_contradict_each_other() {
        let (there, edge) = (structure_answer(1006.0, 9.0, 1000.0), structure_answer(5.0, 9.0, -1000.0));
        for (first, second) in [(there, edge), (edge, there)] {
            let Err(Failure::DirectionMismatch { forward, backward, .. }) = both(&first, &second) else {
                panic!("{:?}", both(&first, &second))
            };
            assert!((forward.0 < 10.0) == (first == edge) && (backward.0 < 10.0) == (second == edge));
        }
        let twice = both(&edge, &edge);
        assert!(matches!(twice, Err(Failure::PeakAtEdge { .. })), "{twice:?}");
    }

    #[test]
    fn what_is_highest_at_an_end_is_no_peak() {
        let at_end = answer(&leg(&structure_answer(3490.0, 9.0, 20_000.0)), None, Method::Auto, &rules());
        assert!(matches!(at_end, Err(Failure::PeakAtEdge { .. })), "{at_end:?}");
    }
}

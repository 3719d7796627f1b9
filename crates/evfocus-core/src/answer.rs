//! One answer from one sweep or two, how sure it is, and whether to believe it.

use crate::delay::{Delay, DelayModel};
use crate::flags::{Flag, Flags};
use crate::report::{Failure, LegReport, Suspicion};
use crate::search::{Method, SearchError, StructureAnswer};
use crate::units::{LensPosition, LensRange};

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
    /// Half of forward less backward, counts: lag plus backlash, if both mean the same peak.
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
        (Method::Structure | Method::Auto, None) => by_structure(&Chosen::of(first, rules)?, rules),
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

/// The answer of a sweep that counts, and which one that is.
#[derive(Debug, Clone, Copy)]
struct Chosen {
    structure: StructureAnswer,
    position: LensPosition,
    second_depth: Option<LensPosition>,
    window: Option<u8>,
    flags: Flags,
}

impl Chosen {
    fn of(leg: &LegReport, rules: &Rules) -> Result<Self, Failure> {
        let (structure, window) = choose(leg, rules)?;
        let (mut position, mut second_depth) = (structure.position, structure.rival);
        if let (Some(rival), Prefer::Nearest) = (structure.rival, rules.prefer)
            && is_nearer(rival, position, rules)
        {
            second_depth = Some(core::mem::replace(&mut position, rival));
        }
        let mut flags = leg_flags(leg);
        flags.set(Flag::TwoDepths, structure.rival.is_some());
        flags.set(Flag::Edge, structure.is_at_edge);
        flags.set(Flag::Flat, structure.is_flat);
        flags.set(Flag::Coarse, structure.is_coarse);
        let chosen = Self { structure, position, second_depth, window, flags };
        if structure.is_unsure {
            return Err(Failure::Unsure {
                position: chosen.without_delay(chosen.position, rules),
                error_bar: structure.scatter,
            });
        }
        Ok(chosen)
    }

    fn delay(&self, rules: &Rules) -> Delay {
        rules.delays.at(self.structure.noise_hz)
    }

    fn without_delay(&self, position: LensPosition, rules: &Rules) -> LensPosition {
        LensPosition(position.0 - self.structure.velocity * self.delay(rules).seconds)
    }
}

fn is_nearer(one: LensPosition, other: LensPosition, rules: &Rules) -> bool {
    (one > other) == rules.nearest_is_high
}

/// The answer of the whole picture, or that of the preferred window if there are windows.
fn choose(leg: &LegReport, rules: &Rules) -> Result<(StructureAnswer, Option<u8>), Failure> {
    let not_asked = Failure::NoAnswer(SearchError::NoLength { at_us: leg.start.0 });
    if leg.windows.first().is_none_or(Option::is_none) {
        return Ok((leg.structure.ok_or(not_asked)?.map_err(Failure::of_search)?, None));
    }
    let mut best: Option<(StructureAnswer, u8)> = None;
    let mut first_error = not_asked;
    for (index, (_, said)) in leg.windows.iter().flatten().enumerate() {
        match (said, rules.prefer) {
            (_, Prefer::Window(wanted)) if usize::from(wanted) != index => {}
            (Err(error), _) => first_error = Failure::of_search(*error),
            (Ok(said), prefer) => {
                let wins = best.is_none_or(|(best, _)| match prefer {
                    Prefer::Nearest => is_nearer(said.position, best.position, rules),
                    Prefer::Strongest | Prefer::Window(_) => said.significance > best.significance,
                });
                if wins {
                    best = Some((*said, index as u8));
                }
            }
        }
    }
    best.map(|(answer, window)| (answer, Some(window))).ok_or(first_error)
}

fn leg_flags(leg: &LegReport) -> Flags {
    let mut flags = Flags::default();
    flags.set(Flag::Saturated, leg.quality.is_saturated());
    flags.set(Flag::Flat, leg.quality.is_flat());
    flags.set(Flag::Flicker, leg.quality.has_flicker());
    flags.set(Flag::EventsLost, leg.lost > 0);
    flags
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

fn by_structure_both_ways(first: &LegReport, second: &LegReport, rules: &Rules) -> Result<Answer, Failure> {
    let there = Chosen::of(first, rules)?;
    // The way back is asked for the same thing.
    let same = Rules { prefer: there.window.map_or(rules.prefer, Prefer::Window), ..*rules };
    let mut back = Chosen::of(second, &same)?;
    // Which of two depths is the stronger may differ from one way to the other.
    if let Some(other) = back.second_depth
        && other.distance(there.position) < back.position.distance(there.position)
    {
        back.second_depth = Some(core::mem::replace(&mut back.position, other));
    }
    let speed = f64::midpoint(libm::fabs(there.structure.velocity), libm::fabs(back.structure.velocity));
    let towards = if there.structure.velocity < 0.0 { -1.0 } else { 1.0 };
    let noise_hz = f64::midpoint(there.structure.noise_hz, back.structure.noise_hz);
    let expected = rules.delays.at(noise_hz);
    let half_difference = there.position.counts_from(back.position) / 2.0;
    let scatter = libm::hypot(there.structure.scatter, back.structure.scatter) / 2.0;
    let excess = half_difference * towards - speed * expected.seconds;
    let uncertainty = libm::hypot(scatter, speed * expected.uncertainty_s);
    // Where the answers themselves agree, a delay other than expected is no fault: the expectation was wrong.
    let agree = libm::fabs(half_difference) <= rules.tolerance / 2.0;
    if !agree && libm::fabs(excess) > (3.0 * uncertainty).max(rules.tolerance / 2.0) {
        return Err(Failure::DirectionMismatch {
            forward: there.position,
            backward: back.position,
            suspicion: suspicion(excess, there.structure.width),
        });
    }
    // What exceeds chance may be backlash, half of which stays in the mean.
    let beyond = (excess * excess - uncertainty * uncertainty).max(0.0) / 4.0;
    let mean = |one: LensPosition, other: LensPosition| LensPosition(f64::midpoint(one.0, other.0));
    let second_depth = match (there.second_depth, back.second_depth) {
        (Some(one), Some(other)) => Some(mean(one, other)),
        (Some(one), None) => Some(there.without_delay(one, rules)),
        (None, Some(other)) => Some(back.without_delay(other, rules)),
        (None, None) => None,
    };
    let measured = (speed > 0.0).then(|| {
        let delay = Delay { seconds: half_difference * towards / speed, uncertainty_s: scatter / speed };
        (noise_hz, delay)
    });
    let flags = there.flags.or(back.flags);
    let answer = Answer {
        second_depth,
        window: there.window,
        half_difference: Some(half_difference),
        width: Some(there.structure.width),
        measured,
        ..Answer::bare(mean(there.position, back.position), Method::Structure, flags)
    };
    Ok(answer.sure_to(libm::sqrt(scatter * scatter + beyond), rules))
}

fn suspicion(excess: f64, width: f64) -> Suspicion {
    if libm::fabs(excess) > width / 2.0 {
        Suspicion::DifferentPeaks
    } else if excess > 0.0 {
        Suspicion::Backlash
    } else {
        Suspicion::LatePositions
    }
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
        None => Chosen::of(first, rules).map(|chosen| by_structure(&chosen, rules)),
        Some(second) => by_structure_both_ways(first, second, rules),
    };
    Ok(match structure {
        Ok(Answer { position, error_bar: Some(error_bar), .. }) => {
            found.sure_to(libm::hypot(error_bar, position.distance(found.position)), rules)
        }
        Ok(_) | Err(_) => found,
    })
}

/// The probability that an error stays within `tolerance`: Student's t with four degrees of freedom, whose tails are heavier than the
/// normal distribution's as those of the errors are; and less where something is odd.
fn confidence(error_bar: f64, flags: Flags, tolerance: f64) -> f64 {
    if error_bar <= 0.0 {
        return 1.0;
    }
    let t = tolerance / error_bar;
    let u = t * t / (4.0 + t * t);
    let within = libm::sqrt(u) * (1.5 - 0.5 * u);
    let doubts = [
        (Flag::Saturated, 0.0),
        (Flag::TwoDepths, 0.6),
        (Flag::Edge, 0.8),
        (Flag::Flat, 0.8),
        (Flag::Flicker, 0.9),
        (Flag::Coarse, 0.85),
    ];
    doubts.iter().filter(|(flag, _)| flags.contains(*flag)).fold(within, |within, (_, doubt)| within * doubt)
}

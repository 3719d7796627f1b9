//! What a focus run leaves behind.

use core::fmt;
use core::time::Duration;

use crate::answer::{Answer, FocusMap, Prefer, Rules, focus_map, window_answers};
use crate::clock_map::ClockMapQuality;
use crate::curve::FocusCurve;
use crate::event::Window;
use crate::flags::Flag;
use crate::quality::SweepQuality;
use crate::search::{Estimate, MOST_WINDOWS, Method, SearchError, StructureAnswer};
use crate::units::{CameraMicros, EventRate, HostMicros, LensPosition, LensRange, LensSpeed};

/// Number of a run, counted from 1 by the daemon over its lifetime.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct RunId(pub u64);

impl fmt::Display for RunId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

/// Which ways the lens sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Directions {
    /// From the low end to the high end only.
    Forward,
    /// Forward, and back too where that alone is not sure enough.
    BackIfUnsure,
    /// There and back; the answer is the mean of both, each weighted by how sure it is, which cancels the lag.
    Both,
}

/// A focus run, as it is to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FocusPlan {
    /// Measure and search.
    pub method: Method,
    /// Accumulation interval of [`Method::ErFixed`].
    pub interval: Duration,
    /// Positions to sweep.
    pub range: LensRange,
    /// Speed of the sweep.
    pub speed: LensSpeed,
    /// One way or both.
    pub directions: Directions,
    /// Whether a sweep ends once the answer cannot change any more, for methods that can tell.
    pub early_stop: bool,
    /// The windows to focus on; the whole picture if there are none.
    pub windows: Windows,
    /// Which of several answers counts.
    pub prefer: Prefer,
}

/// The windows of a plan: at most [`MOST_WINDOWS`].
pub type Windows = [Option<Window>; MOST_WINDOWS];

/// What a run is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// The lens looks for its reference.
    Homing,
    /// The lens goes to where the sweep begins.
    ToStart,
    /// The lens rests; hot pixels are learnt.
    Resting,
    /// First sweep.
    Sweeping,
    /// Second sweep, the way back.
    Returning,
    /// The counts of a sweep are being completed and searched.
    Searching,
    /// The lens goes to the answer.
    Approaching,
    /// The lens should be at the answer; it is looked whether it is.
    Verifying,
    /// The run failed and the lens goes back to where it was.
    Restoring,
}

impl Phase {
    /// Every phase, in the order of a run.
    pub const ALL: [Self; 9] = [
        Self::Homing,
        Self::ToStart,
        Self::Resting,
        Self::Sweeping,
        Self::Returning,
        Self::Searching,
        Self::Approaching,
        Self::Verifying,
        Self::Restoring,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Homing => "homing",
            Self::ToStart => "to-start",
            Self::Resting => "resting",
            Self::Sweeping => "sweeping",
            Self::Returning => "returning",
            Self::Searching => "searching",
            Self::Approaching => "approaching",
            Self::Verifying => "verifying",
            Self::Restoring => "restoring",
        }
    }
}

/// What a disagreement of the two directions looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Suspicion {
    /// The way back lags behind its reported positions: play between motor and glass.
    Backlash {
        /// About how much, lens counts.
        counts: f64,
    },
    /// Positions are reported later than the lens was there.
    LatePositions,
    /// The two sweeps saw different peaks: the scene changed, or it has no single one.
    DifferentPeaks,
}

impl Suspicion {
    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Backlash { .. } => "backlash",
            Self::LatePositions => "late-positions",
            Self::DifferentPeaks => "different-peaks",
        }
    }
}

/// Why a run ended without focus.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Failure {
    /// The sweep made hardly any events: a lens cap, a blank wall, no light.
    TooFewEvents {
        /// Events counted.
        events: u64,
        /// Events needed.
        needed: u64,
    },
    /// No lens position makes the picture sharper by more than chance does.
    Weak {
        /// How high the highest peak is in units of what chance makes.
        significance: f64,
    },
    /// There is a peak, but different readings of the same events put it at different places.
    Unsure {
        /// The answer.
        position: LensPosition,
        /// One standard deviation, counts.
        error_bar: f64,
    },
    /// The event rate does not depend on the lens position.
    Flat,
    /// The rate was capped by the read-out or the link.
    Saturated,
    /// Too large a share of the events was lost on the way.
    EventsLost {
        /// Lost.
        lost: u64,
        /// Counted.
        counted: u64,
    },
    /// The events follow the mains more than the lens.
    Flicker {
        /// Frequency.
        hz: u32,
    },
    /// The sharpest position is at the edge of the range: focus lies beyond, or there is none.
    PeakAtEdge {
        /// The answer.
        position: LensPosition,
    },
    /// The two directions disagree by more than lag and backlash can.
    DirectionMismatch {
        /// Answer of the first sweep.
        forward: LensPosition,
        /// Answer of the second.
        backward: LensPosition,
        /// What it looks like.
        suspicion: Suspicion,
    },
    /// The search had no answer.
    NoAnswer(SearchError),
    /// The lens was told to move and did not.
    LensNotMoving,
    /// The lens stopped before its target.
    LensStoppedShort,
    /// The lens came to rest beyond its target.
    LensOvershoot,
    /// The lens is gone.
    LensLost,
    /// The lens is there but reports a fault.
    LensFault,
    /// The lens does not answer.
    LensSilent,
    /// The camera is gone.
    CameraLost,
    /// The camera is there but reports a fault.
    CameraFault,
    /// The camera is there but sends nothing, not even time.
    CameraSilent,
    /// Camera time cannot be related to lens positions: the camera's clock started anew, or arrival times scatter too much.
    ClockUnusable,
    /// The sweep was longer than counts are kept for.
    SweepTooLong,
    /// A phase took longer than it may.
    TimedOut(Phase),
}

impl Failure {
    /// The failure that a search without an answer is.
    pub fn of_search(error: SearchError) -> Self {
        match error {
            SearchError::Weak { significance } => Self::Weak { significance },
            error @ (SearchError::NoLength { .. }
            | SearchError::IntervalTooLong { .. }
            | SearchError::EventsNotKept { .. }
            | SearchError::NoTravel { .. }
            | SearchError::NoPairs
            | SearchError::Counter(_)
            | SearchError::Trace(_)) => Self::NoAnswer(error),
        }
    }

    /// Its name in reports, on the socket and in exit messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::TooFewEvents { .. } => "too-few-events",
            Self::Weak { .. } => "weak",
            Self::Unsure { .. } => "unsure",
            Self::Flat => "flat",
            Self::Saturated => "saturated",
            Self::EventsLost { .. } => "events-lost",
            Self::Flicker { .. } => "flicker",
            Self::PeakAtEdge { .. } => "peak-at-edge",
            Self::DirectionMismatch { .. } => "direction-mismatch",
            Self::NoAnswer(_) => "no-answer",
            Self::LensNotMoving => "lens-not-moving",
            Self::LensStoppedShort => "lens-stopped-short",
            Self::LensOvershoot => "lens-overshoot",
            Self::LensLost => "lens-lost",
            Self::LensFault => "lens-fault",
            Self::LensSilent => "lens-silent",
            Self::CameraLost => "camera-lost",
            Self::CameraFault => "camera-fault",
            Self::CameraSilent => "camera-silent",
            Self::ClockUnusable => "clock-unusable",
            Self::SweepTooLong => "sweep-too-long",
            Self::TimedOut(_) => "timed-out",
        }
    }

    /// What a sweep that failed so casts on the answer of another one; nothing if that one is in question as well.
    pub fn doubt(&self) -> Option<Flag> {
        if matches!(self, Self::Weak { .. }) {
            Some(Flag::Weak)
        } else if matches!(self, Self::Unsure { .. } | Self::NoAnswer(_)) {
            Some(Flag::Unsure)
        } else {
            None
        }
    }

    /// Whether it is the last word on `sweeps` sweeps: what one way does not say, the other may.
    pub fn is_final(&self, sweeps: usize) -> bool {
        sweeps < 2 || self.doubt().is_none()
    }

    /// Whether the lens itself is at fault, so that it must not be told to move again.
    pub fn is_of_lens(&self) -> bool {
        matches!(
            self,
            Self::LensNotMoving
                | Self::LensStoppedShort
                | Self::LensOvershoot
                | Self::LensLost
                | Self::LensFault
                | Self::LensSilent
        )
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFewEvents { events, needed } => write!(
                f,
                "the sweep made {events} events, {needed} are needed: take the lens cap off, give light or texture"
            ),
            Self::Weak { significance } => SearchError::Weak { significance: *significance }.fmt(f),
            Self::Unsure { position, error_bar } => write!(
                f,
                "the peak at {position} is uncertain by {error_bar:.0} counts: too much changes in view; keep the scene still or use a window"
            ),
            Self::Flat => f.write_str(
                "the event rate does not depend on the lens position: nothing with texture is in view",
            ),
            Self::Saturated => f.write_str(
                "the event rate was capped by the read-out or the link: sweep slower, raise the thresholds or use a window",
            ),
            Self::EventsLost { lost, counted } => write!(
                f,
                "{lost} events were lost on the way, {counted} arrived: sweep slower or raise the thresholds"
            ),
            Self::Flicker { hz } => {
                write!(
                    f,
                    "the events follow the {hz} Hz of the mains: use light that does not flicker, or the filter of an EVK4 \
                     (camera.anti_flicker_hz)"
                )
            }
            Self::PeakAtEdge { position } => {
                write!(f, "the sharpest position, {position}, is at the edge of the range: widen the range")
            }
            Self::DirectionMismatch { forward, backward, suspicion } => {
                write!(f, "the way there says {forward}, the way back {backward}, more than the pixels' delay explains: ")?;
                match suspicion {
                    Suspicion::Backlash { counts } => write!(
                        f,
                        "the lens has play; set lens.backlash_counts to about {counts:.0}, or sweep one way only (directions forward)"
                    ),
                    Suspicion::LatePositions => f.write_str("positions are reported too late; poll the lens faster"),
                    Suspicion::DifferentPeaks => f.write_str("the scene changed between the two; try again"),
                }
            }
            Self::NoAnswer(error) => write!(f, "the search has no answer: {error}"),
            Self::LensNotMoving => {
                f.write_str("the lens was told to move and did not: check its power and its limits")
            }
            Self::LensStoppedShort => f.write_str("the lens stopped before its target: check for an obstacle"),
            Self::LensOvershoot => f.write_str("the lens came to rest beyond its target: lower its speed"),
            Self::LensLost => f.write_str("the lens is gone: check its cable, then restart evfocusd"),
            Self::LensFault => f.write_str("the lens reports a fault; the log has its words"),
            Self::LensSilent => f.write_str("the lens does not answer: check its cable and power"),
            Self::CameraLost => f.write_str("the camera is gone: plug it in again, then focus again"),
            Self::CameraFault => f.write_str("the camera reports a fault; the log has its words"),
            Self::CameraSilent => f.write_str("the camera sends nothing, not even time: plug it in anew"),
            Self::ClockUnusable => f.write_str(
                "camera time cannot be related to lens positions: the camera's clock jumped, or the host was too busy",
            ),
            Self::SweepTooLong => {
                f.write_str("the sweep took longer than counts are kept for: sweep faster or raise focus.longest_sweep_s")
            }
            Self::TimedOut(phase) => write!(
                f,
                "{} took longer than it may: check that the lens moves freely and that the host keeps up with the camera",
                phase.name()
            ),
        }
    }
}

/// How a run ended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// In focus.
    Focused {
        /// The answer.
        position: LensPosition,
    },
    /// Not in focus, and why.
    Failed(Failure),
    /// Cancelled; the lens stands where it was stopped.
    Aborted,
}

/// One sweep of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct LegReport {
    /// Where the sweep began.
    pub from: LensPosition,
    /// Where it ended.
    pub to: LensPosition,
    /// Camera time of its begin.
    pub start: CameraMicros,
    /// Camera time of its end.
    pub end: CameraMicros,
    /// ON events counted.
    pub on: u64,
    /// OFF events counted.
    pub off: u64,
    /// Events known to be lost between the pixels and the counter.
    pub lost: u64,
    /// Events counted but not kept for want of room.
    pub not_kept: u64,
    /// The highest rate of the curve.
    pub peak_rate: EventRate,
    /// What the counts look like.
    pub quality: SweepQuality,
    /// What every estimator said; `None` for those not asked.
    pub estimates: [Option<Result<Estimate, SearchError>>; Method::ALL.len()],
    /// What the fine structure of the whole picture says; `None` if it was not asked.
    pub structure: Option<Result<StructureAnswer, SearchError>>,
    /// The same of each window of the request.
    pub windows: [Option<(Window, Result<StructureAnswer, SearchError>)>; MOST_WINDOWS],
    /// The focus curve.
    pub curve: FocusCurve,
}

impl LegReport {
    /// A report with room for a curve and nothing in it.
    pub fn empty() -> Self {
        Self {
            from: LensPosition(0.0),
            to: LensPosition(0.0),
            start: CameraMicros(0),
            end: CameraMicros(0),
            on: 0,
            off: 0,
            lost: 0,
            not_kept: 0,
            peak_rate: EventRate(0.0),
            quality: SweepQuality::default(),
            estimates: [None; Method::ALL.len()],
            structure: None,
            windows: [None; MOST_WINDOWS],
            curve: FocusCurve::new(),
        }
    }

    /// What `method` said.
    pub fn estimate(&self, method: Method) -> Option<Result<Estimate, SearchError>> {
        self.estimates.get(method as usize).copied().flatten()
    }
}

/// The record of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct RunReport {
    /// Its number.
    pub id: RunId,
    /// What was to be done.
    pub plan: FocusPlan,
    /// By what its answers are judged.
    pub rules: Rules,
    /// When it began.
    pub started: HostMicros,
    /// When it ended.
    pub ended: HostMicros,
    /// Where the lens stood before.
    pub position_before: LensPosition,
    /// Where the lens stands now, as last reported.
    pub position_after: LensPosition,
    /// How it ended.
    pub outcome: Outcome,
    /// What the sweeps said; `None` if they gave no answer.
    pub answer: Option<Answer>,
    /// The sweeps made: none, the first, or both.
    pub legs: [Option<LegReport>; 2],
    /// Half the difference of the two directions' answers as a time at the sweep's speed, microseconds: lag plus backlash.
    pub delay_us: Option<f64>,
    /// Hot pixels masked.
    pub hot_pixels: usize,
    /// How well camera time and host time are related.
    pub clock: ClockMapQuality,
    /// Time spent in each phase, in the order of [`Phase::ALL`].
    pub phases: [Duration; Phase::ALL.len()],
}

impl RunReport {
    /// The sweeps made, in order.
    pub fn sweeps(&self) -> impl Iterator<Item = &LegReport> {
        self.legs.iter().flatten()
    }

    /// What each window of the request says, as if it had been the one preferred.
    pub fn windows(&self) -> impl Iterator<Item = (Window, Result<Answer, Failure>)> {
        let [first, second] = &self.legs;
        first.iter().flat_map(|first| window_answers(first, second.as_ref(), self.plan.method, &self.rules))
    }

    /// Where each tile of the picture is sharp; `None` without a sweep in which the picture had a peak.
    pub fn map(&self) -> Option<FocusMap> {
        let measured = self.answer.and_then(|answer| Some(answer.measured?.1));
        focus_map(self.sweeps(), measured, &self.rules)
    }

    /// How long the run took.
    pub fn elapsed(&self) -> Duration {
        self.ended.since(self.started)
    }
}

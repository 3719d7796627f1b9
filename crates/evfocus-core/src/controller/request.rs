//! What callers may ask of the controller, and what they are answered.

use core::time::Duration;

use super::{ControllerConfig, Pause};
use crate::answer::Prefer;
use crate::event::{Geometry, Window};
use crate::report::{Directions, FocusPlan, RunId, Windows};
use crate::search::Method;
use crate::units::{LensPosition, LensRange, LensSpeed};

/// Who decides that the lens moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// The caller moves the lens; focus runs are refused.
    Manual,
    /// The lens focuses when triggered, and never moves without a trigger.
    Auto,
    /// The lens focuses when triggered, when focus is not known, and when the picture has lost its sharpness.
    Continuous,
}

impl Mode {
    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Manual => "manual",
            Self::Auto => "auto",
            Self::Continuous => "continuous",
        }
    }
}

/// How thorough a run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Pace {
    /// One sweep, which ends one width beyond the peak; the delay of the pixels is taken off by what is known of it. Where that is not
    /// sure enough, as [`Normal`](Self::Normal).
    Fast,
    /// A sweep that ends beyond the peak, and the way back over it as the second one.
    #[default]
    Normal,
    /// The whole range, both ways.
    Accurate,
}

impl Pace {
    /// Every pace.
    pub const ALL: [Self; 3] = [Self::Fast, Self::Normal, Self::Accurate];

    /// The name users know it by.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Normal => "normal",
            Self::Accurate => "accurate",
        }
    }

    fn directions(self, method: Method) -> Directions {
        match (self, method) {
            (Self::Fast, Method::Structure | Method::Auto) => Directions::BackIfUnsure,
            // The others do not know how sure they are.
            (Self::Fast, _) => Directions::Forward,
            (Self::Normal | Self::Accurate, _) => Directions::Both,
        }
    }
}

/// A focus run, as far as the caller cares; the configuration decides the rest.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FocusRequest {
    /// Measure and search.
    pub method: Option<Method>,
    /// Accumulation interval of [`Method::ErFixed`].
    pub interval: Option<Duration>,
    /// Positions to sweep, within the limits.
    pub range: Option<LensRange>,
    /// Speed of the sweep.
    pub speed: Option<LensSpeed>,
    /// How thorough.
    pub pace: Option<Pace>,
    /// One way or both, whatever the pace says.
    pub directions: Option<Directions>,
    /// The windows to focus on; the whole picture if there are none.
    pub windows: Windows,
    /// Which of several answers counts.
    pub prefer: Option<Prefer>,
}

/// Something the controller is told to do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Start a focus run.
    Focus(FocusRequest),
    /// Stop whatever is under way; the lens stays where it is then, and continuous mode is paused.
    Abort,
    /// Move the lens.
    MoveTo(LensPosition),
    /// Change the mode; a change ends a run under way.
    SetMode(Mode),
    /// Pause continuous mode, or go on with it.
    Pause(Pause),
}

/// A command that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Accepted {
    /// A run began.
    Started(RunId),
    /// The same run is already under way.
    UnderWay(RunId),
    /// Done, or begun.
    Done,
}

/// A command that was not taken; nothing changed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Another run is under way.
    #[error("run {run} is under way; wait for it or abort it")]
    Busy {
        /// That run.
        run: RunId,
    },
    /// A focus run was asked for in manual mode.
    #[error("focus runs need mode auto or continuous; the mode is manual")]
    ManualMode,
    /// Pausing was asked for in a mode that does nothing by itself.
    #[error("only mode continuous can be paused or resumed; the mode is {}", mode.name())]
    NotContinuous {
        /// The mode.
        mode: Mode,
    },
    /// There is no camera.
    #[error("no camera is connected")]
    NoCamera,
    /// There is no lens.
    #[error("no lens is connected")]
    NoLens,
    /// The lens has not found its reference yet, so a position means nothing.
    #[error("the lens has not been homed; a focus run homes it first")]
    NotHomed,
    /// A position outside of the limits.
    #[error("{what} {value} lies outside of the lens's limits, {limits}")]
    OutOfRange {
        /// What the number is.
        what: &'static str,
        /// The number, lens counts.
        value: f64,
        /// The limits.
        limits: LensRange,
    },
    /// A speed that the lens cannot go.
    #[error("a speed of {value} counts/s is more than the lens's {max} counts/s")]
    TooFast {
        /// The speed, counts per second.
        value: f64,
        /// The lens's limit, counts per second.
        max: f64,
    },
    /// The sweep would take longer than counts are kept for.
    #[error(
        "a sweep of {sweep_s:.1} s is longer than the {longest_s:.1} s that counts are kept for; sweep faster or a shorter range"
    )]
    SweepTooLong {
        /// The sweep, seconds.
        sweep_s: f64,
        /// What is kept, seconds.
        longest_s: f64,
    },
    /// A window that is not on the sensor.
    #[error(
        "window {index} ({} x {} pixels at {}, {}) does not lie on the sensor of {} x {} pixels",
        window.width, window.height, window.x, window.y, geometry.width, geometry.height
    )]
    Window {
        /// Its number, from 0.
        index: usize,
        /// The window.
        window: Window,
        /// The sensor.
        geometry: Geometry,
    },
    /// A window was preferred that the request does not have.
    #[error("window {index} is preferred, and the request has {windows} windows, counted from 0")]
    NoSuchWindow {
        /// The number asked for, from 0.
        index: u8,
        /// How many there are.
        windows: usize,
    },
    /// Windows with a method that counts the events of the whole picture.
    #[error("method {method} counts the events of the whole picture; windows need auto or structure")]
    NoWindows {
        /// The method.
        method: Method,
    },
    /// An accumulation interval that does not fit the sweep.
    #[error("an interval of {interval_s} s must be above zero and shorter than the sweep's {sweep_s:.3} s")]
    Interval {
        /// The interval, seconds.
        interval_s: f64,
        /// The sweep, seconds.
        sweep_s: f64,
    },
}

impl FocusRequest {
    /// The run that this request means under `config`.
    ///
    /// # Errors
    /// [`Refusal`] if a value does not suit the lens or the room for counts.
    pub fn resolve(&self, config: &ControllerConfig, geometry: Geometry) -> Result<FocusPlan, Refusal> {
        let pace = self.pace.unwrap_or(config.pace);
        let prefer = self.prefer.unwrap_or(config.prefer);
        let method = self.method.unwrap_or(config.method);
        let plan = FocusPlan {
            method,
            interval: self.interval.unwrap_or(config.interval),
            range: self.range.unwrap_or(config.limits),
            speed: self.speed.unwrap_or(config.sweep_speed),
            directions: self.directions.unwrap_or(pace.directions(method)),
            // A nearer subject may come later than a stronger one.
            early_stop: pace != Pace::Accurate && prefer != Prefer::Nearest,
            windows: self.windows,
            prefer,
        };
        check_windows(&plan.windows, plan.prefer, plan.method, geometry)?;
        for (what, end) in [("range start", plan.range.min()), ("range end", plan.range.max())] {
            if !config.limits.contains(end) {
                return Err(Refusal::OutOfRange { what, value: end.0, limits: config.limits });
            }
        }
        let (speed, max) = (plan.speed.counts_per_second(), config.max_speed.counts_per_second());
        if speed > max {
            return Err(Refusal::TooFast { value: speed, max });
        }
        let (sweep_s, longest_s) = (plan.range.length() / speed, config.capacity.longest.as_secs_f64());
        if sweep_s > longest_s {
            return Err(Refusal::SweepTooLong { sweep_s, longest_s });
        }
        let interval_s = plan.interval.as_secs_f64();
        if plan.method == Method::ErFixed && (interval_s <= 0.0 || interval_s >= sweep_s) {
            return Err(Refusal::Interval { interval_s, sweep_s });
        }
        Ok(plan)
    }
}

/// Whether a request for `windows` of a sensor of `geometry` makes sense with this preference and method.
///
/// # Errors
/// [`Refusal::Window`], [`Refusal::NoSuchWindow`] or [`Refusal::NoWindows`].
pub fn check_windows(
    windows: &Windows,
    prefer: Prefer,
    method: Method,
    geometry: Geometry,
) -> Result<(), Refusal> {
    let windows = windows.iter().flatten();
    if let Some((index, &window)) = windows.clone().enumerate().find(|(_, window)| !window.fits(geometry)) {
        return Err(Refusal::Window { index, window, geometry });
    }
    let number = windows.count();
    match prefer {
        Prefer::Window(index) if usize::from(index) >= number => {
            Err(Refusal::NoSuchWindow { index, windows: number })
        }
        Prefer::Window(_) | Prefer::Strongest | Prefer::Nearest
            if number > 0 && !matches!(method, Method::Structure | Method::Auto) =>
        {
            Err(Refusal::NoWindows { method })
        }
        Prefer::Window(_) | Prefer::Strongest | Prefer::Nearest => Ok(()),
    }
}

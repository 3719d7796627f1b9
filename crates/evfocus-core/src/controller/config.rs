//! What the controller must know beforehand.

use core::time::Duration;

use super::WatchConfig;
use super::request::Pace;
use crate::analysis::SweepLimits;
use crate::answer::{Prefer, Rules};
use crate::delay::DelayModel;
use crate::search::Method;
use crate::sweep::SweepCapacity;
use crate::units::{LensRange, LensSpeed};

/// What happens to the lens when a run fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OnFailure {
    /// It goes back to where it was before the run, if the lens itself is sound.
    Restore,
    /// It stays where it is.
    Stay,
}

/// The controller's settings. Positions in lens counts.
#[derive(Debug, Clone, PartialEq)]
pub struct ControllerConfig {
    /// Positions that the lens may be sent to.
    pub limits: LensRange,
    /// The fastest speed that may be asked for.
    pub max_speed: LensSpeed,
    /// Speed of the sweep unless the request names one.
    pub sweep_speed: LensSpeed,
    /// Method unless the request names one.
    pub method: Method,
    /// Accumulation interval of [`Method::ErFixed`] unless the request names one.
    pub interval: Duration,
    /// How thorough a run is unless the request says.
    pub pace: Pace,
    /// Which of several answers counts unless the request says.
    pub prefer: Prefer,
    /// Whether nearer subjects are sharp at higher positions.
    pub nearest_is_high: bool,
    /// An answer this near to the truth is as good as the truth, counts; 1 % of the range swept if that is more.
    pub depth_of_focus: f64,
    /// Known play between what the lens reports and the glass, counts: upwards the glass is where the lens says, downwards so much
    /// above.
    pub backlash: f64,
    /// How late the pixels are, as far as is known beforehand.
    pub delays: DelayModel,
    /// By what part of its length the range is extended at an end where focus seems to lie beyond; 0 for not at all.
    pub extension: f64,
    /// Whether the lens must be homed before its positions mean anything.
    pub needs_homing: bool,
    /// How long homing may take.
    pub homing_timeout: Duration,
    /// Rest before the sweep and before the verdict: hot pixels are learnt, vibrations die down.
    pub rest: Duration,
    /// How near to its target the lens must come to rest, counts.
    pub position_tolerance: f64,
    /// How far before the answer the final approach begins, so that backlash is taken up in the direction of the first sweep;
    /// counts.
    pub approach_margin: f64,
    /// A lens that does not change its position for this long while it should is stuck.
    pub stall_timeout: Duration,
    /// Silence of lens or camera after which it is given up.
    pub silence_timeout: Duration,
    /// What the lens may take beyond distance by speed: acceleration, latency, a slow protocol.
    pub motion_slack: Duration,
    /// What a sweep must hold to be believed.
    pub sweep_limits: SweepLimits,
    /// An answer this near to an end of the range, as a share of the range, is taken for focus beyond the range.
    pub edge_share: f64,
    /// The largest half-difference of the two directions, as a share of the range.
    pub largest_mismatch_share: f64,
    /// The largest root mean square error of the clock map.
    pub largest_clock_residual: Duration,
    /// What happens to the lens when a run fails.
    pub on_failure: OnFailure,
    /// When continuous mode starts a run.
    pub watch: WatchConfig,
    /// Room for the events of a sweep.
    pub capacity: SweepCapacity,
    /// Lens samples kept; at 1 kHz a minute is 60,000.
    pub lens_samples: usize,
}

impl ControllerConfig {
    /// Settings for a lens that may go to `limits` at up to `max_speed`, everything else at its documented default.
    pub fn for_lens(limits: LensRange, max_speed: LensSpeed) -> Self {
        Self {
            limits,
            max_speed,
            sweep_speed: max_speed,
            method: Method::Auto,
            interval: Duration::from_millis(55),
            pace: Pace::Normal,
            prefer: Prefer::Strongest,
            nearest_is_high: true,
            depth_of_focus: 0.0,
            backlash: 0.0,
            delays: DelayModel::default(),
            extension: 0.25,
            needs_homing: false,
            homing_timeout: Duration::from_secs(30),
            rest: Duration::from_millis(100),
            position_tolerance: 0.003 * limits.length(),
            approach_margin: 0.02 * limits.length(),
            stall_timeout: Duration::from_millis(500),
            silence_timeout: Duration::from_secs(1),
            motion_slack: Duration::from_secs(2),
            sweep_limits: SweepLimits::default(),
            edge_share: 0.02,
            largest_mismatch_share: 0.15,
            largest_clock_residual: Duration::from_millis(20),
            on_failure: OnFailure::Restore,
            watch: WatchConfig::default(),
            capacity: SweepCapacity::default(),
            lens_samples: 60_000,
        }
    }

    /// By what the answer of a run over `range` is judged, the pixels being as late as `delays` says.
    pub(super) fn rules(&self, range: LensRange, prefer: Prefer, delays: DelayModel) -> Rules {
        let rules = Rules::for_range(range);
        Rules {
            tolerance: rules.tolerance.max(self.depth_of_focus),
            edge_share: self.edge_share,
            largest_mismatch_share: self.largest_mismatch_share,
            delays,
            backlash: self.backlash,
            prefer,
            nearest_is_high: self.nearest_is_high,
            ..rules
        }
    }
}

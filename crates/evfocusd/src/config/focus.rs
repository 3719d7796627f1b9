//! `[focus]`: how a run goes.

use evfocus_core::controller::{ControllerConfig, OnFailure, Pace};
use evfocus_core::{LensPosition, LensRange, LensSpeed, Method, Prefer, SweepCapacity, SweepLimits};
use evfocus_hal::LensInfo;
use serde::Deserialize;

use super::value::{BadValue, set, set_choice, set_duration};

/// Most memory that counts and events of a sweep may take.
const MOST_BYTES: f64 = 4e9;

/// `[focus]`. Absent keys take the lens's own figures or the defaults of
/// [`ControllerConfig::for_lens`].
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FocusSection {
    /// `auto` (default), `structure`, `mirror-pairs`, `egs`, `egs-official`, `er-fixed` or `er-squared`.
    pub method: Option<String>,
    /// Accumulation interval of `er-fixed`, milliseconds; 1 to 10,000, default 55.
    pub interval_ms: Option<f64>,
    /// `fast`: one sweep that ends beyond the peak, if that is sure enough; `normal` (default): and back over the peak; `accurate`: the whole range, both ways.
    pub speed: Option<String>,
    /// Which of several windows or depths counts: `strongest` (default) or `nearest`.
    pub prefer: Option<String>,
    /// The end of the range at which near subjects are sharp: `max` (default) or `min`.
    pub nearest_at: Option<String>,
    /// An answer this near to the truth is as good as the truth, counts; default 0; 1 % of the range swept if that is more.
    pub depth_of_focus_counts: Option<f64>,
    /// By what share of its length the range is extended where focus seems to lie beyond its end; 0 (never) to 1, default 0.25.
    pub extend_range: Option<f64>,
    /// Speed of the sweep, counts per second; default: the lens's highest.
    pub sweep_speed_counts_per_s: Option<f64>,
    /// Rest before the sweep and before the verdict, milliseconds; 10 to 10,000, default 100.
    pub rest_ms: Option<f64>,
    /// How near to its target the lens must come to rest, counts; default 0.3 % of the range.
    pub position_tolerance_counts: Option<f64>,
    /// How far before the answer the last approach begins, counts; more than the backlash; default 2 % of the range.
    pub approach_margin_counts: Option<f64>,
    /// What the lens does when a run fails: `restore` (default) or `stay`.
    pub on_failure: Option<String>,
    /// A lens that stands still for this long while it should move is stuck, milliseconds; 50 to 60,000, default 500.
    pub stall_timeout_ms: Option<f64>,
    /// Silence after which camera or lens is given up, milliseconds; 50 to 60,000, default 1000.
    pub silence_timeout_ms: Option<f64>,
    /// What a motion may take beyond twice its distance by speed, seconds; 0 to 600, default 2.
    pub motion_slack_s: Option<f64>,
    /// How long homing may take, seconds; 1 to 600, default 30.
    pub homing_timeout_s: Option<f64>,
    /// Width of the counter's bins, microseconds; 1 to 1000, default 20.
    pub bin_us: Option<u32>,
    /// The longest sweep, seconds; 0.1 to 120, default 20. Memory: 16 bytes a bin.
    pub longest_sweep_s: Option<f64>,
    /// Events kept for the measures that need pixels; default 16,000,000, 8 bytes each.
    pub events_kept: Option<u32>,
    /// A sweep with fewer events is not searched; default 2000.
    pub fewest_events: Option<u32>,
    /// The largest share of events that may be lost, 0 to 1; default 0.05.
    pub largest_lost_share: Option<f64>,
    /// The largest share of events that may follow the mains, 0 to 2; default 0.6.
    pub largest_flicker_depth: Option<f64>,
    /// The largest error, root mean square, with which camera and host time may be related, milliseconds; 0.01 to 1000, default
    /// 20.
    pub largest_clock_residual_ms: Option<f64>,
    /// The largest half-difference of the two directions as a share of the range, 0 to 1; default 0.15.
    pub largest_mismatch_share: Option<f64>,
    /// An answer this near to an end of the range, as a share of it, means that focus lies beyond; 0 to 0.4, default 0.02.
    pub edge_share: Option<f64>,
}

impl FocusSection {
    pub(super) fn controller(
        &self,
        lens: &LensInfo,
        min: Option<LensPosition>,
        max: Option<LensPosition>,
    ) -> Result<ControllerConfig, BadValue> {
        let (low, high) = (min.unwrap_or(lens.range.min()), max.unwrap_or(lens.range.max()));
        for (key, limit) in [("lens.min_counts", low), ("lens.max_counts", high)] {
            if !lens.range.contains(limit) {
                return Err(BadValue::new(key, limit.0, format!("the lens goes from {}", lens.range)));
            }
        }
        let limits = LensRange::new(low, high)
            .map_err(|error| BadValue::new("lens.min_counts", low.0, error.to_string()))?;
        let mut config = ControllerConfig::for_lens(limits, lens.max_speed);
        config.needs_homing = lens.needs_homing;
        self.choices(&mut config)?;
        self.motion(&mut config, lens)?;
        self.sweep(&mut config)?;
        Ok(config)
    }

    fn choices(&self, config: &mut ControllerConfig) -> Result<(), BadValue> {
        if let Some(name) = &self.method {
            config.method = name
                .parse::<Method>()
                .map_err(|error| BadValue::new("focus.method", name, error.to_string()))?;
        }
        let paces = Pace::ALL.map(|pace| (pace.name(), pace));
        set_choice(&mut config.pace, "focus.speed", self.speed.as_ref(), &paces)?;
        let preferences = [("strongest", Prefer::Strongest), ("nearest", Prefer::Nearest)];
        set_choice(&mut config.prefer, "focus.prefer", self.prefer.as_ref(), &preferences)?;
        let ends = [("max", true), ("min", false)];
        set_choice(&mut config.nearest_is_high, "focus.nearest_at", self.nearest_at.as_ref(), &ends)?;
        let what_then = [("restore", OnFailure::Restore), ("stay", OnFailure::Stay)];
        set_choice(&mut config.on_failure, "focus.on_failure", self.on_failure.as_ref(), &what_then)?;
        set(
            &mut config.depth_of_focus,
            "focus.depth_of_focus_counts",
            self.depth_of_focus_counts,
            0.0,
            config.limits.length(),
        )?;
        set(&mut config.extension, "focus.extend_range", self.extend_range, 0.0, 1.0)
    }

    fn motion(&self, config: &mut ControllerConfig, lens: &LensInfo) -> Result<(), BadValue> {
        let length = config.limits.length();
        if let Some(speed) = self.sweep_speed_counts_per_s {
            let key = "focus.sweep_speed_counts_per_s";
            BadValue::check(key, speed, f64::MIN_POSITIVE, lens.max_speed.counts_per_second())?;
            config.sweep_speed =
                LensSpeed::new(speed).map_err(|error| BadValue::new(key, speed, error.to_string()))?;
        }
        set(
            &mut config.position_tolerance,
            "focus.position_tolerance_counts",
            self.position_tolerance_counts,
            f64::MIN_POSITIVE,
            0.05 * length,
        )?;
        set(
            &mut config.approach_margin,
            "focus.approach_margin_counts",
            self.approach_margin_counts,
            // Nearer than that, the lens would count as arrived before it has set out.
            2.0 * config.position_tolerance,
            length,
        )?;
        let milliseconds = 1e-3;
        set_duration(&mut config.rest, "focus.rest_ms", self.rest_ms, milliseconds, (10.0, 1e4))?;
        set_duration(
            &mut config.stall_timeout,
            "focus.stall_timeout_ms",
            self.stall_timeout_ms,
            milliseconds,
            (50.0, 6e4),
        )?;
        set_duration(
            &mut config.silence_timeout,
            "focus.silence_timeout_ms",
            self.silence_timeout_ms,
            milliseconds,
            (50.0, 6e4),
        )?;
        set_duration(
            &mut config.motion_slack,
            "focus.motion_slack_s",
            self.motion_slack_s,
            1.0,
            (0.0, 600.0),
        )?;
        set_duration(
            &mut config.homing_timeout,
            "focus.homing_timeout_s",
            self.homing_timeout_s,
            1.0,
            (1.0, 600.0),
        )
    }

    fn sweep(&self, config: &mut ControllerConfig) -> Result<(), BadValue> {
        set_duration(&mut config.interval, "focus.interval_ms", self.interval_ms, 1e-3, (1.0, 1e4))?;
        let SweepCapacity { bin, longest, events } = &mut config.capacity;
        set_duration(bin, "focus.bin_us", self.bin_us.map(f64::from), 1e-6, (1.0, 1000.0))?;
        set_duration(longest, "focus.longest_sweep_s", self.longest_sweep_s, 1.0, (0.1, 120.0))?;
        if let Some(kept) = self.events_kept {
            BadValue::check("focus.events_kept", f64::from(kept), 0.0, 1e9)?;
            *events = kept as usize;
        }
        let bytes = 16.0 * longest.as_secs_f64() / bin.as_secs_f64() + 8.0 * *events as f64;
        if bytes > MOST_BYTES {
            let remedy = format!(
                "counts and events would take {:.1} GB, more than 4: keep fewer, or sweep shorter",
                bytes * 1e-9
            );
            return Err(BadValue::new("focus.events_kept", *events, remedy));
        }
        let SweepLimits { fewest_events, largest_lost_share, largest_flicker_depth } =
            &mut config.sweep_limits;
        if let Some(fewest) = self.fewest_events {
            *fewest_events = u64::from(fewest);
        }
        set(largest_lost_share, "focus.largest_lost_share", self.largest_lost_share, 0.0, 1.0)?;
        set(largest_flicker_depth, "focus.largest_flicker_depth", self.largest_flicker_depth, 0.0, 2.0)?;
        set_duration(
            &mut config.largest_clock_residual,
            "focus.largest_clock_residual_ms",
            self.largest_clock_residual_ms,
            1e-3,
            (0.01, 1000.0),
        )?;
        set(
            &mut config.largest_mismatch_share,
            "focus.largest_mismatch_share",
            self.largest_mismatch_share,
            0.0,
            1.0,
        )?;
        set(&mut config.edge_share, "focus.edge_share", self.edge_share, 0.0, 0.4)
    }
}

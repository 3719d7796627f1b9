//! Measures a lens: its way there and back over the positions that it may be sent to, a stop on the way, and, where the camera sees
//! anything, a focus run at each of two speeds. A state machine, as the controller is: positions and time in, orders out.
//!
//! The lens never leaves its limits. Whatever ends a calibration, the lens is told to stop.

mod desk;
mod file;
mod leg;
mod play;

use std::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command, DeviceFailure, FocusRequest, Pace};
use evfocus_core::{
    Controller, ControllerConfig, Directions, HostMicros, LensPosition, LensSample, LensSpeed, Method,
};
use evfocus_hal::{LensClass, LensInfo};
use evfocus_ipc::{CALIBRATION_FORMAT, Calibration, LensRange};

pub(crate) use desk::Desk;
pub use file::CalibrationFile;
use leg::{Leg, Progress};
use play::{Difference, Play};

use crate::devices;

/// How long the lens stands before it is measured: noise is taken meanwhile.
const REST: Duration = Duration::from_millis(300);
/// A lens that has not begun to move this long after the order to home is at its reference already.
const HOMING_BEGINS: Duration = Duration::from_millis(500);
/// Share of its way at which the lens is stopped to see how long that takes.
const STOP_AT: f64 = 0.4;
/// No answer of the lens for this long.
const SILENCE: Duration = Duration::from_secs(5);
/// A motion is noticed when it exceeds the noise this many times, and this share of the range.
const NOTICEABLE: (f64, f64) = (5.0, 0.000_5);
/// Shares of the sweep's speed at which play is told from lag. Slow: what pixels are late by is in proportion to the speed only as long
/// as they follow.
const PLAY_SPEEDS: [f64; 2] = [0.5, 0.25];
/// The second of these runs goes at least this far to either side of the peak, as a share of the range.
const NARROWEST: f64 = 0.12;
/// What positions and pixels can be late by, seconds: beyond, the two ways of a sweep differ for another reason.
const PLAUSIBLE_LAG_S: std::ops::RangeInclusive<f64> = -0.01..=0.1;
/// How far from an end that the lens ran into it is kept, in tolerances of its position.
const CLEARANCE: f64 = 3.0;
/// Speeds that differ by more than this share are worth a note.
const UNEVEN: f64 = 0.05;

/// Why a calibration ended without a result, in kebab case, and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationFailure {
    /// `aborted`, or what a focus run would call it.
    pub reason: &'static str,
    /// What happened, and what to do.
    pub message: String,
}

#[derive(Debug)]
enum Step {
    Begin,
    Homing {
        since: HostMicros,
        seen_moving: bool,
    },
    ToLow(Leg),
    AtLow {
        since: HostMicros,
        positions: Vec<f64>,
    },
    Up(Leg),
    Down(Leg),
    Stopping(Leg),
    /// The focus run at the first, then at the second speed.
    Focus(Vec<Difference>),
    Focusing(Vec<Difference>),
    Back(Leg),
    Over,
}

/// A calibration under way.
#[derive(Debug)]
pub(crate) struct Calibrator {
    settings: ControllerConfig,
    speed_is_share: bool,
    step: Step,
    began_at: Option<LensPosition>,
    last: Option<LensSample>,
    heard: HostMicros,
    /// What has become of the leg under way.
    progress: Progress,
    ends: [LensPosition; 2],
    noise: f64,
    up: Option<Leg>,
    result: Calibration,
    failure: Option<CalibrationFailure>,
}

impl Calibrator {
    /// Begins with the next [`advance`](Self::advance). The lens goes to the limits of `settings`, at its full speed.
    pub(crate) fn new(settings: &ControllerConfig, info: &LensInfo, now: HostMicros) -> Self {
        let limits = settings.limits;
        let mut notes = Vec::new();
        if info.class == LensClass::Setpoint {
            let note = "this lens does not tell where it is: positions are computed from what it was told, and one that sticks is not seen";
            notes.push(note.to_owned());
        }
        Self {
            settings: settings.clone(),
            speed_is_share: info.speed_is_share,
            step: Step::Begin,
            began_at: None,
            last: None,
            heard: now,
            progress: Progress::UnderWay,
            ends: [limits.min(), limits.max()],
            noise: 0.0,
            up: None,
            result: Calibration {
                format: CALIBRATION_FORMAT,
                lens: devices::name(&info.model, &info.serial),
                measured_unix_s: 0.0,
                range: LensRange { min: limits.min().0, max: limits.max().0 },
                speed_counts_per_s: 0.0,
                read_back_hz: 0.0,
                read_back_us: 0.0,
                read_noise: 0.0,
                command_latency_us: 0.0,
                stop_us: 0.0,
                stop_counts: 0.0,
                backlash: None,
                backlash_error_bar: None,
                lag_us: None,
                notes,
            },
            failure: None,
        }
    }

    /// The lens said where it is.
    pub(crate) fn sample(&mut self, sample: LensSample) {
        self.last = Some(sample);
        self.heard = sample.replied;
        match &mut self.step {
            Step::Homing { seen_moving, .. } => *seen_moving |= sample.moving,
            Step::AtLow { positions, .. } => positions.push(sample.position.0),
            Step::ToLow(leg) | Step::Up(leg) | Step::Down(leg) | Step::Stopping(leg) | Step::Back(leg) => {
                self.progress = leg.observe(sample);
            }
            Step::Begin | Step::Focus(_) | Step::Focusing(_) | Step::Over => {}
        }
    }

    /// The lens failed. One that drove against an end of its way, and noticed, has found it.
    pub(crate) fn lens_failed(&mut self, failure: DeviceFailure) {
        if let (
            DeviceFailure::Fault,
            Step::ToLow(leg) | Step::Up(leg) | Step::Down(leg) | Step::Stopping(leg),
        ) = (failure, &mut self.step)
            && leg.block()
        {
            return;
        }
        let (reason, what) = match failure {
            DeviceFailure::Gone => ("lens-lost", "the lens is gone; check its cable"),
            DeviceFailure::Silent => ("lens-silent", "the lens does not answer; check its power and cable"),
            DeviceFailure::Fault => (
                "lens-fault",
                "the lens reports a fault; the log has its words. If it ran into an end of its way, narrow lens.min_counts and \
                 lens.max_counts",
            ),
        };
        self.fail(reason, what);
    }

    /// Somebody wants the lens to stop.
    pub(crate) fn abort(&mut self) {
        self.fail("aborted", "aborted; nothing that was measured is kept");
    }

    fn fail(&mut self, reason: &'static str, message: impl Into<String>) {
        self.failure.get_or_insert(CalibrationFailure { reason, message: message.into() });
    }

    /// Goes on as far as it can at `now`; what the lens is to do is added to `actions`. Returns how it ended, once.
    pub(crate) fn advance(
        &mut self,
        controller: &mut Controller,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Option<Result<Calibration, CalibrationFailure>> {
        if now.since(self.heard) >= SILENCE {
            self.fail("lens-silent", "the lens has not said where it is for 5 s; check its power and cable");
        }
        if self.failure.is_none() {
            self.proceed(controller, now, actions);
        }
        if let Some(failure) = self.failure.take() {
            self.step = Step::Over;
            // Whatever the lens is at, and a focus run with it.
            if controller.command(Command::Abort, now, actions).is_err() {
                actions.push(Action::StopLens);
            }
            return Some(Err(failure));
        }
        matches!(self.step, Step::Over).then(|| Ok(self.result.clone()))
    }

    fn proceed(&mut self, controller: &mut Controller, now: HostMicros, actions: &mut Vec<Action>) {
        let Some(last) = self.last else { return };
        match std::mem::replace(&mut self.step, Step::Over) {
            Step::Begin if self.settings.needs_homing => {
                actions.push(Action::Home);
                self.step = Step::Homing { since: now, seen_moving: false };
            }
            Step::Begin => {
                self.began_at = Some(self.settings.limits.clamp(last.position));
                self.step = Step::ToLow(self.go(self.ends[0], now, actions));
            }
            Step::Homing { since, seen_moving } => {
                let has_begun = seen_moving || now.since(since) >= HOMING_BEGINS;
                if has_begun && !last.moving && last.requested > since {
                    self.step = Step::ToLow(self.go(self.ends[0], now, actions));
                } else if now.since(since) >= self.settings.homing_timeout {
                    self.fail("timed-out", "the lens has not found its reference in time");
                } else {
                    self.step = Step::Homing { since, seen_moving };
                }
            }
            Step::ToLow(leg) => match self.ended(&leg, 0, actions) {
                Some(()) => self.step = Step::AtLow { since: now, positions: Vec::new() },
                None => self.step = Step::ToLow(leg),
            },
            Step::AtLow { since, positions } if now.since(since) >= REST && positions.len() >= 3 => {
                self.noise = leg::noise(&positions);
                self.step = Step::Up(self.go(self.ends[1], now, actions));
            }
            Step::AtLow { since, positions } => self.step = Step::AtLow { since, positions },
            Step::Up(leg) => match self.ended(&leg, 1, actions) {
                Some(()) => {
                    self.up = Some(leg);
                    self.step = Step::Down(self.go(self.ends[0], now, actions));
                }
                None => self.step = Step::Up(leg),
            },
            Step::Down(leg) => match self.ended(&leg, 0, actions) {
                Some(()) => {
                    self.measure(&leg);
                    self.step = Step::Stopping(self.go(self.ends[1], now, actions));
                }
                None => self.step = Step::Down(leg),
            },
            Step::Stopping(mut leg) => {
                if !leg.is_stopped() && leg.share() >= STOP_AT {
                    leg.stop(now);
                    actions.push(Action::StopLens);
                }
                match self.ended(&leg, 1, actions) {
                    Some(()) => {
                        if let Some((stop_us, counts)) = leg.stopping(self.noticeable()) {
                            (self.result.stop_us, self.result.stop_counts) = (stop_us, counts);
                        }
                        self.step = Step::Focus(Vec::new());
                    }
                    None => self.step = Step::Stopping(leg),
                }
            }
            Step::Focus(differences) => self.focus(differences, controller, now, actions),
            Step::Focusing(differences) => self.look(differences, controller, now, actions),
            Step::Back(leg) => {
                if self.ended(&leg, 0, actions).is_none() {
                    self.step = Step::Back(leg);
                }
            }
            Step::Over => {}
        }
    }

    /// Sends the lens off.
    fn go(&mut self, target: LensPosition, now: HostMicros, actions: &mut Vec<Action>) -> Leg {
        self.progress = Progress::UnderWay;
        actions.push(Action::MoveLens { target, speed: self.settings.max_speed });
        let from = self.last.map_or(target, |last| last.position);
        Leg::new(from, target, now, self.settings.position_tolerance)
    }

    /// Whether the leg towards the end `end` is over. A lens that stands before it has found where its way really ends.
    fn ended(&mut self, leg: &Leg, end: usize, actions: &mut Vec<Action>) -> Option<()> {
        match self.progress {
            Progress::UnderWay => return None,
            Progress::Rested => {}
            Progress::Short => self.shorten(leg, end, actions)?,
            Progress::WrongWay => {
                let at = leg.rest();
                let what =
                    format!("sent from {} to {}, the lens went to {at}; turn it round", leg.from, leg.target);
                self.fail("lens-wrong-way", what);
                return None;
            }
            Progress::Overdue => {
                let what = format!("the lens has not come from {} to {} in time", leg.from, leg.target);
                self.fail("timed-out", what);
                return None;
            }
        }
        Some(())
    }

    fn shorten(&mut self, leg: &Leg, end: usize, actions: &mut Vec<Action>) -> Option<()> {
        let rest = leg.rest();
        let way = self.settings.limits.length();
        let left = if end == 0 { self.ends[1].counts_from(rest) } else { rest.counts_from(self.ends[0]) };
        if leg.from.distance(rest) <= self.settings.position_tolerance || left < 0.1 * way {
            let what = format!(
                "sent from {} to {}, the lens stands at {rest}; check its power and that nothing blocks it",
                leg.from, leg.target
            );
            self.fail("lens-not-moving", what);
            return None;
        }
        actions.push(Action::StopLens);
        let clearance = CLEARANCE * self.settings.position_tolerance;
        let kept = LensPosition(if end == 0 { rest.0 + clearance } else { rest.0 - clearance });
        self.result.notes.push(format!(
            "the lens stopped at {rest} on its way to {}: an end of its way lies within its limits; it will go to {kept} at most",
            leg.target
        ));
        if let Some(place) = self.ends.get_mut(end) {
            *place = kept;
        }
        Some(())
    }

    /// Less is no motion, counts.
    fn noticeable(&self) -> f64 {
        (NOTICEABLE.0 * self.noise).max(NOTICEABLE.1 * self.settings.limits.length())
    }

    /// What the ways there and back say.
    fn measure(&mut self, down: &Leg) {
        let Some(up) = self.up.take() else { return };
        let noticeable = self.noticeable();
        let speeds = [up.speed(), down.speed()];
        let [Some(fast), Some(slow)] = speeds else {
            let what = format!(
                "{} positions came while the lens went {} to {}, too few to tell its speed; lower lens.poll_ms",
                up.samples.len(),
                up.from,
                up.rest()
            );
            return self.fail("lens-silent", what);
        };
        if (fast - slow).abs() > UNEVEN * fast.max(slow) {
            self.result.notes.push(format!("{fast:.0} counts/s on the way up, {slow:.0} on the way down"));
        }
        let result = &mut self.result;
        result.range = LensRange { min: self.ends[0].0, max: self.ends[1].0 };
        result.speed_counts_per_s = fast.min(slow);
        result.read_back_hz = up.read_back_hz();
        result.read_back_us = up.read_back_us();
        result.read_noise = self.noise;
        let latencies = [up.latency_us(noticeable), down.latency_us(noticeable)];
        result.command_latency_us = latencies.into_iter().flatten().fold(0.0, f64::max);
    }

    /// Starts the next focus run, or goes back.
    fn focus(
        &mut self,
        differences: Vec<Difference>,
        controller: &mut Controller,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        if let [one, other] = *differences {
            match Play::of(one, other) {
                Some(play) if !PLAUSIBLE_LAG_S.contains(&play.lag_s) => {
                    let what = format!(
                        "the ways up and down disagree by {:.0} counts at {:.0} counts/s and by {:.0} at {:.0}, which is neither play nor lag. A \
                         lens that counts its steps has lost some, most likely at an end of its way within its limits: narrow \
                         lens.min_counts and lens.max_counts, and set its position anew",
                        one.counts, one.speed, other.counts, other.speed
                    );
                    return self.fail("direction-mismatch", what);
                }
                Some(play) => {
                    self.result.backlash = Some(play.counts.max(0.0));
                    self.result.backlash_error_bar = Some(play.error_bar);
                    self.result.lag_us = Some(play.lag_s * 1e6);
                }
                None => self.without_play("the lens goes at one speed only, so that play looks like lag"),
            }
            return self.go_back(now, actions);
        }
        let result = self.take_measured(controller, &differences);
        match result.and_then(|request| {
            controller.command(Command::Focus(request), now, actions).map_err(|refusal| refusal.to_string())
        }) {
            Ok(Accepted::Started(_)) => self.step = Step::Focusing(differences),
            Ok(Accepted::UnderWay(_) | Accepted::Done) => {
                self.without_play("another run was under way");
                self.go_back(now, actions);
            }
            Err(why) => {
                self.without_play(&why);
                self.go_back(now, actions);
            }
        }
    }

    /// The request of the next run: what was measured counts from here on.
    fn take_measured(
        &self,
        controller: &mut Controller,
        differences: &[Difference],
    ) -> Result<FocusRequest, String> {
        if differences.is_empty() {
            // No run is under way.
            controller.reconfigure(apply(Some(&self.result), self.settings.clone(), self.speed_is_share));
        }
        let config = controller.config();
        // The slow one need not go farther than the peak.
        let range = differences.first().and_then(|known| {
            let reach = (2.0 * known.width).max(NARROWEST * config.limits.length());
            let end = |to: f64| config.limits.clamp(LensPosition(known.position + to));
            evfocus_core::LensRange::new(end(-reach), end(reach)).ok()
        });
        let length = range.unwrap_or(config.limits).length();
        let fast = config.sweep_speed.counts_per_second();
        let slowest = length / (0.45 * config.capacity.longest.as_secs_f64());
        let share = PLAY_SPEEDS.get(differences.len()).copied().unwrap_or(1.0);
        let speed = LensSpeed::new((share * fast).max(slowest).min(config.max_speed.counts_per_second()));
        Ok(FocusRequest {
            method: Some(Method::Structure),
            range,
            speed: Some(speed.map_err(|error| error.to_string())?),
            pace: Some(Pace::Accurate),
            directions: Some(Directions::Both),
            ..FocusRequest::default()
        })
    }

    /// Waits for the focus run, and reads it.
    fn look(
        &mut self,
        mut differences: Vec<Difference>,
        controller: &Controller,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        if controller.snapshot().run.is_some() {
            self.step = Step::Focusing(differences);
            return;
        }
        match controller
            .report()
            .ok_or_else(|| "the focus run left no report".to_owned())
            .and_then(Difference::of)
        {
            Ok(difference) => {
                differences.push(difference);
                self.step = Step::Focus(differences);
            }
            Err(why) => {
                self.without_play(&why);
                self.go_back(now, actions);
            }
        }
    }

    fn without_play(&mut self, why: &str) {
        self.result.notes.push(format!("play was not measured: {why}"));
    }

    fn go_back(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        let [low, high] = self.ends.map(|end| end.0);
        let target = self.began_at.unwrap_or(self.ends[0]).0.clamp(low, high);
        self.step = Step::Back(self.go(LensPosition(target), now, actions));
    }
}

/// `settings` for a lens of which `calibration` is known.
pub(crate) fn apply(
    calibration: Option<&Calibration>,
    mut settings: ControllerConfig,
    speed_is_share: bool,
) -> ControllerConfig {
    let Some(known) = calibration else { return settings };
    let limits = settings.limits;
    let tolerance = settings.position_tolerance;
    // Limits were narrowed only where the lens did not get to them.
    let end = |limit: LensPosition, found: f64| {
        if limit.distance(LensPosition(found)) > 2.0 * tolerance { LensPosition(found) } else { limit }
    };
    let narrowed =
        evfocus_core::LensRange::new(end(limits.min(), known.range.min), end(limits.max(), known.range.max));
    settings.limits = narrowed
        .ok()
        .filter(|found| limits.contains(found.min()) && limits.contains(found.max()))
        .unwrap_or(limits);
    let said = settings.max_speed.counts_per_second();
    let differs =
        known.speed_counts_per_s < 0.98 * said || speed_is_share && known.speed_counts_per_s > 1.02 * said;
    if let (true, Ok(speed)) = (differs, LensSpeed::new(known.speed_counts_per_s)) {
        let is_full = settings.sweep_speed.counts_per_second() >= said;
        let is_too_fast = settings.sweep_speed.counts_per_second() > speed.counts_per_second();
        settings.max_speed = speed;
        if is_full || is_too_fast {
            settings.sweep_speed = speed;
        }
    }
    let latency = Duration::from_secs_f64((known.command_latency_us.max(0.0) / 1e6).min(60.0));
    let between = Duration::try_from_secs_f64(1.0 / known.read_back_hz.max(0.1)).unwrap_or_default();
    // A lens that is slow to obey, or to say so, does not stand still.
    settings.stall_timeout = settings.stall_timeout.max((latency + between) * 4);
    settings.silence_timeout = settings.silence_timeout.max(between * 10);
    settings.motion_slack += latency + Duration::from_secs_f64((known.stop_us.max(0.0) / 1e6).min(60.0));
    settings
}

//! Continuous mode: the controller starts runs by itself, and may be paused.

use alloc::vec::Vec;

use super::watcher::Watcher;
use super::{Action, Controller, ControllerConfig, FocusRequest, FocusState, Mode, Refusal, State};
use crate::event::{Geometry, Window};
use crate::event_list::Events;
use crate::lens_trace::LensSample;
use crate::report::{Outcome, RunId};
use crate::units::{HostMicros, LensPosition};

/// Two answers that differ by less than this share of the range are the same, or by less than the depth of focus.
const AS_GOOD_AS: f64 = 0.01;

/// Whether continuous mode may start runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PauseState {
    /// It may.
    #[default]
    Running,
    /// The run under way is the last one.
    Pausing,
    /// It may not.
    Paused,
}

/// How continuous mode is paused, and how it goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pause {
    /// At once; a run under way is aborted.
    Immediate,
    /// A run under way comes to its end first.
    Deferred,
    /// It goes on.
    Resume,
}

/// What continuous mode remembers.
#[derive(Debug)]
pub(super) struct Continuous {
    pub(super) watcher: Watcher,
    pub(super) pause: PauseState,
    /// How runs are made that nobody asked for: like the last one that somebody did ask for in this mode.
    pub(super) request: FocusRequest,
    /// Where the last run found focus.
    focus_at: Option<LensPosition>,
    /// Since when the lens has stood elsewhere.
    away_since: Option<HostMicros>,
    /// The run under way, if nobody asked for it.
    own_run: Option<RunId>,
    /// Runs that nobody asked for.
    pub(super) runs: u64,
}

impl Continuous {
    pub(super) fn new(config: &ControllerConfig, geometry: Geometry, now: HostMicros) -> Self {
        Self {
            watcher: Watcher::new(config.watch, geometry, now),
            pause: PauseState::Running,
            request: FocusRequest::default(),
            focus_at: None,
            away_since: None,
            own_run: None,
            runs: 0,
        }
    }
}

impl Controller {
    /// How sharp the picture is as a share of what it was when the lens came into focus; nothing unless continuous mode watches it and
    /// the scene has moved enough to tell.
    pub fn sharpness(&self) -> Option<f64> {
        self.continuous.watcher.share().filter(|_| self.is_watching())
    }

    /// How continuous mode makes its runs.
    pub fn continuous_request(&self) -> FocusRequest {
        self.continuous.request
    }

    fn is_watching(&self) -> bool {
        self.mode == Mode::Continuous
            && self.continuous.pause == PauseState::Running
            && self.outcome == FocusState::Focused
            && self.state == State::Idle
    }

    pub(super) fn enter_continuous(&mut self, now: HostMicros) {
        self.continuous.pause = PauseState::Running;
        self.continuous.request = FocusRequest::default();
        self.continuous.away_since = None;
        self.continuous.watcher.hurry(now);
        self.continuous.watcher.interrupt();
    }

    pub(super) fn pause(
        &mut self,
        pause: Pause,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<(), Refusal> {
        if self.mode != Mode::Continuous {
            return Err(Refusal::NotContinuous { mode: self.mode });
        }
        let under_way = self.run.is_some();
        match pause {
            Pause::Immediate => {
                if under_way {
                    self.abort(now, actions);
                }
                self.continuous.pause = PauseState::Paused;
            }
            Pause::Deferred if under_way => self.continuous.pause = PauseState::Pausing,
            Pause::Deferred => self.continuous.pause = PauseState::Paused,
            Pause::Resume => {
                if self.continuous.pause == PauseState::Paused {
                    self.continuous.watcher.hurry(now);
                    self.continuous.watcher.interrupt();
                    self.continuous.away_since = None;
                }
                self.continuous.pause = PauseState::Running;
            }
        }
        Ok(())
    }

    /// Events came while there was no run.
    pub(super) fn watch_events(&mut self, events: Events<'_>, now: HostMicros) {
        if self.is_watching() {
            self.continuous.watcher.take(events, now);
        }
    }

    /// Starts a run if focus is not known, or lost for long enough, and the last run is long enough ago.
    pub(super) fn watch_focus(&mut self, now: HostMicros, actions: &mut Vec<Action>) {
        if self.mode != Mode::Continuous || self.continuous.pause != PauseState::Running || !self.camera_ready
        {
            return;
        }
        let Some(lens) = self.lens.filter(|lens| self.lens_ready && !lens.moving) else { return };
        let is_lost = self.is_away(&lens, now) || self.continuous.watcher.is_lost(now);
        let is_known = self.outcome == FocusState::Focused && self.continuous.focus_at.is_some();
        if is_known && !is_lost || !self.continuous.watcher.may_run(now) {
            return;
        }
        let plan = self.continuous.request.resolve(&self.config, self.geometry);
        if let Ok(run) = plan.and_then(|plan| self.start(plan, now, actions)) {
            self.continuous.own_run = Some(run);
            self.continuous.runs += 1;
        } else {
            // The settings have changed, and the request does not suit them any more.
            self.continuous.request = FocusRequest::default();
            self.continuous.watcher.run_ended(false, now);
        }
    }

    /// Whether the lens has stood for a while where nothing was found to be sharp.
    fn is_away(&mut self, lens: &LensSample, now: HostMicros) -> bool {
        let tolerance = 2.0 * self.config.position_tolerance;
        let is_away = self.continuous.focus_at.is_some_and(|at| lens.position.distance(at) > tolerance);
        if !is_away {
            self.continuous.away_since = None;
            return false;
        }
        let since = *self.continuous.away_since.get_or_insert(now);
        now.since(since) >= self.continuous.watcher.patience()
    }

    /// A run ended with `outcome` that began at `before` and looked for focus in `window`.
    pub(super) fn note_outcome(
        &mut self,
        outcome: Outcome,
        before: LensPosition,
        window: Option<Window>,
        now: HostMicros,
    ) {
        let is_own = self.continuous.own_run.take().is_some();
        self.continuous.away_since = None;
        if self.continuous.pause == PauseState::Pausing {
            self.continuous.pause = PauseState::Paused;
        }
        let Outcome::Focused { position } = outcome else {
            self.continuous.focus_at = None;
            self.continuous.watcher.run_ended(false, now);
            return;
        };
        let there = self.lens.map_or(position, |lens| lens.position);
        self.continuous.focus_at = Some(there);
        self.continuous.watcher.learn(window, now);
        // A run that found what was there before was not needed, and the next one is likely to be as idle.
        let found_news =
            there.distance(before) > self.config.depth_of_focus.max(AS_GOOD_AS * self.config.limits.length());
        self.continuous.watcher.run_ended(found_news || !is_own, now);
    }
}

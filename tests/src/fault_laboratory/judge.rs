//! What must hold whatever goes wrong.

use std::time::Duration;

use evfocus_core::controller::{Accepted, Command, FocusState};
use evfocus_core::{HostMicros, LensPosition, Outcome, RunId};
use evfocusd::VirtualRig;

use super::devices::Witness;
use super::{Ended, moves};

/// A run that takes longer hangs. Homing may take 30 s, and a sweep there and back 6 s each.
const LONGEST_RUN: Duration = Duration::from_secs(75);
/// By when the lens stands still once nobody wants it to move: coasting, and a second until a lens that failed is tried again.
const STILL_AFTER: Duration = Duration::from_millis(2500);
/// What a motion that a client ordered may take.
const MOTION: Duration = Duration::from_secs(8);
/// Slower than this, counts in a millisecond, the glass stands still; backlash and vibration are not motions.
const STILL: f64 = 0.2;

/// Watches a trial.
#[derive(Debug, Default)]
pub(super) struct Judge {
    outcomes: Vec<&'static str>,
    broken: Vec<String>,
    run: Option<(RunId, HostMicros)>,
    /// From when on the lens has no reason to move.
    idle_since: Option<HostMicros>,
    moving_until: Option<HostMicros>,
    glass: Option<LensPosition>,
}

impl Judge {
    /// Gives `rig` a command, as a client does.
    pub(super) fn command(&mut self, rig: &mut VirtualRig, command: Command, _age: Duration) {
        match rig.command(command) {
            Ok(accepted) => {
                if moves(command, accepted) {
                    self.moving_until = Some(rig.now() + MOTION);
                } else if matches!(command, Command::Abort | Command::SetMode(_)) {
                    self.moving_until = None;
                    self.idle_since = Some(rig.now());
                }
                if let Accepted::Started(run) | Accepted::UnderWay(run) = accepted
                    && self.run.is_none()
                {
                    self.run = Some((run, rig.now()));
                }
            }
            Err(_refused) => {}
        }
        self.note_end(rig);
    }

    /// Looks at the rig after a step.
    pub(super) fn watch(&mut self, rig: &VirtualRig, witness: &Witness, age: Duration) {
        let now = rig.now();
        self.note_end(rig);
        if let Some((run, since)) = self.run
            && now.since(since) > LONGEST_RUN
        {
            let phase = rig.controller().snapshot().phase;
            self.broken.push(format!("run {run} hangs in {phase:?}"));
        }
        if witness.was_out_of_range() {
            self.broken.push("the lens was sent out of its range".to_owned());
        }
        let glass = rig.rig().glass(now);
        let step = self.glass.replace(glass).map_or(0.0, |before| glass.counts_from(before).abs());
        let may_move = self.run.is_some() || self.moving_until.is_some_and(|until| now < until);
        if may_move {
            self.idle_since = None;
        }
        let idle_since = *self.idle_since.get_or_insert(now);
        // A motor that no order reaches goes on to where it was told to go, and nobody can help it.
        if !may_move && !witness.has_unheard_order() && now.since(idle_since) > STILL_AFTER && step > STILL {
            let at = (now + age).0;
            self.broken.push(format!(
                "the lens moves with nobody wanting it, {step:.1} counts a millisecond at {at} us"
            ));
        }
    }

    /// Whether a run has ended, and with a report.
    fn note_end(&mut self, rig: &VirtualRig) {
        let Some((run, _)) = self.run else { return };
        let snapshot = rig.controller().snapshot();
        if snapshot.run == Some(run) {
            return;
        }
        self.run = snapshot.run.map(|next| (next, rig.now()));
        match rig.controller().report().filter(|report| report.id == run) {
            Some(report) => self.outcomes.push(match report.outcome {
                Outcome::Focused { .. } => "focused",
                Outcome::Failed(failure) => failure.name(),
                Outcome::Aborted => "aborted",
            }),
            None => self.broken.push(format!("run {run} ended without a report")),
        }
        if snapshot.state == FocusState::Scanning && snapshot.run.is_none() {
            self.broken.push("the state is scanning without a run".to_owned());
        }
    }

    /// No event is lost uncounted.
    pub(super) fn count(&mut self, rig: &VirtualRig, witness: &Witness) {
        let (events, lost) = witness.events_and_lost();
        let snapshot = rig.controller().snapshot();
        if (snapshot.events, snapshot.lost) != (events, lost) {
            self.broken.push(format!(
                "{events} events and {lost} lost went in, {} and {} were counted",
                snapshot.events, snapshot.lost
            ));
        }
    }

    /// The process was killed: its run has no end.
    pub(super) fn killed(&mut self) {
        if self.run.take().is_some() {
            self.outcomes.push("killed");
        }
        (self.idle_since, self.moving_until, self.glass) = (None, None, None);
    }

    /// Whether no run is under way and the lens has had its time to come to rest.
    pub(super) fn is_settled(&self) -> bool {
        self.run.is_none()
    }

    /// Enough is broken.
    pub(super) fn is_hopeless(&self) -> bool {
        self.broken.len() > 3
    }

    pub(super) fn verdict(self) -> Ended {
        Ended { outcomes: self.outcomes, broken: self.broken }
    }
}

//! What must hold whatever goes wrong.

use std::time::Duration;

use evfocus_core::controller::{Accepted, Command, FocusState, Mode, PauseState, Snapshot};
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
/// What a trial may ask for beyond what it holds at the start, bytes: curves, reports, and what the simulated link holds back.
const MOST_GROWN: i64 = 16 << 20;

/// Watches a trial.
#[derive(Debug, Default)]
pub(super) struct Judge {
    outcomes: Vec<&'static str>,
    broken: Vec<String>,
    /// A run has ended, and nobody has taken note.
    ended: bool,
    grown: i64,
    run: Option<(RunId, HostMicros)>,
    /// From when on the lens has no reason to move.
    idle_since: Option<HostMicros>,
    moving_until: Option<HostMicros>,
    glass: Option<LensPosition>,
}

impl Judge {
    /// Gives `rig` a command, as a client does.
    pub(super) fn command(&mut self, rig: &mut VirtualRig, command: Command) {
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
            // What is away cannot be focused with: whoever asks is told.
            Err(_) if matches!(command, Command::Focus(_)) => self.outcomes.push("refused"),
            Err(_) => {}
        }
        self.note_end(rig);
    }

    /// Looks at the rig after a step.
    pub(super) fn watch(&mut self, rig: &VirtualRig, witness: &Witness, age: Duration) {
        let now = rig.now();
        self.note_end(rig);
        self.note_beginning(&rig.controller().snapshot(), now);
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

    /// Whether a run has begun by itself, and whether it may.
    fn note_beginning(&mut self, snapshot: &Snapshot, now: HostMicros) {
        let Some(run) = snapshot.run.filter(|_| self.run.is_none()) else { return };
        self.run = Some((run, now));
        if (snapshot.mode, snapshot.pause) != (Mode::Continuous, PauseState::Running) {
            let Snapshot { mode, pause, .. } = snapshot;
            self.broken.push(format!("run {run} has begun by itself, in mode {mode:?} and {pause:?}"));
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
        self.ended = true;
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

    /// Whether a run has ended since this was asked last.
    pub(super) fn take_ended(&mut self) -> bool {
        std::mem::take(&mut self.ended)
    }

    /// Memory has grown by so many bytes.
    pub(super) fn weigh(&mut self, grown: i64) {
        if grown > MOST_GROWN && self.grown <= MOST_GROWN {
            self.broken.push(format!("memory has grown by {} MiB", grown >> 20));
        }
        self.grown = self.grown.max(grown);
    }

    /// What is wrong elsewhere.
    pub(super) fn blame(&mut self, wrong: Vec<String>) {
        self.broken.extend(wrong);
    }

    /// Time has gone by in which nothing was looked at, and the lens could not be stopped.
    pub(super) fn starved(&mut self) {
        (self.idle_since, self.glass) = (None, None);
    }

    /// The process was killed: its run has no end.
    pub(super) fn killed(&mut self) {
        if self.run.take().is_some() {
            self.outcomes.push("killed");
        }
        (self.idle_since, self.moving_until, self.glass) = (None, None, None);
        self.ended = false;
    }

    /// Whether no run is under way and the lens has had its time to come to rest.
    pub(super) fn is_settled(&self) -> bool {
        self.run.is_none()
    }

    /// Enough is broken.
    pub(super) fn is_hopeless(&self) -> bool {
        self.broken.len() > 3
    }

    pub(super) fn verdict(self, lasted: Duration) -> Ended {
        let grown = self.grown.max(0).unsigned_abs();
        Ended { outcomes: self.outcomes, broken: self.broken, lasted, grown }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use evfocus_core::controller::FocusRequest;
    use evfocusd::Config;
    use evfocusd::devices::Devices;

    use super::super::devices::{FaultyCamera, FaultyLens};
    use super::*;

    fn rig() -> (VirtualRig, Arc<Witness>) {
        let mut config = Config::simulated().unwrap();
        config.rig.sensor.geometry = super::super::draw::GEOMETRY;
        let witness = Arc::new(Witness::new(config.rig.lens.range));
        let rig = VirtualRig::with_devices(&config, |rig, clock| {
            let (camera, lens) = rig.devices();
            Ok(Devices {
                camera: Box::new(FaultyCamera::new(
                    camera,
                    Vec::new(),
                    Arc::clone(&clock),
                    Arc::clone(&witness),
                )),
                lens: Box::new(FaultyLens::new(lens, Vec::new(), clock, Arc::clone(&witness))),
            })
        });
        (rig.unwrap(), witness)
    }

    #[test]
    fn a_lens_that_moves_with_nobody_wanting_it_is_noticed() {
        let ((mut rig, witness), mut judge) = (rig(), Judge::default());
        for _ in 0..3_000 {
            rig.step();
            judge.watch(&rig, &witness, Duration::ZERO);
        }
        assert!(judge.broken.is_empty(), "{:?}", judge.broken);
        // Behind the judge's back.
        let far = rig.rig().config().lens.range.max();
        rig.command(Command::MoveTo(far)).unwrap();
        for _ in 0..200 {
            rig.step();
            judge.watch(&rig, &witness, Duration::ZERO);
        }
        assert!(judge.broken.iter().any(|what| what.contains("nobody wanting it")), "{:?}", judge.broken);
    }

    #[test]
    fn events_that_were_not_counted_and_runs_without_a_report_are_noticed() {
        let ((mut rig, _), mut judge) = (rig(), Judge::default());
        rig.run_for(Duration::from_millis(300));
        judge.count(&rig, &Witness::new(rig.rig().config().lens.range));
        assert!(judge.broken.iter().any(|what| what.contains("were counted")), "{:?}", judge.broken);
        rig.command(Command::Focus(FocusRequest::default())).unwrap();
        rig.command(Command::Abort).unwrap();
        judge.run = Some((RunId(77), rig.now()));
        judge.note_end(&rig);
        assert!(judge.broken.iter().any(|what| what.contains("without a report")), "{:?}", judge.broken);
    }
}

//! `evfocus-control`: feeds the controller and does what it decides.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command as CoreCommand, Input, Pace, Refusal, Snapshot};
use evfocus_core::{
    Controller, CurvePoint, DelayModel, EventBatch, Geometry, HostMicros, LensRange, LensSample, RunId,
    RunReport,
};
use evfocus_hal::Clock;
use evfocus_ipc as ipc;
use rtrb::{Consumer, Producer};
use tokio::sync::{mpsc, watch};

use super::orders::OrderSender;
use super::{Notice, StopFlag};
use crate::calibration::{CalibrationFailure, Desk};
use crate::config::Config;
use crate::handle::{Answer, Command};
use crate::vitals::Vitals;
use crate::wire;

/// How long the thread sleeps in a run unless somebody wakes it: time wakes nobody.
const NAP: Duration = Duration::from_millis(2);
/// The same between runs: nor do commands.
const IDLE_NAP: Duration = Duration::from_millis(6);
/// How often the state is published while nothing changes but numbers.
const PUBLISH: Duration = Duration::from_millis(20);
/// Actions one input can bring about, with room to spare.
const ACTIONS: usize = 16;
/// Curve points on their way to the followers.
pub(crate) const CURVE_POINTS: usize = 4_096;
/// Reports on their way to the disk.
pub(crate) const REPORTS: usize = 16;

/// What leaves the control thread for the socket's side.
#[derive(Debug)]
pub(crate) struct Publications {
    /// The state, a few dozen times a second.
    pub(crate) seen: watch::Sender<Seen>,
    /// The live curve.
    pub(crate) curve: Producer<(RunId, CurvePoint)>,
    /// The record of each run.
    pub(crate) reports: mpsc::Sender<Box<EndedRun>>,
    /// What was measured of the lens, with whom to tell.
    pub(crate) calibrations: mpsc::Sender<Calibrated>,
}

/// What can be seen from outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Seen {
    /// Of the controller.
    pub(crate) snapshot: Snapshot,
    /// Whether the lens is being calibrated.
    pub(crate) calibrating: bool,
    /// Where the lens may go: as configured, and as far as it was found to go.
    pub(crate) limits: LensRange,
    /// Whether the lens is on its way, or was sent and has not been asked since it set out.
    pub(crate) lens_moving: bool,
}

/// A lens that was calibrated.
#[derive(Debug)]
pub(crate) struct Calibrated {
    /// What was measured.
    pub(crate) calibration: ipc::Calibration,
    /// Who asked for it.
    pub(crate) answer: Answer<ipc::Calibration>,
}

/// A run that ended, with what its record does not hold.
#[derive(Debug)]
pub(crate) struct EndedRun {
    /// Its record.
    pub(crate) report: RunReport,
    /// How late the pixels are, as far as this run and those before have taught.
    pub(crate) delays: DelayModel,
    /// How thorough it was to be.
    pub(crate) pace: Pace,
}

/// The thread's ends of its queues.
pub(crate) struct ControlThread {
    /// The state machine.
    pub(crate) controller: Controller,
    /// Of the camera.
    pub(crate) geometry: Geometry,
    /// How thorough the run under way, or the last one, is.
    pub(crate) pace: Pace,
    /// Host time.
    pub(crate) clock: Arc<dyn Clock>,
    /// Filled batches come here.
    pub(crate) filled: Consumer<EventBatch>,
    /// Empty batches go back.
    pub(crate) empty: Producer<EventBatch>,
    /// The lens's answers come here.
    pub(crate) samples: Consumer<LensSample>,
    /// Health of camera and lens.
    pub(crate) notices: [Consumer<Notice>; 2],
    /// Commands from the socket.
    pub(crate) commands: mpsc::Receiver<Command>,
    /// Orders to the lens.
    pub(crate) orders: OrderSender,
    /// Settings that wait for the end of the run under way.
    pub(crate) new_settings: Option<Box<Config>>,
    /// Shows others that this thread makes progress, and how fast.
    pub(crate) vitals: Vitals,
    /// To the socket's side.
    pub(crate) publications: Publications,
    /// What was measured of the lens, and measures it.
    pub(crate) desk: Desk,
    /// Who waits for the calibration under way.
    pub(crate) calibration_asked: Option<Answer<ipc::Calibration>>,
    /// When to end.
    pub(crate) stop: StopFlag,
}

impl std::fmt::Debug for ControlThread {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ControlThread").field("controller", &self.controller).finish_non_exhaustive()
    }
}

impl ControlThread {
    /// Runs until stopped; a run under way is aborted then. Dropping the orders' queue stops the lens.
    pub(crate) fn run(mut self) {
        let mut actions = Vec::with_capacity(ACTIONS);
        let mut published = (HostMicros(i64::MIN), self.seen());
        let mut curve_sent = (RunId(0), 0);
        while !self.stop.is_stopped() {
            let is_busy = self.controller.snapshot().run.is_some() || self.desk.is_calibrating();
            std::thread::park_timeout(if is_busy { NAP } else { IDLE_NAP });
            self.vitals.waiting(self.filled.slots(), self.samples.slots());
            self.take_notices(&mut actions);
            self.take_samples(&mut actions);
            self.take_batches(&mut actions);
            self.tick(&mut actions);
            self.calibrate(&mut actions);
            self.take_commands(&mut actions);
            self.publish_curve(&mut curve_sent);
            self.take_settings();
            self.publish(&mut published);
            self.vitals.beat();
        }
        if let Some(answer) = self.calibration_asked.take() {
            reply(answer, Err(ipc::Error::ShuttingDown {}));
        }
        if self.controller.command(CoreCommand::Abort, self.clock.now(), &mut actions).is_ok() {
            self.perform(&mut actions);
        }
    }

    fn tick(&mut self, actions: &mut Vec<Action>) {
        let before = self.controller.snapshot();
        self.controller.handle(Input::Tick, self.clock.now(), actions);
        let Snapshot { continuous_runs, run, .. } = self.controller.snapshot();
        if continuous_runs != before.continuous_runs {
            let pace = self.controller.continuous_request().pace;
            self.pace = pace.unwrap_or(self.controller.config().pace);
            let (run, sharpness) = (run.map(|run| run.0), before.sharpness);
            tracing::debug!(run, sharpness, "focus is not known, or lost: a run starts by itself");
        }
        self.perform(actions);
    }

    fn take_notices(&mut self, actions: &mut Vec<Action>) {
        for queue in &mut self.notices {
            while let Ok(notice) = queue.pop() {
                let input = match notice {
                    Notice::CameraFailed(failure) => Input::CameraFailed(failure),
                    Notice::CameraReady => Input::CameraReady,
                    Notice::LensFailed(failure) => Input::LensFailed(failure),
                    Notice::LensReady => Input::LensReady,
                };
                if let Notice::LensFailed(failure) = notice {
                    self.desk.lens_failed(failure);
                }
                self.controller.handle(input, self.clock.now(), actions);
            }
        }
    }

    fn take_samples(&mut self, actions: &mut Vec<Action>) {
        while let Ok(sample) = self.samples.pop() {
            self.desk.sample(sample);
            self.controller.handle(Input::Lens(sample), self.clock.now(), actions);
        }
    }

    fn take_batches(&mut self, actions: &mut Vec<Action>) {
        while let Ok(mut batch) = self.filled.pop() {
            self.controller.handle(Input::Batch(&batch), self.clock.now(), actions);
            self.vitals.latency(self.clock.now().since(batch.arrival));
            batch.clear();
            // There is a place for every batch, so the way back is never full.
            if self.empty.push(batch).is_err() {
                tracing::error!("a batch did not find its way back");
            }
        }
    }

    fn take_commands(&mut self, actions: &mut Vec<Action>) {
        while let Ok(command) = self.commands.try_recv() {
            let now = self.clock.now();
            if self.desk.is_calibrating() {
                self.command_while_calibrating(command);
                continue;
            }
            match command {
                Command::Focus { request, answer } => {
                    reply(answer, self.focus(&request, now, actions));
                }
                Command::Abort { answer } => {
                    let run = self.controller.snapshot().run;
                    let done = self.controller.command(CoreCommand::Abort, now, actions);
                    reply(
                        answer,
                        done.map(|_| run.map(|run| run.0)).map_err(|refusal| wire::refusal(&refusal)),
                    );
                }
                Command::MoveTo { position, answer } => {
                    let target = evfocus_core::LensPosition(position);
                    let done = self.controller.command(CoreCommand::MoveTo(target), now, actions);
                    reply(answer, done.map(|_| ()).map_err(|refusal| wire::refusal(&refusal)));
                }
                Command::Calibrate { answer } => self.begin_calibration(answer, now, actions),
                Command::SetMode { mode, answer } => {
                    let done =
                        self.controller.command(CoreCommand::SetMode(wire::core_mode(mode)), now, actions);
                    reply(answer, done.map(|_| ()).map_err(|refusal| wire::refusal(&refusal)));
                }
                Command::Pause { pause, answer } => {
                    let done = self.controller.command(CoreCommand::Pause(pause), now, actions);
                    reply(answer, done.map(|_| ()).map_err(|refusal| wire::refusal(&refusal)));
                }
                Command::Configure { config } => self.new_settings = Some(config),
            }
            self.perform(actions);
        }
    }

    /// New settings must not change a run under way.
    fn take_settings(&mut self) {
        if self.controller.snapshot().run.is_some() || self.desk.is_calibrating() {
            return;
        }
        let Some(config) = self.new_settings.take() else { return };
        self.desk.configure(*config);
        match self.desk.settings() {
            // No run is under way.
            Ok(settings) => {
                self.controller.reconfigure(settings);
            }
            Err(error) => {
                tracing::error!(%error, "the new settings do not suit the lens as it was calibrated");
            }
        }
    }

    fn focus(
        &mut self,
        request: &ipc::FocusRequest,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) -> Result<u64, ipc::Error> {
        let request = wire::focus_request(request, self.geometry)?;
        match self.controller.command(CoreCommand::Focus(request), now, actions) {
            Ok(Accepted::Started(run)) => {
                self.pace = request.pace.unwrap_or(self.controller.config().pace);
                Ok(run.0)
            }
            Ok(Accepted::UnderWay(run)) => Ok(run.0),
            Ok(Accepted::Done) => Ok(0),
            Err(refusal) => Err(wire::refusal(&refusal)),
        }
    }

    fn begin_calibration(
        &mut self,
        answer: Answer<ipc::Calibration>,
        now: HostMicros,
        actions: &mut Vec<Action>,
    ) {
        let Snapshot { run, lens_ready, .. } = self.controller.snapshot();
        let refused = if let Some(run) = run {
            ipc::Error::Busy { run_id: run.0 }
        } else if !lens_ready {
            wire::refusal(&Refusal::NoLens)
        } else if let Err(remedy) = self.desk.begin(&mut self.controller, now, actions) {
            ipc::Error::NotPermitted { what: "calibrating".to_owned(), remedy }
        } else {
            // That of its focus runs.
            self.pace = Pace::Accurate;
            self.calibration_asked = Some(answer);
            return;
        };
        reply(answer, Err(refused));
    }

    /// Goes on with the calibration under way.
    fn calibrate(&mut self, actions: &mut Vec<Action>) {
        let ended = self.desk.advance(&mut self.controller, self.clock.now(), actions);
        self.perform(actions);
        let Some(ended) = ended else { return };
        let Some(answer) = self.calibration_asked.take() else { return };
        match ended {
            Ok(calibration) => {
                let told = Calibrated { calibration, answer };
                if self.publications.calibrations.try_send(told).is_err() {
                    tracing::error!("the calibration was not taken and is kept in memory only");
                }
            }
            Err(CalibrationFailure { reason, message }) => {
                tracing::warn!(reason, message, "the lens was not calibrated");
                reply(answer, Err(ipc::Error::CalibrationFailed { reason: reason.to_owned(), message }));
            }
        }
    }

    /// A command during a calibration: only an abort is taken.
    fn command_while_calibrating(&mut self, command: Command) {
        let refused = || ipc::Error::NotPermitted {
            what: "this while the lens is being calibrated".to_owned(),
            remedy: "wait for its end, or abort it".to_owned(),
        };
        match command {
            Command::Abort { answer } => {
                self.desk.abort();
                reply(answer, Ok(None));
            }
            Command::Focus { answer, .. } => reply(answer, Err(refused())),
            Command::MoveTo { answer, .. }
            | Command::SetMode { answer, .. }
            | Command::Pause { answer, .. } => reply(answer, Err(refused())),
            Command::Calibrate { answer } => reply(answer, Err(refused())),
            Command::Configure { config } => self.new_settings = Some(config),
        }
    }

    fn perform(&mut self, actions: &mut Vec<Action>) {
        for action in actions.drain(..) {
            if action == Action::RunEnded {
                self.hand_over_report();
            } else {
                self.orders.send(self.desk.order(action, &self.controller));
            }
        }
    }

    fn hand_over_report(&mut self) {
        let Some(report) = self.controller.report().cloned() else { return };
        let run = report.id.0;
        let ended = EndedRun { report, delays: self.controller.delays(), pace: self.pace };
        if self.publications.reports.try_send(Box::new(ended)).is_err() {
            tracing::error!(run, "the report was not taken and is lost");
        }
    }

    /// Sends the points of the live curve that have come since the last time.
    fn publish_curve(&mut self, sent: &mut (RunId, usize)) {
        let Some(run) = self.controller.snapshot().run else { return };
        let curve = self.controller.live_curve();
        if sent.0 != run || sent.1 > curve.len() {
            *sent = (run, 0);
        }
        for point in curve.get(sent.1..).unwrap_or_default() {
            // Followers that are this far behind are told so by their own queue; the report has every point.
            if self.publications.curve.push((run, *point)).is_err() {
                break;
            }
            sent.1 += 1;
        }
    }

    fn seen(&self) -> Seen {
        let snapshot = self.controller.snapshot();
        Seen {
            snapshot,
            calibrating: self.desk.is_calibrating(),
            limits: self.controller.config().limits,
            lens_moving: snapshot
                .lens
                .is_some_and(|lens| lens.moving || lens.requested < self.orders.obeyed()),
        }
    }

    fn publish(&mut self, published: &mut (HostMicros, Seen)) {
        let (now, seen) = (self.clock.now(), self.seen());
        let state = |seen: &Seen| {
            let Snapshot { mode, pause, state, phase, run, .. } = seen.snapshot;
            (mode, pause, state, phase, run, seen.calibrating, seen.lens_moving)
        };
        let changed = state(&seen) != state(&published.1);
        if changed || now.since(published.0) >= PUBLISH {
            *published = (now, seen);
            self.publications.seen.send_replace(seen);
        }
    }
}

/// Answers a client, who may have gone.
fn reply<Value>(answer: Answer<Value>, value: Result<Value, ipc::Error>) {
    if answer.send(value).is_err() {
        tracing::debug!("a client went before its answer");
    }
}

//! `evfocus-control`: feeds the controller and does what it decides.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command as CoreCommand, Input, Pace, Snapshot};
use evfocus_core::{
    Controller, ControllerConfig, CurvePoint, DelayModel, EventBatch, Geometry, HostMicros, LensSample,
    RunId, RunReport,
};
use evfocus_hal::Clock;
use evfocus_ipc as ipc;
use rtrb::{Consumer, Producer};
use tokio::sync::{mpsc, watch};

use super::orders::OrderSender;
use super::{Notice, StopFlag};
use crate::handle::Command;
use crate::vitals::Vitals;
use crate::wire;

/// How long the thread sleeps unless somebody wakes it: commands wake nobody.
const NAP: Duration = Duration::from_millis(2);
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
    pub(crate) snapshots: watch::Sender<Snapshot>,
    /// The live curve.
    pub(crate) curve: Producer<(RunId, CurvePoint)>,
    /// The record of each run.
    pub(crate) reports: mpsc::Sender<Box<EndedRun>>,
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
    pub(crate) new_settings: Option<Box<ControllerConfig>>,
    /// Shows others that this thread makes progress, and how fast.
    pub(crate) vitals: Vitals,
    /// To the socket's side.
    pub(crate) publications: Publications,
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
        let mut published = (HostMicros(i64::MIN), self.controller.snapshot());
        let mut curve_sent = (RunId(0), 0);
        while !self.stop.is_stopped() {
            std::thread::park_timeout(NAP);
            self.vitals.waiting(self.filled.slots(), self.samples.slots());
            self.take_notices(&mut actions);
            self.take_samples(&mut actions);
            self.take_batches(&mut actions);
            self.controller.handle(Input::Tick, self.clock.now(), &mut actions);
            self.perform(&mut actions);
            self.take_commands(&mut actions);
            self.publish_curve(&mut curve_sent);
            self.take_settings();
            self.publish(&mut published);
            self.vitals.beat();
        }
        if self.controller.command(CoreCommand::Abort, self.clock.now(), &mut actions).is_ok() {
            self.perform(&mut actions);
        }
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
                self.controller.handle(input, self.clock.now(), actions);
            }
        }
    }

    fn take_samples(&mut self, actions: &mut Vec<Action>) {
        while let Ok(sample) = self.samples.pop() {
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
                Command::SetMode { mode, answer } => {
                    let done =
                        self.controller.command(CoreCommand::SetMode(wire::core_mode(mode)), now, actions);
                    reply(answer, done.map(|_| ()).map_err(|refusal| wire::refusal(&refusal)));
                }
                Command::Configure { settings } => self.new_settings = Some(settings),
            }
            self.perform(actions);
        }
    }

    /// New settings must not change a run under way.
    fn take_settings(&mut self) {
        if self.controller.snapshot().run.is_none()
            && let Some(settings) = self.new_settings.take()
        {
            self.controller.reconfigure(*settings);
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

    fn perform(&mut self, actions: &mut Vec<Action>) {
        for action in actions.drain(..) {
            if action == Action::RunEnded {
                self.hand_over_report();
            } else {
                self.orders.send(action);
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

    fn publish(&mut self, published: &mut (HostMicros, Snapshot)) {
        let (now, snapshot) = (self.clock.now(), self.controller.snapshot());
        let changed = (snapshot.mode, snapshot.state, snapshot.phase, snapshot.run)
            != (published.1.mode, published.1.state, published.1.phase, published.1.run);
        if changed || now.since(published.0) >= PUBLISH {
            *published = (now, snapshot);
            self.publications.snapshots.send_replace(snapshot);
        }
    }
}

/// Answers a client, who may have gone.
fn reply<Value>(answer: crate::handle::Answer<Value>, value: Result<Value, ipc::Error>) {
    if answer.send(value).is_err() {
        tracing::debug!("a client went before its answer");
    }
}

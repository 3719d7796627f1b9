//! The simulated rig and the controller on one thread, in virtual time: the same loop as the daemon's, as fast as it can, and the
//! same every time.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::controller::{Accepted, Action, Command, FocusRequest, Input, Pace, Refusal, Snapshot};
use evfocus_core::{Controller, CurvePoint, EventBatch, HostMicros, LensPosition, RunReport};
use evfocus_hal::{Camera, Clock, DeviceError, Lens, VirtualClock};
use evfocus_ipc::{self as ipc, Calibration};

use crate::calibration::{CalibrationFailure, Desk};
use crate::config::Config;
use crate::devices::{self, Devices};
use crate::threads::control::EndedRun;
use crate::wire;

/// Virtual time from one look at the camera to the next: the period of the simulated link's transfers.
const STEP: Duration = Duration::from_millis(1);
/// Virtual time without news after which the devices are given up before a run.
const START_UP: Duration = Duration::from_secs(1);
/// How often a device that failed is tried again.
const RETRY: Duration = Duration::from_secs(1);
/// Events a batch holds: 1 ms at 65 million events a second.
const BATCH_EVENTS: usize = 65_536;

/// What a run in virtual time could not do.
#[derive(Debug, thiserror::Error)]
pub enum VirtualRigError {
    /// The rig makes no sense.
    #[error(transparent)]
    Config(#[from] hil_sim::ConfigError),
    /// The settings do not suit the lens.
    #[error("{0}")]
    Settings(String),
    /// A device failed before there was a run.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// The controller refused.
    #[error(transparent)]
    Refused(#[from] Refusal),
}

/// A rig with its controller.
pub struct VirtualRig {
    clock: Arc<VirtualClock>,
    rig: hil_sim::Rig,
    camera: Box<dyn Camera>,
    lens: Box<dyn Lens>,
    controller: Controller,
    desk: Desk,
    batch: EventBatch,
    actions: Vec<Action>,
    lens_poll: Duration,
    next_poll: HostMicros,
    /// When a device that failed is tried again.
    camera_failed: Option<HostMicros>,
    lens_failed: Option<HostMicros>,
    lens_error: Option<DeviceError>,
}

impl std::fmt::Debug for VirtualRig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VirtualRig").field("rig", &self.rig).finish_non_exhaustive()
    }
}

impl VirtualRig {
    /// The rig of `config`, started.
    ///
    /// # Errors
    /// [`VirtualRigError`] if the configuration makes no sense or a device does not start.
    pub fn new(config: &Config) -> Result<Self, VirtualRigError> {
        Self::with_camera(config, |rig, _| Ok(Box::new(rig.devices().0)))
    }

    /// The rig of `config`, whose lens is what `open` makes of it: a driver and an emulated controller that things happen to, say.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_lens(
        config: &Config,
        open: impl FnOnce(&hil_sim::Rig, Arc<dyn Clock>) -> Result<Box<dyn Lens>, DeviceError>,
    ) -> Result<Self, VirtualRigError> {
        Self::with_devices(config, |rig, clock| {
            Ok(Devices { camera: Box::new(rig.devices().0), lens: open(rig, clock)? })
        })
    }

    /// The rig of `config`, seen through the camera that `open` makes of it: a driver and an emulated device, say.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_camera(
        config: &Config,
        open: impl FnOnce(&hil_sim::Rig, Arc<dyn Clock>) -> Result<Box<dyn Camera>, DeviceError>,
    ) -> Result<Self, VirtualRigError> {
        Self::with_devices(config, |rig, clock| {
            let camera = open(rig, Arc::clone(&clock))?;
            Ok(Devices { camera, lens: devices::open_lens(&config.lens, rig, &clock)? })
        })
    }

    /// The rig of `config` with the devices that `open` makes of it.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn with_devices(
        config: &Config,
        open: impl FnOnce(&hil_sim::Rig, Arc<dyn Clock>) -> Result<Devices, DeviceError>,
    ) -> Result<Self, VirtualRigError> {
        let clock = Arc::new(VirtualClock::new());
        let rig = hil_sim::Rig::new(config.rig.clone(), clock.clone())?;
        let Devices { mut camera, lens } = open(&rig, clock.clone())?;
        camera.start()?;
        let desk = Desk::new(config.clone(), lens.info(), None);
        let settings = desk.settings().map_err(|bad| VirtualRigError::Settings(bad.to_string()))?;
        let mut virtual_rig = Self {
            controller: Controller::new(settings, camera.info().geometry, clock.now()),
            clock,
            rig,
            camera,
            lens,
            desk,
            batch: EventBatch::with_capacity(BATCH_EVENTS),
            actions: Vec::with_capacity(16),
            lens_poll: config.lens_poll,
            next_poll: HostMicros(0),
            camera_failed: None,
            lens_failed: None,
            lens_error: None,
        };
        // The daemon's clocks have long been related when somebody asks for focus.
        virtual_rig.run_for(START_UP);
        Ok(virtual_rig)
    }

    /// The glass positions at which the scene is sharp, which only the simulator knows.
    pub fn truth(&self) -> Vec<LensPosition> {
        self.rig.truth()
    }

    /// The simulator.
    pub fn rig(&self) -> &hil_sim::Rig {
        &self.rig
    }

    /// The controller.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// Virtual time.
    pub fn now(&self) -> HostMicros {
        self.clock.now()
    }

    /// Gives the controller a command.
    ///
    /// # Errors
    /// The controller's [`Refusal`].
    pub fn command(&mut self, command: Command) -> Result<Accepted, Refusal> {
        let now = self.clock.now();
        let accepted = self.controller.command(command, now, &mut self.actions)?;
        self.perform();
        Ok(accepted)
    }

    /// The record of the last run as the daemon would write it to its state directory, had `pace` been asked for and were it 1970.
    pub fn written_report(&self, pace: Pace) -> Option<ipc::Report> {
        let (camera, lens) = (self.camera.info(), self.lens.info());
        let devices = ipc::RunDevices {
            camera: devices::name(&camera.model, &camera.serial),
            lens: devices::name(&lens.model, &lens.serial),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let report = self.controller.report()?.clone();
        let ended = EndedRun { report, delays: self.controller.delays(), pace };
        Some(wire::report(&ended, wire::Circumstances { started_unix_s: 0.0, devices, calibration: None }))
    }

    /// Lets `duration` pass without looking at anything, as when the computer has no time for the daemon.
    pub fn starve(&mut self, duration: Duration) {
        self.clock.advance_to(self.clock.now() + duration);
    }

    /// Lets a millisecond pass.
    pub fn step(&mut self) {
        let now = self.clock.now() + STEP;
        self.clock.advance_to(now);
        self.read_camera(now);
        if now >= self.next_poll {
            self.next_poll = now + self.lens_poll;
            self.sample_lens();
        }
        self.controller.handle(Input::Tick, self.clock.now(), &mut self.actions);
        self.perform();
    }

    fn read_camera(&mut self, now: HostMicros) {
        if self.camera_failed.is_some_and(|again| now >= again) {
            self.camera_failed = Some(now + RETRY);
            if self.camera.start().is_ok() {
                self.camera_failed = None;
                self.controller.handle(Input::CameraReady, now, &mut self.actions);
            }
        }
        while self.camera_failed.is_none() {
            if let Err(error) = self.camera.read(&mut self.batch, Duration::ZERO) {
                self.camera_failed = Some(now + RETRY);
                let input = Input::CameraFailed(devices::failure(&error));
                self.controller.handle(input, now, &mut self.actions);
                return;
            }
            self.controller.handle(Input::Batch(&self.batch), now, &mut self.actions);
            if self.batch.events.is_empty() {
                return;
            }
        }
    }

    fn sample_lens(&mut self) {
        let now = self.clock.now();
        if self.lens_failed.is_some_and(|again| now < again) {
            return;
        }
        let mut answer = self.lens.sample();
        if self.lens_failed.is_some() && answer.is_ok() {
            // As the daemon does: whatever it did while it did not answer, it stands still before anybody counts on it again.
            if let Err(error) = self.lens.stop() {
                answer = Err(error);
            }
        }
        if self.lens_failed.is_some() && answer.is_ok() {
            self.lens_failed = None;
            self.controller.handle(Input::LensReady, now, &mut self.actions);
        }
        match answer {
            Ok(sample) => {
                self.desk.sample(sample);
                self.controller.handle(Input::Lens(sample), self.clock.now(), &mut self.actions);
            }
            Err(error) => self.fail_lens(&error),
        }
    }

    /// What the lens said when it failed last.
    pub fn lens_error(&self) -> Option<&DeviceError> {
        self.lens_error.as_ref()
    }

    fn fail_lens(&mut self, error: &DeviceError) {
        let news = self.lens_failed.is_none();
        self.lens_failed = Some(self.clock.now() + RETRY);
        if !news {
            return;
        }
        self.lens_error = Some(error.clone());
        let failure = devices::failure(error);
        self.desk.lens_failed(failure);
        let input = Input::LensFailed(failure);
        self.controller.handle(input, self.clock.now(), &mut self.actions);
    }

    /// Does what was decided; what comes of a failure is decided and done too.
    fn perform(&mut self) {
        let mut done = 0;
        while let Some(&action) = self.actions.get(done) {
            done += 1;
            // A failed lens is still told to stop.
            if self.lens_failed.is_some() && action != Action::StopLens {
                continue;
            }
            let action = self.desk.order(action, &self.controller);
            if let Err(error) = devices::perform(action, self.lens.as_mut()) {
                self.fail_lens(&error);
            }
        }
        self.actions.clear();
    }

    /// Lets `duration` pass.
    pub fn run_for(&mut self, duration: Duration) {
        let end = self.clock.now() + duration;
        while self.clock.now() < end {
            self.step();
        }
    }

    /// Calibrates the lens; what was measured counts from then on.
    ///
    /// # Errors
    /// What a client would be told; the lens has been told to stop then.
    pub fn calibrate(&mut self) -> Result<Calibration, CalibrationFailure> {
        let refused = |message| CalibrationFailure { reason: "refused", message };
        self.desk.begin(&mut self.controller, self.clock.now(), &mut self.actions).map_err(refused)?;
        self.perform();
        loop {
            self.step();
            let ended = self.desk.advance(&mut self.controller, self.clock.now(), &mut self.actions);
            self.perform();
            if let Some(ended) = ended {
                return ended;
            }
        }
    }

    /// Makes a focus run from trigger to report. `watch` is shown the state and the live curve after every step.
    ///
    /// # Errors
    /// [`VirtualRigError::Refused`] if the controller does not take the request. A run that ends without focus is no error.
    pub fn focus(
        &mut self,
        request: FocusRequest,
        mut watch: impl FnMut(HostMicros, &Snapshot, &[CurvePoint]),
    ) -> Result<RunReport, VirtualRigError> {
        self.command(Command::Focus(request))?;
        loop {
            self.step();
            let snapshot = self.controller.snapshot();
            watch(self.clock.now(), &snapshot, self.controller.live_curve());
            if snapshot.run.is_none()
                && let Some(report) = self.controller.report()
            {
                return Ok(report.clone());
            }
        }
    }
}

//! A control thread that is told what to do by the test, with the real socket in front of it.

#![expect(clippy::unwrap_used, reason = "part of a test")]

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::controller::Pause;
use evfocus_ipc::client::Client;
use evfocus_ipc::server::{Limits, Socket};
use evfocus_ipc::{
    CurvePoint, Device, DeviceRole, DeviceState, Error, FocusRequest, LastRun, LensRange, Mode, Outcome,
    PauseState, Phase, Progress, REPORT_FORMAT, Report, RunDevices, State, Status,
};
use evfocusd::access::Access;
use evfocusd::handle::{Command, Handle, Lookups, Reloaded};
use evfocusd::service;
use tokio::sync::{broadcast, mpsc, oneshot, watch};
use tokio::task::JoinHandle;

/// What the lens of this rig accepts, in counts.
pub(crate) const RANGE: LensRange = LensRange { min: 220.0, max: 3750.0 };

/// How many messages a follower may be behind.
pub(crate) const BACKLOG: usize = 64;

/// The daemon's socket with a fake behind it.
pub(crate) struct Rig {
    pub(crate) path: PathBuf,
    pub(crate) fake: Fake,
    pub(crate) control: JoinHandle<()>,
    pub(crate) server: JoinHandle<()>,
    /// Dropping it ends the server.
    pub(crate) shutdown: Option<oneshot::Sender<()>>,
    _directory: tempfile::TempDir,
}

/// The fake control thread's side of the channels. Cloning shares the state.
#[derive(Clone)]
pub(crate) struct Fake {
    state: Arc<Mutex<FakeState>>,
    status: Arc<watch::Sender<Arc<Status>>>,
    progress: broadcast::Sender<Arc<Progress>>,
    unanswered: Arc<Mutex<Vec<Command>>>,
}

#[derive(Default)]
struct FakeState {
    mode: Mode,
    next_run: u64,
    running: Option<(u64, FocusRequest)>,
    reports: VecDeque<Report>,
    hangs: bool,
}

/// Limits with short times, so that a test of them ends soon.
pub(crate) fn limits() -> Limits {
    Limits {
        clients: 8,
        call_time: Duration::from_millis(200),
        reply_time: Duration::from_millis(200),
        ..Limits::default()
    }
}

impl Rig {
    pub(crate) fn start(limits: Limits) -> Self {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("evfocus.sock");
        let (commands, received) = mpsc::channel(4);
        let (status_sender, status) = watch::channel(Arc::new(Status {
            lens_range: Some(RANGE),
            lens_position: Some(2000.0),
            version: "0.0.0-fake".to_owned(),
            ..Status::default()
        }));
        let (progress, _) = broadcast::channel(BACKLOG);
        let fake = Fake {
            state: Arc::default(),
            status: Arc::new(status_sender),
            progress,
            unanswered: Arc::default(),
        };
        let handle = Handle {
            commands,
            status,
            progress: fake.progress.downgrade(),
            access: watch::channel(Arc::new(Access::of_everybody())).1,
            lookups: Arc::new(FakeLookups { state: Arc::clone(&fake.state) }),
        };
        let control = tokio::spawn(fake.clone().control(received));
        let (shutdown, told) = oneshot::channel::<()>();
        let socket = Socket::bind(&path).unwrap();
        let server = tokio::spawn(service::serve(socket, handle, limits, async {
            let _closed = told.await;
        }));
        Self { path, fake, control, server, shutdown: Some(shutdown), _directory: directory }
    }

    pub(crate) async fn client(&self) -> Client {
        Client::connect(&self.path).await.unwrap()
    }
}

impl Fake {
    async fn control(self, mut commands: mpsc::Receiver<Command>) {
        while let Some(command) = commands.recv().await {
            if self.state.lock().unwrap().hangs {
                self.unanswered.lock().unwrap().push(command);
                continue;
            }
            // The caller may have hung up: then nobody waits for the answer.
            match command {
                Command::Focus { request, answer } => drop(answer.send(self.admit_focus(request))),
                Command::Abort { answer } => {
                    let run = self.state.lock().unwrap().running.take();
                    if let Some((id, request)) = &run {
                        self.finish(*id, request.clone(), State::Idle, Some("aborted"));
                    }
                    drop(answer.send(Ok(run.map(|(id, _)| id))));
                }
                Command::MoveTo { position, answer } => {
                    let running = self.state.lock().unwrap().running.as_ref().map(|(id, _)| *id);
                    drop(answer.send(match running {
                        Some(run_id) => Err(Error::Busy { run_id }),
                        None if (RANGE.min..=RANGE.max).contains(&position) => {
                            self.change(|status| status.lens_position = Some(position));
                            Ok(())
                        }
                        None => {
                            let (what, LensRange { min, max }) = ("position".to_owned(), RANGE);
                            Err(Error::OutOfRange { what, value: position, min, max })
                        }
                    }));
                }
                Command::Calibrate { answer } => {
                    let (reason, message) = ("lens-lost".to_owned(), "a fake lens".to_owned());
                    drop(answer.send(Err(Error::CalibrationFailed { reason, message })));
                }
                Command::SetMode { mode, answer } => {
                    self.state.lock().unwrap().mode = mode;
                    self.change(|status| status.mode = mode);
                    drop(answer.send(Ok(())));
                }
                Command::Pause { pause, answer } => {
                    self.change(|status| {
                        status.pause =
                            if pause == Pause::Resume { PauseState::Running } else { PauseState::Paused };
                    });
                    drop(answer.send(Ok(())));
                }
                Command::Configure { .. } => {}
            }
        }
    }

    fn admit_focus(&self, request: FocusRequest) -> Result<u64, Error> {
        let mut state = self.state.lock().unwrap();
        if state.mode == Mode::Manual {
            return Err(Error::WrongMode { mode: Mode::Manual, needed: Mode::Auto });
        }
        if let Some((id, under_way)) = &state.running {
            let same = request == *under_way || request == FocusRequest::default();
            return if same { Ok(*id) } else { Err(Error::Busy { run_id: *id }) };
        }
        state.next_run += 1;
        let id = state.next_run;
        state.running = Some((id, request));
        self.change(|status| {
            status.state = State::Scanning;
            status.phase = Phase::Sweeping;
            status.run_id = Some(id);
        });
        Ok(id)
    }

    /// Publishes a changed status.
    pub(crate) fn change(&self, change: impl FnOnce(&mut Status)) {
        self.status.send_modify(|status| change(Arc::make_mut(status)));
    }

    /// The run under way reports a point of its curve.
    pub(crate) fn advance(&self, point: u64) {
        let run_id = self.state.lock().unwrap().running.as_ref().map(|(id, _)| *id).unwrap();
        let position = 220.0 + point as f64;
        let curve_point = Some(CurvePoint { position, rate: 1e6, t_us: point as i64 * 55_000 });
        drop(self.progress.send(Arc::new(Progress { curve_point, ..news(run_id, Some(position)) })));
    }

    /// The run under way finds focus.
    pub(crate) fn succeed(&self) {
        let (id, request) = self.state.lock().unwrap().running.take().unwrap();
        self.finish(id, request, State::Focused, None);
    }

    fn finish(&self, id: u64, request: FocusRequest, state: State, reason: Option<&str>) {
        let report = report(id, request, state, reason);
        self.state.lock().unwrap().reports.push_back(report.clone());
        self.change(|status| {
            status.state = state;
            status.phase = Phase::None;
            status.run_id = None;
            status.last_run = Some(LastRun {
                id,
                state,
                position: report.result.position,
                reason: reason.map(str::to_owned),
                error_bar: None,
                confidence: None,
                flags: Vec::new(),
            });
        });
        drop(self.progress.send(Arc::new(Progress { done: true, report: Some(report), ..news(id, None) })));
    }

    /// The run under way ends without a word.
    pub(crate) fn lose(&self) {
        self.state.lock().unwrap().running.take().unwrap();
    }

    /// From now on no command is answered.
    pub(crate) fn hang(&self) {
        self.state.lock().unwrap().hangs = true;
    }

    /// How many follow the progress.
    pub(crate) fn followers(&self) -> usize {
        self.progress.receiver_count()
    }
}

struct FakeLookups {
    state: Arc<Mutex<FakeState>>,
}

impl Lookups for FakeLookups {
    fn devices(&self, _probe: Option<&[String]>) -> Result<Vec<Device>, Error> {
        Ok(vec![Device {
            role: DeviceRole::Camera,
            driver: "fake".to_owned(),
            model: "Fake".to_owned(),
            serial: "1".to_owned(),
            location: "simulated".to_owned(),
            state: DeviceState::Active,
            message: None,
        }])
    }

    fn report(&self, id: Option<u64>) -> Result<Report, Error> {
        let state = self.state.lock().unwrap();
        let report = match id {
            Some(id) => state.reports.iter().find(|report| report.run_id == id),
            None => state.reports.back(),
        };
        report.cloned().ok_or(Error::NoSuchReport { id })
    }

    fn reload(&self) -> Result<Reloaded, Error> {
        Ok(Reloaded { applied: vec!["focus".to_owned()], needs_restart: Vec::new() })
    }
}

fn news(run_id: u64, lens_position: Option<f64>) -> Progress {
    Progress {
        run_id,
        phase: Phase::Sweeping,
        lens_position,
        event_rate: 1e6,
        curve_point: None,
        missed: 0,
        done: false,
        report: None,
    }
}

fn report(run_id: u64, request: FocusRequest, state: State, reason: Option<&str>) -> Report {
    Report {
        format: REPORT_FORMAT,
        run_id,
        started_unix_s: 1.7e9,
        elapsed_s: 4.5,
        request,
        devices: RunDevices {
            camera: "Fake 1".to_owned(),
            lens: "Fake 2".to_owned(),
            version: "0".to_owned(),
        },
        result: Outcome {
            state,
            reason: reason.map(str::to_owned),
            message: "a fake result".to_owned(),
            position: (state == State::Focused).then_some(1892.5),
            lens_position: Some(1892.0),
            position_before: 220.0,
            method: None,
            decided_by: None,
            error_bar: None,
            confidence: None,
            flags: Vec::new(),
            second_depth: None,
            window: None,
        },
        sweeps: Vec::new(),
        windows: Vec::new(),
        map: None,
        delay_us: None,
        rig_delay: None,
        calibration: None,
        hot_pixels: 0,
        clock_map: None,
        events: evfocus_ipc::EventCounts::default(),
        timings: Vec::new(),
        warnings: Vec::new(),
    }
}

//! Starts everything in order, and stops it in order.

use std::future::Future;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Context, bail};
use evfocus_core::controller::Command as CoreCommand;
use evfocus_core::{Controller, ControllerConfig, EventBatch, RunId};
use evfocus_hal::{CameraInfo, Clock, LensInfo, SystemClock};
use evfocus_ipc::server::Limits;
use evfocus_ipc::{self as ipc, Device, Error, Report, Status};
use rtrb::RingBuffer;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::{broadcast, mpsc, watch};
use tokio::task::JoinSet;

use crate::access::Access;
use crate::calibration::{CalibrationFile, Desk};
use crate::config::{CameraConfig, Config};
use crate::device_list::DeviceList;
use crate::devices::{self, Devices};
use crate::handle::{Handle, Lookups, Reloaded};
use crate::metrics::{self, Metrics};
use crate::publisher::{Constants, PROGRESS, Publisher};
use crate::real_time::{Grants, Wish};
use crate::reload::{self, Reloader, Reread};
use crate::reports::{ReportStore, Reports};
use crate::rig_delay::RigDelayFile;
use crate::service;
use crate::storage::StateDirectory;
use crate::supervisor::{self, Supervisor};
use crate::threads::camera::{BATCH_EVENTS, BATCHES, CameraThread};
use crate::threads::control::{CURVE_POINTS, ControlThread, Publications, REPORTS, Seen};
use crate::threads::lens::{LensThread, SAMPLES};
use crate::threads::orders::orders;
use crate::threads::{NOTICES, StopFlag};
use crate::vitals::Vitals;

/// Commands from clients that may wait for the control thread, which looks every 2 ms.
const COMMANDS: usize = 64;
/// How long the lens has for its first answer before the daemon is ready without it.
const START_TIME: Duration = Duration::from_secs(2);
/// How long the threads have to end; systemd gives 90 s.
const STOP_TIME: Duration = Duration::from_secs(5);

/// Runs the daemon of `config` until `shutdown` completes; `ready` is called once the socket takes connections and the lens has
/// answered. `reread` is asked for the configuration again when a client or SIGHUP says so.
///
/// Needs a current-thread tokio runtime with time and input/output.
///
/// # Errors
/// What keeps the daemon from starting, with the remedy; or that one of its threads has died.
pub async fn run(
    config: Config,
    reread: Reread,
    ready: impl FnOnce(),
    shutdown: impl Future<Output = ()>,
) -> anyhow::Result<()> {
    // From here on SIGHUP does not end the process; one that comes too early is heeded once all runs.
    let hangups = signal(SignalKind::hangup()).context("cannot listen for SIGHUP")?;
    let socket =
        match supervisor::inherited_socket().context("the socket handed over by the service manager")? {
            Some(listener) => ipc::server::Socket::inherited(listener)?,
            None => ipc::server::Socket::bind(&config.socket)
                .with_context(|| format!("cannot listen on {}", config.socket.display()))?,
        };
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let devices = Devices::open(&config, &clock)?;
    if config.camera == CameraConfig::Simulated && config.rig.sensor.geometry.pixels() > 200_000 {
        tracing::warn!(
            "the simulated IMX636 is several times slower than real time, so runs will time out; use davis346 here"
        );
    }
    if config.lens.is_hardware() && config.camera.driver().is_none() {
        tracing::warn!("this camera does not look through this lens; it serves to try the lens");
    }
    let mut running = Running::start(&config, reread, devices, &clock)?;
    let publisher = tokio::spawn(running.publisher.take().context("the publisher has been taken")?.run());
    let scrapers = running.serve_metrics(&config)?;
    running.wait_for_the_lens().await;
    tracing::info!(socket = %config.socket.display(), state_dir = %config.state_dir.display(), "ready");
    ready();
    supervisor::ready();
    let supervision = tokio::spawn(running.supervisor().run());
    let hangups = tokio::spawn(reload::on_hangup(hangups, Arc::clone(&running.handle.lookups)));
    let handle = running.handle.clone();
    let threads_alive = running.ended.recv();
    let mut died = false;
    let until = async {
        tokio::select! {
            () = shutdown => {}
            _ = threads_alive => died = true,
        }
    };
    service::serve(socket, handle, Limits::default(), until).await;
    supervisor::stopping();
    supervision.abort();
    hangups.abort();
    drop(scrapers);
    running.stop().await?;
    // The control thread is gone, so the publisher ends once it has written the last report.
    tokio::time::timeout(STOP_TIME, publisher).await.context("the last report was not written in time")??;
    if died {
        bail!("a thread of the daemon has ended by itself; the lens is stopped; the log says more");
    }
    tracing::info!("stopped");
    Ok(())
}

/// The daemon's threads and the ends of their queues.
struct Running {
    handle: Handle,
    publisher: Option<Publisher>,
    stop: StopFlag,
    vitals: Vitals,
    metrics: Metrics,
    threads: Vec<(&'static str, JoinHandle<()>)>,
    /// A thread that ends says so here.
    ended: mpsc::Receiver<()>,
}

impl Running {
    #[expect(
        clippy::too_many_lines,
        reason = "the one place where each queue is tied to the threads at its ends"
    )]
    fn start(
        config: &Config,
        reread: Reread,
        devices: Devices,
        clock: &Arc<dyn Clock>,
    ) -> anyhow::Result<Self> {
        let (camera_info, lens_info) = (devices.camera.info(), devices.lens.info());
        let Prepared {
            controller,
            access,
            store,
            rig_delay,
            run_devices,
            calibration,
            calibration_file,
            desk,
        } = Prepared::new(config, &camera_info, &lens_info, clock)?;
        let ControllerConfig { delays: saved_delays, pace, limits, .. } = *controller.config();

        let (filled_in, filled_out) = RingBuffer::new(BATCHES);
        let (mut empty_in, empty_out) = RingBuffer::new(BATCHES);
        while empty_in.push(EventBatch::with_capacity(BATCH_EVENTS)).is_ok() {}
        let (samples_in, samples_out) = RingBuffer::new(SAMPLES);
        let (camera_notices_in, camera_notices_out) = RingBuffer::new(NOTICES);
        let (lens_notices_in, lens_notices_out) = RingBuffer::new(NOTICES);
        let (curve_in, curve_out) = RingBuffer::new(CURVE_POINTS);
        let (orders_in, orders_out) = orders();
        let (commands_in, commands_out) = mpsc::channel(COMMANDS);
        let (reports_in, reports_out) = mpsc::channel(REPORTS);
        let (calibrations_in, calibrations_out) = mpsc::channel(1);
        let (seen_in, seen_out) = watch::channel(Seen {
            snapshot: controller.snapshot(),
            calibrating: false,
            limits,
            lens_moving: false,
        });
        let (status_in, status_out) = watch::channel(Arc::new(Status::default()));
        let (progress_in, _) = broadcast::channel(PROGRESS);

        let grants = Grants::default();
        let [control_wish, camera_wish] = grants.wishes(&config.real_time);

        let (stop, vitals) = (StopFlag::default(), Vitals::default());
        let (ended_in, ended) = mpsc::channel(3);
        let control = ControlThread {
            controller,
            geometry: camera_info.geometry,
            pace,
            clock: Arc::clone(clock),
            filled: filled_out,
            empty: empty_in,
            samples: samples_out,
            notices: [camera_notices_out, lens_notices_out],
            commands: commands_out,
            orders: orders_in,
            new_settings: None,
            vitals: vitals.clone(),
            publications: Publications {
                seen: seen_in,
                curve: curve_in,
                reports: reports_in,
                calibrations: calibrations_in,
            },
            desk,
            calibration_asked: None,
            stop: stop.clone(),
        };
        let control = spawn("evfocus-control", &ended_in, control_wish, move || control.run())?;
        let camera = CameraThread {
            camera: devices.camera,
            clock: Arc::clone(clock),
            empty: empty_out,
            filled: filled_in,
            notices: camera_notices_in,
            control: control.thread().clone(),
            stop: stop.clone(),
        };
        let lens = LensThread {
            lens: devices.lens,
            clock: Arc::clone(clock),
            poll: config.lens_poll,
            orders: orders_out,
            samples: samples_in,
            notices: lens_notices_in,
            control: control.thread().clone(),
            vitals: vitals.clone(),
        };
        let camera = spawn("evfocus-camera", &ended_in, camera_wish, move || camera.run())?;
        let lens = spawn("evfocus-lens", &ended_in, Wish::default(), move || lens.run())?;

        let (commands, reports) = (commands_in.clone(), store.clone());
        let access_out = access.subscribe();
        let reloader = Reloader::new(reread, config, &lens_info, commands, access, reports);
        let lookups = DaemonLookups {
            reloader,
            devices: DeviceList::new(config, camera_info, lens_info),
            reports: store.clone(),
            status: status_out.clone(),
        };
        let followers = progress_in.downgrade();
        let metrics = Metrics::new(vitals.clone());
        let publisher = Publisher {
            seen: seen_out,
            calibrations: calibrations_out,
            calibration,
            calibration_file,
            curve: curve_out,
            reports: reports_out,
            status: status_in,
            progress: progress_in,
            store,
            rig_delay,
            metrics: metrics.clone(),
            grants,
            saved_delays,
            constants: Constants { devices: run_devices },
            clock: Arc::clone(clock),
        };
        Ok(Self {
            handle: Handle {
                commands: commands_in,
                status: status_out,
                progress: followers,
                access: access_out,
                lookups: Arc::new(lookups),
            },
            publisher: Some(publisher),
            stop,
            vitals,
            metrics,
            threads: vec![("evfocus-control", control), ("evfocus-lens", lens), ("evfocus-camera", camera)],
            ended,
        })
    }

    fn supervisor(&self) -> Supervisor {
        Supervisor { status: self.handle.status.clone(), vitals: self.vitals.clone() }
    }

    /// Starts what hands the figures out; it ends with what is returned.
    fn serve_metrics(&self, config: &Config) -> anyhow::Result<JoinSet<()>> {
        let mut tasks = JoinSet::new();
        if let Some(path) = &config.metrics.socket {
            let socket = ipc::server::Socket::bind(path)
                .with_context(|| format!("cannot serve metrics on {}", path.display()))?;
            tasks.spawn(metrics::answer(socket, self.metrics.clone()));
        }
        if let Some(path) = &config.metrics.file {
            tasks.spawn(metrics::keep_file(path.clone(), self.metrics.clone()));
        }
        Ok(tasks)
    }

    /// Returns when the first word of the lens has been published, so that whoever is told "ready" can focus at once; or after a
    /// while: a daemon without a lens still serves status.
    async fn wait_for_the_lens(&self) {
        let mut status = self.handle.status.clone();
        let first_word = status.wait_for(|status| status.lens_position.is_some());
        if tokio::time::timeout(START_TIME, first_word).await.is_err() {
            tracing::warn!(waited = ?START_TIME, "the lens has not answered yet");
        }
    }

    /// Stops the control thread, which stops the lens, and waits for all.
    async fn stop(self) -> anyhow::Result<()> {
        self.stop.stop();
        let (mut hung, mut panicked) = (Vec::new(), Vec::new());
        for (name, thread) in self.threads {
            let join = tokio::task::spawn_blocking(move || thread.join());
            match tokio::time::timeout(STOP_TIME, join).await {
                Ok(Ok(Ok(()))) => {}
                Ok(_) => panicked.push(name),
                Err(_) => hung.push(name),
            }
        }
        if !hung.is_empty() {
            bail!(
                "still busy {STOP_TIME:?} after they were told to stop: {}; the lens may be moving",
                hung.join(", ")
            );
        }
        if !panicked.is_empty() {
            bail!("panicked: {}; the lens is stopped; the log says where", panicked.join(", "));
        }
        Ok(())
    }
}

/// What is settled before there are threads.
struct Prepared {
    controller: Controller,
    access: watch::Sender<Arc<Access>>,
    store: Reports,
    rig_delay: Option<RigDelayFile>,
    run_devices: ipc::RunDevices,
    calibration: Option<ipc::Calibration>,
    calibration_file: Option<CalibrationFile>,
    desk: Desk,
}

impl Prepared {
    fn new(
        config: &Config,
        camera: &CameraInfo,
        lens: &LensInfo,
        clock: &Arc<dyn Clock>,
    ) -> anyhow::Result<Self> {
        let access = watch::Sender::new(Arc::new(Access::of(&config.access)?));
        let state = StateDirectory::new(&config.state_dir);
        let store = Reports::new(ReportStore::open(&state, config.kept()));
        if let Some(fault) = store.fault() {
            tracing::error!(%fault, "reports are kept in memory only");
        }
        let run_devices = run_devices(camera, lens);
        // Where another daemon keeps its reports, it keeps its delay too.
        let rig_delay = (store.fault().is_none())
            .then(|| RigDelayFile::new(&state, &run_devices.camera, &run_devices.lens));
        let calibration_file =
            (store.fault().is_none()).then(|| CalibrationFile::new(&state, &run_devices.lens));
        let calibration = calibration_file.as_ref().and_then(CalibrationFile::read);
        let desk = Desk::new(config.clone(), lens.clone(), calibration.clone());
        let mut settings = desk
            .settings()
            .map_err(|bad| anyhow::anyhow!("the configuration does not suit the lens: {bad}"))?;
        settings.delays = rig_delay.as_ref().and_then(RigDelayFile::read).unwrap_or_default();
        let mut controller = Controller::new(settings, camera.geometry, clock.now());
        controller.number_runs_from(RunId(store.newest_on_disk().map_or(1, |newest| newest + 1)));
        // An idle controller refuses no change of mode and has nothing to do for it.
        controller.command(CoreCommand::SetMode(config.mode), clock.now(), &mut Vec::new())?;
        Ok(Self { controller, access, store, rig_delay, run_devices, calibration, calibration_file, desk })
    }
}

fn run_devices(camera: &CameraInfo, lens: &LensInfo) -> ipc::RunDevices {
    ipc::RunDevices {
        camera: devices::name(&camera.model, &camera.serial),
        lens: devices::name(&lens.model, &lens.serial),
        version: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

/// Starts a named thread that reports its end, by return or by panic.
fn spawn(
    name: &str,
    ended: &mpsc::Sender<()>,
    wish: Wish,
    body: impl FnOnce() + Send + 'static,
) -> anyhow::Result<JoinHandle<()>> {
    struct Ended(mpsc::Sender<()>);
    impl Drop for Ended {
        fn drop(&mut self) {
            // There is room for every thread's word.
            self.0.try_send(()).unwrap_or_default();
        }
    }
    let ended = Ended(ended.clone());
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(move || {
            let _ended = ended;
            wish.ask();
            body();
        })
        .with_context(|| format!("cannot start the thread {name}"))
}

/// What clients may look up without the control thread.
struct DaemonLookups {
    reloader: Reloader,
    devices: DeviceList,
    reports: Reports,
    status: watch::Receiver<Arc<Status>>,
}

impl Lookups for DaemonLookups {
    fn devices(&self, probe: Option<&[String]>) -> Result<Vec<Device>, Error> {
        let status = Arc::clone(&self.status.borrow());
        Ok(self.devices.list(&status, probe))
    }

    fn report(&self, id: Option<u64>) -> Result<Report, Error> {
        self.reports.read(id)
    }

    fn reload(&self) -> Result<Reloaded, Error> {
        self.reloader.reload()
    }
}

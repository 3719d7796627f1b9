//! From what the control thread publishes to what clients see: status, progress, reports.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::controller::Snapshot;
use evfocus_core::{CurvePoint, DelayModel, RunId};
use evfocus_hal::{Clock, unix_time};
use evfocus_ipc::{self as ipc, Progress, Report, Status};
use rtrb::Consumer;
use tokio::sync::{broadcast, mpsc, watch};

use crate::calibration::CalibrationFile;
use crate::metrics::Metrics;
use crate::real_time::Grants;
use crate::reports::Reports;
use crate::rig_delay::RigDelayFile;
use crate::threads::control::{Calibrated, EndedRun, Seen};
use crate::wire;

/// Messages of a run that a follower may be behind: a sweep of 20 s at 50 points a second.
pub(crate) const PROGRESS: usize = 1_024;

/// What stays the same while the daemon runs.
#[derive(Debug, Clone)]
pub(crate) struct Constants {
    /// The devices.
    pub(crate) devices: ipc::RunDevices,
}

/// The task on the socket's side.
pub(crate) struct Publisher {
    /// From the control thread.
    pub(crate) seen: watch::Receiver<Seen>,
    /// From the control thread.
    pub(crate) curve: Consumer<(RunId, CurvePoint)>,
    /// From the control thread.
    pub(crate) reports: mpsc::Receiver<Box<EndedRun>>,
    /// From the control thread.
    pub(crate) calibrations: mpsc::Receiver<Calibrated>,
    /// What was measured of the lens.
    pub(crate) calibration: Option<ipc::Calibration>,
    /// To the disk; nothing if the state directory cannot be used.
    pub(crate) calibration_file: Option<CalibrationFile>,
    /// To the clients.
    pub(crate) status: watch::Sender<Arc<Status>>,
    /// To the clients.
    pub(crate) progress: broadcast::Sender<Arc<Progress>>,
    /// To the disk.
    pub(crate) store: Reports,
    /// To the disk too; nothing if the state directory cannot be used.
    pub(crate) rig_delay: Option<RigDelayFile>,
    /// What is there.
    pub(crate) saved_delays: DelayModel,
    /// What stays the same.
    pub(crate) constants: Constants,
    /// Figures of all this.
    pub(crate) metrics: Metrics,
    /// What was asked of the operating system.
    pub(crate) grants: Grants,
    /// Host time.
    pub(crate) clock: Arc<dyn Clock>,
}

impl std::fmt::Debug for Publisher {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Publisher").field("constants", &self.constants).finish_non_exhaustive()
    }
}

/// What the publisher remembers from one publication to the next.
struct News {
    fault: Option<String>,
    last_run: Option<ipc::LastRun>,
}

impl Publisher {
    /// Runs until the control thread is gone and its last report is written.
    pub(crate) async fn run(mut self) {
        let mut news = News {
            fault: self.store.fault(),
            last_run: self.store.read(None).ok().map(|report| last_run(&report)),
        };
        loop {
            tokio::select! {
                changed = self.seen.changed() => {
                    if changed.is_err() {
                        break;
                    }
                    self.publish_snapshot(&news);
                }
                Some(run) = self.reports.recv() => self.publish_report(&run, &mut news).await,
                Some(calibrated) = self.calibrations.recv() => self.keep_calibration(calibrated, &mut news).await,
            }
        }
        while let Some(run) = self.reports.recv().await {
            self.publish_report(&run, &mut news).await;
        }
    }

    fn publish_snapshot(&mut self, news: &News) {
        let seen = *self.seen.borrow_and_update();
        let snapshot = seen.snapshot;
        self.metrics.observe(&snapshot);
        let curve_points = self.send_curve(&snapshot);
        if let Some(run) = snapshot.run
            && !curve_points
        {
            self.send(progress(run, &snapshot, None));
        }
        self.status.send_replace(Arc::new(self.status(&seen, news)));
    }

    async fn publish_report(&mut self, ended: &EndedRun, news: &mut News) {
        let seen = *self.seen.borrow();
        let snapshot = seen.snapshot;
        self.send_curve(&snapshot);
        let circumstances = wire::Circumstances {
            started_unix_s: unix_time()
                .saturating_sub(self.clock.now().since(ended.report.started))
                .as_secs_f64(),
            devices: self.constants.devices.clone(),
            calibration: self.calibration.clone(),
        };
        let report = Arc::new(wire::report(ended, circumstances));
        log(&report);
        self.metrics.count(&report);
        let fault = keep(self.store.clone(), Arc::clone(&report)).await;
        let delay_fault = self.keep_delays(ended.delays).await;
        news.fault = fault.or(delay_fault);
        news.last_run = Some(last_run(&report));
        self.status.send_replace(Arc::new(self.status(&seen, news)));
        let report = Some(Report::clone(&report));
        self.send(Progress { done: true, report, ..progress(ended.report.id, &snapshot, None) });
    }

    /// Writes what the runs have taught, if that is not on disk yet. Returns what went wrong.
    async fn keep_delays(&mut self, delays: DelayModel) -> Option<String> {
        let file = self.rig_delay.clone().filter(|_| delays != self.saved_delays)?;
        let error = match tokio::task::spawn_blocking(move || file.write(&delays)).await {
            Ok(Ok(())) => {
                self.saved_delays = delays;
                return None;
            }
            Ok(Err(error)) => error.to_string(),
            Err(panic) => panic.to_string(),
        };
        tracing::warn!(%error, "the learnt delay of the pixels is kept in memory only");
        Some(format!("the learnt delay of the pixels is kept in memory only: {error}"))
    }

    /// Dates what was measured of the lens, writes it, and tells whoever asked for it.
    async fn keep_calibration(&mut self, calibrated: Calibrated, news: &mut News) {
        let Calibrated { mut calibration, answer } = calibrated;
        calibration.measured_unix_s = unix_time().as_secs_f64();
        self.calibration = Some(calibration.clone());
        let error = match self.calibration_file.clone() {
            None => self.store.fault(),
            Some(file) => {
                let written = calibration.clone();
                match tokio::task::spawn_blocking(move || file.write(&written)).await {
                    Ok(Ok(())) => None,
                    Ok(Err(error)) => Some(error.to_string()),
                    Err(panic) => Some(panic.to_string()),
                }
            }
        };
        if let Some(error) = error {
            let fault = format!("the lens's calibration is kept in memory only: {error}");
            tracing::error!(%error, "the lens's calibration is kept in memory only");
            calibration.notes.push(fault.clone());
            news.fault = Some(fault);
        }
        // The client may have gone.
        answer.send(Ok(calibration)).unwrap_or_default();
        let seen = *self.seen.borrow();
        self.status.send_replace(Arc::new(self.status(&seen, news)));
    }

    /// Sends the points of the live curve that have come; whether there were any.
    fn send_curve(&mut self, snapshot: &Snapshot) -> bool {
        let mut any = false;
        while let Ok((run, point)) = self.curve.pop() {
            self.send(progress(run, snapshot, Some(point)));
            any = true;
        }
        any
    }

    fn send(&self, progress: Progress) {
        // Nobody may be listening.
        let listeners = self.progress.send(Arc::new(progress)).unwrap_or(0);
        tracing::trace!(listeners, "progress");
    }

    fn status(&self, seen: &Seen, news: &News) -> Status {
        let snapshot = &seen.snapshot;
        let device = |ready: bool, name: &str| ready.then(|| name.to_owned());
        let missing = match (snapshot.camera_ready, snapshot.lens_ready) {
            (true, true) => None,
            (false, true) => {
                Some("the camera does not answer: check its cable; the log has its words".to_owned())
            }
            (true, false) => {
                Some("the lens does not answer: check its cable; the log has its words".to_owned())
            }
            (false, false) => Some(
                "neither camera nor lens answers: check their cables; the log has their words".to_owned(),
            ),
        };
        Status {
            mode: wire::mode(snapshot.mode),
            pause: wire::pause_state(snapshot.pause),
            sharpness: snapshot.sharpness,
            state: wire::state(snapshot.state),
            phase: match snapshot.phase {
                None if seen.calibrating => ipc::Phase::Calibrating,
                phase => wire::phase(phase),
            },
            run_id: snapshot.run.map(|run| run.0),
            lens_position: snapshot.lens.map(|lens| lens.position.0),
            lens_moving: seen.lens_moving,
            lens_range: Some(wire::lens_range(seen.limits)),
            event_rate: snapshot.event_rate.0,
            events_lost: snapshot.lost,
            last_run: news.last_run.clone(),
            camera: device(snapshot.camera_ready, &self.constants.devices.camera),
            lens: device(snapshot.lens_ready, &self.constants.devices.lens),
            calibration: self.calibration.clone(),
            fault: missing.or_else(|| news.fault.clone()),
            real_time: self.grants.list(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            uptime_s: Duration::from_micros(u64::try_from(self.clock.now().0).unwrap_or(0)).as_secs_f64(),
        }
    }
}

/// Writes the report away from this thread, which serves clients meanwhile. Returns what went wrong.
async fn keep(store: Reports, report: Arc<Report>) -> Option<String> {
    let written = tokio::task::spawn_blocking(move || store.write(&report)).await;
    let error = match written {
        Ok(Ok(())) => return None,
        Ok(Err(error)) => error.to_string(),
        Err(panic) => panic.to_string(),
    };
    tracing::error!(%error, "the report is kept in memory only");
    Some(format!("the last report is kept in memory only: {error}"))
}

fn progress(run: RunId, snapshot: &Snapshot, point: Option<CurvePoint>) -> Progress {
    Progress {
        run_id: run.0,
        phase: wire::phase(snapshot.phase),
        lens_position: snapshot.lens.map(|lens| lens.position.0),
        event_rate: snapshot.event_rate.0,
        curve_point: point.map(|point| ipc::CurvePoint {
            position: point.position.0,
            rate: point.rate.0,
            t_us: point.t_us.round() as i64,
        }),
        missed: 0,
        done: false,
        report: None,
    }
}

fn last_run(report: &Report) -> ipc::LastRun {
    ipc::LastRun {
        id: report.run_id,
        state: report.result.state,
        position: report.result.position,
        reason: report.result.reason.clone(),
        error_bar: report.result.error_bar,
        confidence: report.result.confidence,
        flags: report.result.flags.clone(),
    }
}

/// One line for each run.
fn log(report: &Report) {
    let (run, elapsed_s) = (report.run_id, report.elapsed_s);
    let (events, lost) = (report.events.counted, report.events.lost);
    match (&report.result.reason, report.result.position) {
        (None, Some(position)) => {
            let (error_bar, confidence) = (report.result.error_bar, report.result.confidence);
            tracing::info!(run, position, error_bar, confidence, events, lost, elapsed_s, "focused");
        }
        (reason, _) => {
            let reason = reason.as_deref().unwrap_or("unknown");
            tracing::info!(run, reason, message = %report.result.message, events, lost, elapsed_s, "not focused");
        }
    }
}

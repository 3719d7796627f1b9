//! The state directory of a trial: what the daemon keeps there, and what must be there whatever happened to it.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context, Result};
use evfocus_core::controller::Pace;
use evfocus_ipc::{CALIBRATION_FORMAT, Calibration, LensRange, Report};
use evfocusd::VirtualRig;
use evfocusd::calibration::CalibrationFile;
use evfocusd::reports::{Kept, ReportStore};
use evfocusd::rig_delay::RigDelayFile;
use evfocusd::storage::StateDirectory;
use tempfile::TempDir;

use super::disk::{Death, FaultyDisk};

/// Reports that stay: few, so that old ones are deleted as well.
const KEPT: usize = 2;
const CAMERA: &str = "laboratory camera";
const LENS: &str = "laboratory lens";

/// The folder, and what must be in it.
#[derive(Debug)]
pub(super) struct Shelf {
    folder: TempDir,
    /// Reports that were said to be written, as JSON.
    acknowledged: BTreeMap<u64, Vec<u8>>,
    /// Whether the delays, and the calibration, were said to be written.
    delays: bool,
    calibration: bool,
}

/// What a process keeps there.
#[derive(Debug)]
pub(super) struct Keeper {
    disk: Arc<FaultyDisk>,
    store: ReportStore,
    delays: RigDelayFile,
    calibration: CalibrationFile,
    /// Runs of earlier processes.
    before: u64,
}

impl Shelf {
    pub(super) fn new() -> Result<Self> {
        let folder = tempfile::tempdir()?;
        Ok(Self { folder, acknowledged: BTreeMap::new(), delays: false, calibration: false })
    }

    /// Opens what is there, as a process does when it starts.
    pub(super) fn open(&self, disk: FaultyDisk) -> Result<Keeper> {
        let disk = Arc::new(disk);
        let state = StateDirectory::on(Arc::clone(&disk) as _, self.folder.path());
        let store = ReportStore::open(&state, Kept { newest: KEPT, age: None })?;
        Ok(Keeper {
            before: store.newest().unwrap_or(0),
            store,
            delays: RigDelayFile::new(&state, CAMERA, LENS),
            calibration: CalibrationFile::new(&state, LENS),
            disk,
        })
    }

    /// What is wrong with what is there.
    pub(super) fn check(&self) -> Result<Vec<String>> {
        let mut wrong = Vec::new();
        let there = self.reports()?;
        let number = |path: &PathBuf| path.file_stem()?.to_str()?.strip_prefix("run-")?.parse::<u64>().ok();
        let numbers: Vec<u64> = there.iter().filter_map(number).collect();
        for (path, id) in there.iter().zip(&numbers) {
            let text = fs::read(path)?;
            match serde_json::from_slice::<Report>(&text) {
                Ok(_) if self.acknowledged.get(id).is_some_and(|known| known != text.trim_ascii_end()) => {
                    wrong.push(format!("report {id} is another than was written"));
                }
                Ok(report) if report.run_id == *id => {}
                Ok(report) => wrong.push(format!("report {id} is that of run {}", report.run_id)),
                Err(error) => wrong.push(format!("report {id} cannot be read: {error}")),
            }
        }
        for id in self.acknowledged.keys() {
            let newer = numbers.iter().filter(|other| *other > id).count();
            if !numbers.contains(id) && newer < KEPT {
                wrong.push(format!("report {id} was said to be written, and is not there"));
            }
        }
        let state = StateDirectory::new(self.folder.path());
        let is_there = |name| self.folder.path().join(name).exists();
        let must = |name, acknowledged| acknowledged || is_there(name);
        if must("rig-delay.json", self.delays) && RigDelayFile::new(&state, CAMERA, LENS).read().is_none() {
            wrong.push("the learnt delay cannot be read".to_owned());
        }
        if must("lens-calibration.json", self.calibration)
            && CalibrationFile::new(&state, LENS).read().is_none()
        {
            wrong.push("the calibration cannot be read".to_owned());
        }
        Ok(wrong)
    }

    /// The files of reports.
    fn reports(&self) -> Result<Vec<PathBuf>> {
        let mut paths = Vec::new();
        for entry in fs::read_dir(self.folder.path().join("reports")).context("the folder of reports")? {
            let path = entry?.path();
            // What is still called new was never said to be there.
            if path.extension().is_some_and(|extension| extension == "json") {
                paths.push(path);
            }
        }
        Ok(paths)
    }
}

impl Keeper {
    /// Keeps what the last run of `rig` came to, and what was learnt. The process may end meanwhile.
    pub(super) fn keep(&self, rig: &VirtualRig, shelf: &mut Shelf) -> Result<Option<Death>> {
        self.disk.set_now(rig.now());
        let mut report = rig.written_report(Pace::Normal).context("a run has ended")?;
        // As a daemon does that numbers its runs from where the last one ended.
        report.run_id += self.before;
        let number = report.run_id;
        if self.store.write(&report).is_ok() {
            shelf.acknowledged.insert(number, serde_json::to_vec_pretty(&report)?);
        }
        shelf.delays |= self.delays.write(&rig.controller().delays()).is_ok();
        shelf.calibration |= self.calibration.write(&calibration(number)).is_ok();
        Ok(self.disk.died())
    }

    /// The process has ended; if power was cut, so does what was not made to last.
    pub(super) fn end(self) -> Result<()> {
        if self.disk.died() == Some(Death::PowerCut) {
            self.disk.cut_power().context("the folder after the power cut")?;
        }
        Ok(())
    }
}

/// A calibration that can be told from others.
fn calibration(number: u64) -> Calibration {
    Calibration {
        format: CALIBRATION_FORMAT,
        lens: LENS.to_owned(),
        measured_unix_s: number as f64,
        range: LensRange { min: 0.0, max: 100.0 },
        speed_counts_per_s: 50.0,
        read_back_hz: 100.0,
        read_back_us: 10_000.0,
        read_noise: 0.0,
        command_latency_us: 5000.0,
        stop_us: 20_000.0,
        stop_counts: 1.0,
        backlash: None,
        backlash_error_bar: None,
        lag_us: None,
        notes: vec![],
    }
}

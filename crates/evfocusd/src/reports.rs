//! The state directory: a JSON file for each run, written so that a reader sees all of it or nothing.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use evfocus_ipc::{Error, Report};

use crate::storage::{failed, write_json};

const PREFIX: &str = "run-";
const SUFFIX: &str = ".json";

/// Where reports are kept.
#[derive(Debug, Clone)]
pub(crate) struct ReportStore {
    directory: PathBuf,
    kept: usize,
    /// Held while the store lives, so that no other daemon numbers its runs in the same directory.
    _lock: Arc<File>,
}

impl ReportStore {
    /// The store in `state_dir`, which is made if it is not there. Of the reports, the newest `kept` stay.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the directory and the remedy.
    pub(crate) fn open(state_dir: &Path, kept: usize) -> Result<Self, Error> {
        let directory = state_dir.join("reports");
        fs::create_dir_all(&directory).map_err(|error| failed(&directory, &error))?;
        let lock = File::open(&directory).map_err(|error| failed(&directory, &error))?;
        rustix::fs::flock(&lock, rustix::fs::FlockOperation::NonBlockingLockExclusive).map_err(|_| {
            Error::StorageFailed {
                path: directory.display().to_string(),
                message: "another evfocusd writes its reports there; name another directory with --state-dir"
                    .to_owned(),
            }
        })?;
        Ok(Self { directory, kept: kept.max(1), _lock: Arc::new(lock) })
    }

    fn path(&self, id: u64) -> PathBuf {
        // Leading zeros make an alphabetical listing chronological.
        self.directory.join(format!("{PREFIX}{id:08}{SUFFIX}"))
    }

    /// Writes `report` whole or not at all.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub(crate) fn write(&self, report: &Report) -> Result<PathBuf, Error> {
        let path = self.path(report.run_id);
        write_json(&path, report)?;
        self.drop_oldest();
        Ok(path)
    }

    /// The report of run `id`, or of the newest run that has one.
    ///
    /// # Errors
    /// [`Error::NoSuchReport`], or [`Error::StorageFailed`] if it is there and cannot be read.
    pub(crate) fn read(&self, id: Option<u64>) -> Result<Report, Error> {
        let Some(wanted) = id.or_else(|| self.newest()) else {
            return Err(Error::NoSuchReport { id });
        };
        let path = self.path(wanted);
        let text = match fs::read(&path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(Error::NoSuchReport { id }),
            Err(error) => return Err(failed(&path, &error)),
        };
        serde_json::from_slice(&text).map_err(|error| Error::StorageFailed {
            path: path.display().to_string(),
            message: format!("not a report of this version: {error}"),
        })
    }

    /// The number of the newest report.
    pub(crate) fn newest(&self) -> Option<u64> {
        self.numbers().into_iter().max()
    }

    fn numbers(&self) -> Vec<u64> {
        let Ok(entries) = fs::read_dir(&self.directory) else { return Vec::new() };
        entries
            .filter_map(|entry| {
                let name = entry.ok()?.file_name();
                name.to_str()?.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?.parse().ok()
            })
            .collect()
    }

    fn drop_oldest(&self) {
        let mut numbers = self.numbers();
        numbers.sort_unstable();
        let surplus = numbers.len().saturating_sub(self.kept);
        for &number in numbers.iter().take(surplus) {
            if let Err(error) = fs::remove_file(self.path(number)) {
                tracing::warn!(run = number, %error, "an old report cannot be deleted");
            }
        }
    }
}

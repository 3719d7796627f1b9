//! The state directory: a JSON file for each run, written so that a reader sees all of it or nothing.

use std::fs::{self, File};
use std::io;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use evfocus_ipc::{Error, Report};
use tokio::sync::watch;

use crate::storage::{StateDirectory, failed};

const PREFIX: &str = "run-";
const SUFFIX: &str = ".json";

/// Which reports stay; the newest always does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kept {
    /// So many.
    pub newest: usize,
    /// Those younger than this.
    pub age: Option<Duration>,
}

/// Where reports are kept.
#[derive(Debug, Clone)]
pub struct ReportStore {
    state: StateDirectory,
    directory: PathBuf,
    kept: Arc<Mutex<Kept>>,
    /// Held while the store lives, so that no other daemon numbers its runs in the same directory.
    _lock: Arc<File>,
}

impl ReportStore {
    /// The store in `state`, which is made if it is not there. Of the reports, those stay that `kept` says.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the directory and the remedy.
    pub fn open(state: &StateDirectory, kept: Kept) -> Result<Self, Error> {
        let directory = state.path("reports");
        fs::create_dir_all(&directory).map_err(|error| failed(&directory, &error))?;
        let lock = File::open(&directory).map_err(|error| failed(&directory, &error))?;
        rustix::fs::flock(&lock, rustix::fs::FlockOperation::NonBlockingLockExclusive).map_err(|_| {
            Error::StorageFailed {
                path: directory.display().to_string(),
                message: "another evfocusd writes its reports there; name another directory with --state-dir"
                    .to_owned(),
            }
        })?;
        Ok(Self { state: state.clone(), directory, kept: Arc::new(Mutex::new(kept)), _lock: Arc::new(lock) })
    }

    fn path(&self, id: u64) -> PathBuf {
        // Leading zeros make an alphabetical listing chronological.
        self.directory.join(format!("{PREFIX}{id:08}{SUFFIX}"))
    }

    /// Writes `report` whole or not at all.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub fn write(&self, report: &Report) -> Result<PathBuf, Error> {
        let path = self.path(report.run_id);
        self.state.write_json(&path, report)?;
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
    pub fn newest(&self) -> Option<u64> {
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
        let kept = *self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let mut numbers = self.numbers();
        numbers.sort_unstable();
        // The newest is not among them.
        numbers.pop();
        let surplus = (numbers.len() + 1).saturating_sub(kept.newest);
        for (index, &number) in numbers.iter().enumerate() {
            if (index < surplus || self.is_older(number, kept.age))
                && let Err(error) = self.state.remove(&self.path(number))
            {
                tracing::warn!(run = number, %error, "an old report cannot be deleted");
            }
        }
    }

    /// A file whose age cannot be told is not old: the clock may have been set back.
    fn is_older(&self, number: u64, age: Option<Duration>) -> bool {
        let written = || fs::metadata(self.path(number)).ok()?.modified().ok()?.elapsed().ok();
        age.is_some_and(|age| written().is_some_and(|elapsed| elapsed > age))
    }
}

/// The reports on disk, and the newest one in memory: a full disk must not swallow it.
#[derive(Debug, Clone)]
pub(crate) struct Reports {
    store: Result<ReportStore, Error>,
    newest: watch::Sender<Option<Arc<Report>>>,
}

impl Reports {
    /// Reports in `store`, or in memory only if that could not be opened.
    pub(crate) fn new(store: Result<ReportStore, Error>) -> Self {
        Self { store, newest: watch::Sender::new(None) }
    }

    /// From the next report on, those stay that `kept` says.
    pub(crate) fn keep(&self, kept: Kept) {
        if let Ok(store) = &self.store {
            *store.kept.lock().unwrap_or_else(PoisonError::into_inner) = kept;
        }
    }

    /// What is wrong with the store.
    pub(crate) fn fault(&self) -> Option<String> {
        self.store.as_ref().err().map(ToString::to_string)
    }

    /// The number of the newest report on disk.
    pub(crate) fn newest_on_disk(&self) -> Option<u64> {
        self.store.as_ref().ok()?.newest()
    }

    /// Keeps `report`, in memory at least.
    ///
    /// # Errors
    /// [`Error::StorageFailed`].
    pub(crate) fn write(&self, report: &Arc<Report>) -> Result<(), Error> {
        self.newest.send_replace(Some(Arc::clone(report)));
        match &self.store {
            Ok(store) => {
                store.write(report).map(|path| tracing::debug!(path = %path.display(), "report written"))
            }
            Err(error) => Err(error.clone()),
        }
    }

    /// The report of run `id`, or of the last one.
    ///
    /// # Errors
    /// [`Error::NoSuchReport`] or [`Error::StorageFailed`].
    pub(crate) fn read(&self, id: Option<u64>) -> Result<Report, Error> {
        if let Some(newest) = self.newest.borrow().as_ref()
            && id.is_none_or(|id| id == newest.run_id)
        {
            return Ok(Report::clone(newest));
        }
        match &self.store {
            Ok(store) => store.read(id),
            Err(_) => Err(Error::NoSuchReport { id }),
        }
    }
}

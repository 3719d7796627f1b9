//! The state directory: a JSON file for each run, written so that a reader sees all of it or nothing.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use evfocus_ipc::{Error, Report};

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

    /// Writes `report`: to a file of another name, which is made durable and then renamed.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub(crate) fn write(&self, report: &Report) -> Result<PathBuf, Error> {
        let path = self.path(report.run_id);
        let temporary = path.with_extension("json.new");
        let written = self.write_through(report, &temporary, &path);
        if let Err(error) = written {
            // What is left of the attempt takes room that is short; if even this fails there is nothing to add.
            fs::remove_file(&temporary).unwrap_or_default();
            return Err(failed(&path, &error));
        }
        self.drop_oldest();
        Ok(path)
    }

    fn write_through(&self, report: &Report, temporary: &Path, path: &Path) -> io::Result<()> {
        let mut file = File::create(temporary)?;
        let mut json = serde_json::to_vec_pretty(report)?;
        json.push(b'\n');
        file.write_all(&json)?;
        file.sync_all()?;
        fs::rename(temporary, path)?;
        // The new name must survive a power cut too.
        File::open(&self.directory)?.sync_all()
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

fn failed(path: &Path, error: &io::Error) -> Error {
    const FULL: [io::ErrorKind; 3] =
        [io::ErrorKind::StorageFull, io::ErrorKind::QuotaExceeded, io::ErrorKind::FileTooLarge];
    const FORBIDDEN: [io::ErrorKind; 2] =
        [io::ErrorKind::PermissionDenied, io::ErrorKind::ReadOnlyFilesystem];
    let remedy = if FULL.contains(&error.kind()) {
        "make room on that disk"
    } else if FORBIDDEN.contains(&error.kind()) {
        "let the daemon's user write there, or name another directory with --state-dir"
    } else {
        "check the directory, or name another one with --state-dir"
    };
    Error::StorageFailed { path: path.display().to_string(), message: format!("{error}; {remedy}") }
}

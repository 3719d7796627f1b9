//! The state directory: files that are there whole or not at all, whatever happens in between.

use std::fmt::Debug;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use evfocus_ipc::Error;
use serde::Serialize;

/// The steps by which the state directory changes: each may fail, and each may be the last before a kill or a power cut. That is
/// why there are two: the operating system's, and the fault laboratory's.
pub trait Disk: Debug + Send + Sync {
    /// Makes or empties the file at `path`, and writes `bytes` to it.
    ///
    /// # Errors
    /// The operating system's; a part may have been written.
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()>;

    /// Makes what was written to the file at `path`, or the names given in the directory at `path`, outlast a power cut.
    ///
    /// # Errors
    /// The operating system's.
    fn sync(&self, path: &Path) -> io::Result<()>;

    /// Gives the file at `from` the name `to`, which is taken from any other.
    ///
    /// # Errors
    /// The operating system's; nothing has changed then.
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()>;

    /// Deletes the file at `path`.
    ///
    /// # Errors
    /// The operating system's.
    fn remove(&self, path: &Path) -> io::Result<()>;
}

/// The operating system's disk.
#[derive(Debug)]
struct SystemDisk;

impl Disk for SystemDisk {
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        File::create(path)?.write_all(bytes)
    }

    fn sync(&self, path: &Path) -> io::Result<()> {
        File::open(path)?.sync_all()
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        fs::rename(from, to)
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        fs::remove_file(path)
    }
}

/// Where the daemon keeps what must outlive it.
#[derive(Debug, Clone)]
pub struct StateDirectory {
    path: PathBuf,
    disk: Arc<dyn Disk>,
}

impl StateDirectory {
    /// The directory at `path`.
    pub fn new(path: &Path) -> Self {
        Self::on(Arc::new(SystemDisk), path)
    }

    /// The directory at `path`, changed through `disk`.
    pub fn on(disk: Arc<dyn Disk>, path: &Path) -> Self {
        Self { path: path.to_owned(), disk }
    }

    /// Where the file or directory `name` is.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// Writes `value` as JSON to the file at `path`: to one of another name, which is made durable and then renamed.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub(crate) fn write_json(&self, path: &Path, value: &impl Serialize) -> Result<(), Error> {
        let temporary = path.with_extension("json.new");
        self.write_through(value, &temporary, path).map_err(|error| {
            // What is left of the attempt takes room that is short; if even this fails there is nothing to add.
            self.disk.remove(&temporary).unwrap_or_default();
            failed(path, &error)
        })
    }

    fn write_through(&self, value: &impl Serialize, temporary: &Path, path: &Path) -> io::Result<()> {
        let mut json = serde_json::to_vec_pretty(value)?;
        json.push(b'\n');
        self.disk.write(temporary, &json)?;
        self.disk.sync(temporary)?;
        self.disk.rename(temporary, path)?;
        // The new name must survive a power cut too.
        path.parent().map_or(Ok(()), |directory| self.disk.sync(directory))
    }

    /// Deletes the file at `path`.
    ///
    /// # Errors
    /// The operating system's.
    pub(crate) fn remove(&self, path: &Path) -> io::Result<()> {
        self.disk.remove(path)
    }
}

/// What `error` means for the file or directory at `path`, and what to do about it.
pub(crate) fn failed(path: &Path, error: &io::Error) -> Error {
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

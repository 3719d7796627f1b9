//! Files that are there whole or not at all.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::Path;

use evfocus_ipc::Error;
use serde::Serialize;

/// Writes `value` as JSON to `path`: to a file of another name, which is made durable and then renamed.
///
/// # Errors
/// [`Error::StorageFailed`], naming the file; what was there before stays.
pub(crate) fn write_json(path: &Path, value: &impl Serialize) -> Result<(), Error> {
    let temporary = path.with_extension("json.new");
    write_through(value, &temporary, path).map_err(|error| {
        // What is left of the attempt takes room that is short; if even this fails there is nothing to add.
        fs::remove_file(&temporary).unwrap_or_default();
        failed(path, &error)
    })
}

fn write_through(value: &impl Serialize, temporary: &Path, path: &Path) -> io::Result<()> {
    let mut file = File::create(temporary)?;
    let mut json = serde_json::to_vec_pretty(value)?;
    json.push(b'\n');
    file.write_all(&json)?;
    file.sync_all()?;
    fs::rename(temporary, path)?;
    // The new name must survive a power cut too.
    path.parent().map_or(Ok(()), |directory| File::open(directory)?.sync_all())
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

//! Files that are named on the command line: what can be said of them before one is opened.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::bail;

use crate::exit::UsageError;

/// Refuses to write one file twice, or over what is read. Each file comes with the option that names it.
pub(crate) fn must_differ(files: &[(&str, &Path)]) -> Result<(), UsageError> {
    let mut seen: Vec<(&str, PathBuf)> = Vec::new();
    for (option, path) in files {
        // A device such as /dev/null takes any number of outputs.
        if path.exists() && !path.is_file() {
            continue;
        }
        let place = place(path);
        if let Some((other, _)) = seen.iter().find(|(_, other)| *other == place) {
            return Err(UsageError(format!(
                "{other} and {option} name the same file, {}; give each a file of its own",
                path.display()
            )));
        }
        seen.push((option, place));
    }
    Ok(())
}

/// Refuses a file to be written whose folder is not there, before the work for it is done.
pub(crate) fn must_have_folder(files: &[(&str, &Path)]) -> anyhow::Result<()> {
    for (option, path) in files {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            bail!("{option} {}: there is no directory {}; make it first", path.display(), folder.display());
        }
    }
    Ok(())
}

/// Refuses a folder where a file is to be read: the system's own message names neither the file nor the remedy.
pub(crate) fn must_not_be_folder(path: &Path, what: &str) -> anyhow::Result<()> {
    if path.is_dir() {
        bail!("{}: this is a directory; name a {what} file", path.display());
    }
    Ok(())
}

/// Where `path` leads, whichever way it is written, for files that may not be there yet.
fn place(path: &Path) -> PathBuf {
    let in_folder = || {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        Some(fs::canonicalize(folder.unwrap_or(Path::new("."))).ok()?.join(path.file_name()?))
    };
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_owned())
}

//! What is kept between runs: simulated sweeps and the results of finished sequences.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::result::SequenceResult;

/// A folder with what earlier runs made. Everything in it can be made again; it may be deleted at any time.
#[derive(Debug, Clone)]
pub struct Cache {
    folder: PathBuf,
    program: String,
    is_fresh: bool,
}

impl Cache {
    /// A cache in `folder`. Results hold for one `program` only, whatever tells one build from another; if `is_fresh`, what is there is
    /// made again.
    ///
    /// # Errors
    /// A folder that cannot be made.
    pub fn new(folder: PathBuf, program: String, is_fresh: bool) -> anyhow::Result<Self> {
        for part in ["sweeps", "results"] {
            let folder = folder.join(part);
            fs::create_dir_all(&folder)
                .with_context(|| format!("{}: cannot make the folder; name another one", folder.display()))?;
        }
        Ok(Self { folder, program, is_fresh })
    }

    /// The folder of what `key` describes; `fill` makes its files if it is not there. It appears when it is complete, not before.
    ///
    /// # Errors
    /// What `fill` fails with, or a folder that cannot be written.
    pub fn sweep_folder(
        &self,
        key: &str,
        fill: impl FnOnce(&Path) -> anyhow::Result<()>,
    ) -> anyhow::Result<PathBuf> {
        let folder = self.folder.join("sweeps").join(fingerprint(key.as_bytes()));
        if folder.is_dir() && !self.is_fresh {
            return Ok(folder);
        }
        let partial = Self::partial(&folder);
        let shown = || format!("{}: cannot write", partial.display());
        remove_folder(&partial).with_context(shown)?;
        fs::create_dir_all(&partial).with_context(shown)?;
        fill(&partial)?;
        remove_folder(&folder).with_context(shown)?;
        fs::rename(&partial, &folder).with_context(shown)?;
        Ok(folder)
    }

    /// What was found for the sequence with `key` by this program, if it was.
    pub fn result(&self, key: &str) -> Option<SequenceResult> {
        if self.is_fresh {
            return None;
        }
        let text = fs::read(self.result_path(key)).ok()?;
        // Written by another version or cut short: as if there were none.
        serde_json::from_slice(&text).ok()
    }

    /// Keeps `result`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn keep_result(&self, key: &str, result: &SequenceResult) -> anyhow::Result<()> {
        let path = self.result_path(key);
        let partial = Self::partial(&path);
        let text = serde_json::to_vec(result)?;
        fs::write(&partial, text).with_context(|| format!("{}: cannot write", partial.display()))?;
        fs::rename(&partial, &path).with_context(|| format!("{}: cannot write", path.display()))
    }

    fn result_path(&self, key: &str) -> PathBuf {
        let name = fingerprint(format!("{} {key}", self.program).as_bytes());
        self.folder.join("results").join(format!("{name}.json"))
    }

    /// A name beside `path` that no other process uses.
    fn partial(path: &Path) -> PathBuf {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        path.with_file_name(format!("{name}.{}.partial", std::process::id()))
    }
}

fn remove_folder(folder: &Path) -> std::io::Result<()> {
    if folder.is_dir() { fs::remove_dir_all(folder) } else { Ok(()) }
}

/// 64 bits of `bytes` in hexadecimal (FNV-1a): the same in every version of this program, which the standard library's hashes do not promise.
pub fn fingerprint(bytes: &[u8]) -> String {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("{hash:016x}")
}

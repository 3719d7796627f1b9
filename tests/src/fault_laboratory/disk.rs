//! A disk that fails as its script says, on a real folder, and what a kill or a power cut leaves there.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use evfocus_core::HostMicros;
use evfocusd::storage::Disk;
use rand::RngExt;
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

use super::devices::{Spell, current};

/// What a disk may do wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum DiskFault {
    /// There is room for a part of what is to be written, and no more.
    Full,
    /// Nothing may be changed.
    ReadOnly,
    /// What was written cannot be made to last.
    Broken,
}

/// How a process ends in the middle of a write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Death {
    /// It is killed: what it has written is there.
    Killed,
    /// Power is cut: what was not made to last may be there or not.
    PowerCut,
}

/// The disk.
#[derive(Debug)]
pub(super) struct FaultyDisk {
    script: Vec<Spell<DiskFault>>,
    /// The step in which the process ends.
    death: Option<(u32, Death)>,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    now: HostMicros,
    steps: u32,
    died: Option<Death>,
    /// Files whose content a power cut may take.
    unsynced: BTreeSet<PathBuf>,
    /// Names that a power cut may take back: from, to, and what had the name before.
    renamed: Vec<(PathBuf, PathBuf, Option<Vec<u8>>)>,
    draw: Xoshiro256PlusPlus,
}

impl FaultyDisk {
    pub(super) fn new(script: Vec<Spell<DiskFault>>, death: Option<(u32, Death)>, seed: u64) -> Self {
        let state = State {
            now: HostMicros(0),
            steps: 0,
            died: None,
            unsynced: BTreeSet::new(),
            renamed: Vec::new(),
            draw: Xoshiro256PlusPlus::seed_from_u64(seed),
        };
        Self { script, death, state: Mutex::new(state) }
    }

    /// From now on it is `now`.
    pub(super) fn set_now(&self, now: HostMicros) {
        self.lock().now = now;
    }

    /// Whether the process has ended in the middle of a write, and how.
    pub(super) fn died(&self) -> Option<Death> {
        self.lock().died
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What the coming step meets with; who is dead takes no steps.
    fn step(&self, state: &mut State) -> io::Result<Option<DiskFault>> {
        if state.died.is_some() {
            return Err(io::Error::other("the process is dead"));
        }
        state.steps += 1;
        if let Some((_, death)) = self.death.filter(|(step, _)| *step == state.steps) {
            state.died = Some(death);
        }
        let fault = current(&self.script, state.now);
        if fault == Some(DiskFault::ReadOnly) {
            return Err(io::ErrorKind::ReadOnlyFilesystem.into());
        }
        Ok(fault)
    }

    /// What the power cut leaves: of files any part, of names the old or the new.
    pub(super) fn cut_power(&self) -> io::Result<()> {
        let state = &mut *self.lock();
        // Names are taken back in their order, the newest first.
        while state.draw.random_bool(0.5)
            && let Some((from, to, before)) = state.renamed.pop()
        {
            fs::rename(&to, &from)?;
            if let Some(before) = before {
                fs::write(&to, before)?;
            }
            if state.unsynced.remove(&to) {
                state.unsynced.insert(from);
            }
        }
        for path in std::mem::take(&mut state.unsynced) {
            let bytes = fs::read(&path)?;
            let kept = state.draw.random_range(0..=bytes.len());
            fs::write(&path, &bytes[..kept])?;
        }
        Ok(())
    }
}

impl Disk for FaultyDisk {
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let state = &mut *self.lock();
        let fault = self.step(state)?;
        state.unsynced.insert(path.to_owned());
        if fault != Some(DiskFault::Full) && state.died.is_none() {
            return fs::write(path, bytes);
        }
        let room = state.draw.random_range(0..=bytes.len());
        fs::write(path, &bytes[..room])?;
        Err(io::ErrorKind::StorageFull.into())
    }

    fn sync(&self, path: &Path) -> io::Result<()> {
        let state = &mut *self.lock();
        let fault = self.step(state)?;
        if fault == Some(DiskFault::Broken) || state.died.is_some() {
            return Err(io::Error::other("input/output error"));
        }
        state.unsynced.remove(path);
        state.renamed.retain(|(_, to, _)| to.parent() != Some(path));
        Ok(())
    }

    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        let state = &mut *self.lock();
        self.step(state)?;
        let before = fs::read(to).ok();
        fs::rename(from, to)?;
        if state.unsynced.remove(from) {
            state.unsynced.insert(to.to_owned());
        }
        state.renamed.push((from.to_owned(), to.to_owned(), before));
        // It is done, but nobody is left who could be told.
        if state.died.is_some() { Err(io::Error::other("the process is dead")) } else { Ok(()) }
    }

    fn remove(&self, path: &Path) -> io::Result<()> {
        let state = &mut *self.lock();
        self.step(state)?;
        fs::remove_file(path)?;
        state.unsynced.remove(path);
        // What is gone has no name that could be taken back.
        state.renamed.retain(|(_, to, _)| to != path);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a power cut leaves of a file that is written anew and renamed as `steps` say.
    fn left(seed: u64, steps: impl Fn(&FaultyDisk, &Path, &Path)) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let (new, path) = (folder.path().join("new"), folder.path().join("file"));
        fs::write(&path, "before").unwrap();
        let disk = FaultyDisk::new(Vec::new(), None, seed);
        steps(&disk, &new, &path);
        disk.cut_power().unwrap();
        fs::read(&path).unwrap()
    }

    #[test]
    fn a_power_cut_takes_what_was_not_made_to_last() {
        let (mut torn, mut old) = (0, 0);
        for seed in 0..50 {
            let unsynced = left(seed, |disk, new, path| {
                disk.write(new, b"afterwards").unwrap();
                disk.rename(new, path).unwrap();
            });
            torn += usize::from(!matches!(&unsynced[..], b"before" | b"afterwards"));
            let unnamed = left(seed, |disk, new, path| {
                disk.write(new, b"afterwards").unwrap();
                disk.sync(new).unwrap();
                disk.rename(new, path).unwrap();
            });
            assert!(matches!(&unnamed[..], b"before" | b"afterwards"));
            old += usize::from(unnamed == b"before");
            let lasting = left(seed, |disk, new, path| {
                disk.write(new, b"afterwards").unwrap();
                disk.sync(new).unwrap();
                disk.rename(new, path).unwrap();
                disk.sync(path.parent().unwrap()).unwrap();
            });
            assert_eq!(lasting, b"afterwards");
        }
        assert!(torn > 10 && old > 10, "{torn} torn, {old} old of 50");
    }

    #[test]
    fn who_is_killed_in_the_middle_of_a_write_does_nothing_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let disk = FaultyDisk::new(Vec::new(), Some((2, Death::Killed)), 1);
        disk.write(&path, b"whole").unwrap();
        disk.write(&path, b"half of it").unwrap_err();
        let left = fs::read(&path).unwrap();
        assert!(b"half of it".starts_with(&left[..]), "{left:?}");
        disk.remove(&path).unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), left);
        assert_eq!(disk.died(), Some(Death::Killed));
    }
}

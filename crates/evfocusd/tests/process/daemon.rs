//! A daemon with the simulated rig in a folder of its own, and what the tests ask of it.

use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use anyhow::{Context, Result, anyhow, bail};
use evfocus_ipc::client::Client;
use evfocus_ipc::{FocusRequest, LensRange, Phase, Report, State, Status};
use tempfile::TempDir;

pub(crate) const EVFOCUSD: &str = env!("CARGO_BIN_EXE_evfocusd");

/// The simulated rig keeps a core busy, in real time: tests that count on that core take turns.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    // What it guards is the computer's time, which no panic spoils.
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) struct Daemon {
    child: Child,
    /// Reads what it logs: whoever does not read what a process says stops it in the end.
    log: Option<JoinHandle<std::io::Result<String>>>,
    folder: Option<TempDir>,
    /// What it had logged when it was ready.
    pub(crate) started: String,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It has ended already in the tests that pass; one that fails must not leave it behind.
        self.child.kill().unwrap_or_default();
        self.child.wait().map(drop).unwrap_or_default();
    }
}

impl Daemon {
    pub(crate) fn start() -> Result<Self> {
        Self::start_in(tempfile::tempdir()?)
    }

    pub(crate) fn start_in(folder: TempDir) -> Result<Self> {
        Self::start_after(folder, "")
    }

    /// Starts it after `words` of the shell, which may limit what it can do. Returns once it says that it is ready.
    pub(crate) fn start_after(folder: TempDir, words: &str) -> Result<Self> {
        let mut child = Command::new("sh")
            .arg("-c")
            .arg(format!("{words} exec \"$0\" --socket \"$1/socket\" --state-dir \"$1/state\""))
            .args([EVFOCUSD.as_ref(), folder.path().as_os_str()])
            .env_remove("JOURNAL_STREAM")
            .env_remove("EVFOCUS_LOG")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let mut log = BufReader::new(child.stderr.take().context("standard error")?);
        let mut started = String::new();
        while !started.contains(" ready ") {
            if log.read_line(&mut started)? == 0 {
                bail!("not ready: {started}");
            }
        }
        let rest = std::thread::spawn(move || {
            let mut rest = String::new();
            log.read_to_string(&mut rest).map(|_| rest)
        });
        Ok(Self { child, log: Some(rest), folder: Some(folder), started })
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.as_ref().map(|folder| folder.path().join(name)).unwrap_or_default()
    }

    pub(crate) fn socket(&self) -> PathBuf {
        self.path("socket")
    }

    pub(crate) fn reports(&self) -> PathBuf {
        self.path("state/reports")
    }

    /// Sends a signal and returns how the daemon ended, the rest of its log, and what it leaves.
    pub(crate) fn end(mut self, signal: &str) -> Result<(ExitStatus, String, TempDir)> {
        kill(signal, self.child.id())?;
        let status = self.child.wait()?;
        let log = self.log.take().context("a log")?.join().map_err(|_| anyhow!("no log"))??;
        Ok((status, log, self.folder.take().context("a folder")?))
    }

    /// Kills it, without a chance to say or do anything, and starts another in its place.
    pub(crate) fn kill_and_restart(self) -> Result<Self> {
        let (_, _, folder) = self.end("-KILL")?;
        Self::start_in(folder)
    }

    pub(crate) async fn client(&self) -> Result<Client> {
        Ok(Client::connect(&self.socket()).await?)
    }

    pub(crate) async fn status(&self) -> Result<Status> {
        Ok(self.client().await?.status().await?)
    }

    /// Makes a run, which finds focus.
    pub(crate) async fn focus(&self, request: &FocusRequest) -> Result<Report> {
        let report = self.client().await?.focus_and_wait(request).await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        Ok(report)
    }

    /// Starts a run, which goes on when this returns in `phase`.
    pub(crate) async fn focus_until(&self, request: &FocusRequest, phase: Phase) -> Result<()> {
        let mut progress = self.client().await?.focus(request).await?;
        while let Some(news) = progress.next().await? {
            if news.phase == phase {
                return Ok(());
            }
        }
        bail!("the run ended without {phase}")
    }
}

/// Sends `signal` to a process.
pub(crate) fn kill(signal: &str, process: u32) -> Result<()> {
    let sent = Command::new("kill").arg(signal).arg(process.to_string()).status()?;
    anyhow::ensure!(sent.success(), "{signal} was not sent");
    Ok(())
}

/// A short sweep: the simulated rig runs in real time here.
pub(crate) fn short() -> FocusRequest {
    FocusRequest {
        range: Some(LensRange { min: 1600.0, max: 2400.0 }),
        directions: Some("forward".to_owned()),
        ..FocusRequest::default()
    }
}

/// The same there and back, which teaches the delay of the pixels.
pub(crate) fn short_both_ways() -> FocusRequest {
    FocusRequest { directions: None, ..short() }
}

pub(crate) fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(future)
}

//! The daemon as a process when the world around it misbehaves: it is killed, clients lie, hang or come in crowds, the state directory
//! cannot be written, file descriptors run out.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};

use anyhow::{Context, Result, bail};
use evfocus_ipc::client::Client;
use evfocus_ipc::{FocusRequest, LensRange, Phase, Report, State, Status};
use tempfile::TempDir;

/// The simulated rig keeps a core busy, in real time.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

fn alone() -> MutexGuard<'static, ()> {
    // What it guards is the computer's time, which no panic spoils.
    ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A daemon with the simulated rig.
struct Daemon {
    child: Child,
    folder: TempDir,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.child.kill().unwrap_or_default();
        self.child.wait().map(drop).unwrap_or_default();
    }
}

impl Daemon {
    fn start() -> Result<Self> {
        Self::start_in(tempfile::tempdir()?, "")
    }

    /// Starts with `limits`, words for the shell, before it, and returns once it is ready.
    fn start_in(folder: TempDir, limits: &str) -> Result<Self> {
        let (socket, state) = (folder.path().join("socket"), folder.path().join("state"));
        let mut child = Command::new("sh")
            .arg("-c")
            .arg(format!("{limits} exec \"$0\" --socket \"$1\" --state-dir \"$2\""))
            .args([env!("CARGO_BIN_EXE_evfocusd").as_ref(), socket.as_os_str(), state.as_os_str()])
            .env_remove("JOURNAL_STREAM")
            .env_remove("EVFOCUS_LOG")
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()?;
        let mut log = BufReader::new(child.stderr.take().context("standard error")?);
        let mut seen = String::new();
        while !seen.contains(" ready ") {
            if log.read_line(&mut seen)? == 0 {
                bail!("not ready: {seen}");
            }
        }
        // Whoever does not read what a process says stops it in the end.
        std::thread::spawn(move || std::io::copy(&mut log, &mut std::io::sink()));
        Ok(Self { child, folder })
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("socket")
    }

    fn reports(&self) -> PathBuf {
        self.folder.path().join("state/reports")
    }

    /// Kills it, without a chance to say or do anything, and starts another in its place.
    fn kill_and_restart(mut self) -> Result<Self> {
        self.child.kill()?;
        self.child.wait()?;
        let folder = std::mem::replace(&mut self.folder, tempfile::tempdir()?);
        Self::start_in(folder, "")
    }

    async fn status(&self) -> Result<Status> {
        Ok(Client::connect(&self.socket()).await?.status().await?)
    }

    async fn focus(&self) -> Result<Report> {
        Ok(Client::connect(&self.socket()).await?.focus_and_wait(&short()).await?)
    }
}

fn short() -> FocusRequest {
    FocusRequest {
        range: Some(LensRange { min: 1600.0, max: 2400.0 }),
        directions: Some("forward".to_owned()),
        ..FocusRequest::default()
    }
}

fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(future)
}

#[test]
fn killed_in_mid_sweep_it_starts_again_with_every_report_and_a_lens_at_rest() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let first = block_on(daemon.focus())?;
    block_on(async {
        let mut run = Client::connect(&daemon.socket()).await?.focus(&FocusRequest::default()).await?;
        while run.next().await?.context("a sweep")?.phase != Phase::Sweeping {}
        Ok(())
    })?;
    let daemon = daemon.kill_and_restart()?;
    block_on(async {
        let status = daemon.status().await?;
        assert_eq!((status.state, status.lens_moving, status.fault.as_deref()), (State::Idle, false, None));
        assert_eq!(status.last_run.as_ref().map(|run| run.id), Some(first.run_id));
        assert_eq!(Client::connect(&daemon.socket()).await?.report(None).await?, first);
        // The number of the run that was killed is free: it has left nothing.
        assert_eq!(daemon.focus().await?.run_id, first.run_id + 1);
        Ok(())
    })
}

/// Whatever a kill leaves behind of a file that was being written.
#[test]
fn what_a_kill_leaves_of_a_report_harms_no_other() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let first = block_on(daemon.focus())?;
    let (done, begun) =
        (daemon.reports().join("run-00000001.json"), daemon.reports().join("run-00000002.json.new"));
    let whole = fs::read(done)?;
    let mut daemon = daemon;
    for length in [0, 1, whole.len() / 2, whole.len() - 1, whole.len()] {
        fs::write(&begun, whole.get(..length).unwrap_or_default())?;
        daemon = daemon.kill_and_restart()?;
        let kept = block_on(async { Ok(Client::connect(&daemon.socket()).await?.report(None).await?) })?;
        assert_eq!(kept, first, "with {length} bytes of the next report");
    }
    let second = block_on(daemon.focus())?;
    assert_eq!(second.run_id, 2);
    assert!(!begun.exists(), "the rest of the attempt is replaced");
    Ok(())
}

#[test]
fn five_hundred_clients_take_no_place_that_is_not_theirs() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let crowd: Vec<UnixStream> =
        (0..500).map(|_| UnixStream::connect(daemon.socket())).collect::<Result<_, _>>()?;
    block_on(async {
        let refused =
            Client::connect(&daemon.socket()).await?.status().await.err().context("one too many")?;
        assert!(refused.to_string().contains("64 clients"), "{refused}");
        drop(crowd);
        // Those that hung up give their places back as soon as the daemon looks.
        for _ in 0..100 {
            if daemon.status().await.is_ok() {
                break;
            }
        }
        let report = daemon.focus().await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        Ok(())
    })
}

#[test]
fn garbage_and_floods_during_a_run_change_nothing_of_it() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    let socket = daemon.socket();
    let shouting = std::thread::spawn(move || {
        for round in 0..60_u32 {
            let Ok(mut stream) = UnixStream::connect(&socket) else { continue };
            let noise = match round % 4 {
                0 => vec![0xff; 200_000],
                1 => b"{\"method\":\"org.evfocus.Controller.GetStatus\"}\0".repeat(500),
                2 => b"{\"method\":\"org.evfocus.Controller.MoveTo\",\"parameters\":{\"position\":1e400}}\0"
                    .to_vec(),
                _ => vec![b'['; 60_000],
            };
            // It hangs up when it has had enough.
            stream.write_all(&noise).unwrap_or_default();
        }
    });
    let report = block_on(daemon.focus())?;
    assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
    assert_eq!(report.events.lost, 0, "the control path has lost nothing to it");
    assert!(shouting.join().is_ok());
    Ok(())
}

#[test]
fn a_client_that_is_stopped_in_the_middle_of_a_stream_delays_nobody() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start()?;
    // Asks for news and never reads any, as a process under SIGSTOP does.
    let mut stopped = UnixStream::connect(daemon.socket())?;
    stopped.write_all(b"{\"method\":\"org.evfocus.Controller.Focus\",\"more\":true}\0")?;
    stopped.write_all(b"{\"method\":\"org.evfocus.Controller.Monitor\",\"more\":true}\0")?;
    block_on(async {
        while daemon.status().await?.state != State::Scanning {}
        while daemon.status().await?.state == State::Scanning {}
        let report = daemon.focus().await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        Ok(())
    })
}

#[test]
fn a_state_directory_that_cannot_be_written_costs_no_run() -> Result<()> {
    let _alone = alone();
    let folder = tempfile::tempdir()?;
    // A file where a directory should be: not even root can write there.
    fs::write(folder.path().join("state"), "in the way")?;
    let daemon = Daemon::start_in(folder, "")?;
    block_on(async {
        let fault = daemon.status().await?.fault.context("a fault")?;
        assert!(fault.contains("--state-dir"), "{fault}");
        let report = daemon.focus().await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        assert_eq!(Client::connect(&daemon.socket()).await?.report(None).await?, report, "from memory");
        Ok(())
    })
}

#[test]
fn without_file_descriptors_it_serves_those_it_has_and_recovers() -> Result<()> {
    let _alone = alone();
    let daemon = Daemon::start_in(tempfile::tempdir()?, "ulimit -n 24;")?;
    block_on(async {
        let mut early = Client::connect(&daemon.socket()).await?;
        early.status().await?;
        let crowd: Vec<UnixStream> =
            (0..40).map(|_| UnixStream::connect(daemon.socket())).collect::<Result<_, _>>()?;
        for _ in 0..20 {
            early.status().await?;
        }
        drop(crowd);
        let report = daemon.focus().await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        Ok(())
    })
}

//! The daemon as a process: how it starts, what keeps it from starting, and how it ends.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, ExitStatus, Output, Stdio};

use anyhow::{Context, Result, bail};
use evfocus_ipc::client::Client;
use evfocus_ipc::{FocusRequest, FocusWindow, LensRange, Phase, Report, State, WindowUnit};
use tempfile::TempDir;

const EVFOCUSD: &str = env!("CARGO_BIN_EXE_evfocusd");

/// A daemon with the simulated rig in a folder of its own.
struct Daemon {
    child: Child,
    log: BufReader<ChildStderr>,
    folder: Option<TempDir>,
    /// What it had logged when it was ready.
    started: String,
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It has ended already in the tests that pass; one that fails must not leave it behind.
        self.child.kill().unwrap_or_default();
        self.child.wait().map(drop).unwrap_or_default();
    }
}

impl Daemon {
    fn start() -> Result<Self> {
        Self::start_in(tempfile::tempdir()?)
    }

    /// Returns once the daemon says that it is ready.
    fn start_in(folder: TempDir) -> Result<Self> {
        let mut child = Command::new(EVFOCUSD)
            .args(["--socket".as_ref(), folder.path().join("socket").as_os_str()])
            .args(["--state-dir".as_ref(), folder.path().join("state").as_os_str()])
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
        Ok(Self { child, log, folder: Some(folder), started: seen })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.as_ref().map(|folder| folder.path().join(name)).unwrap_or_default()
    }

    fn socket(&self) -> PathBuf {
        self.path("socket")
    }

    fn reports(&self) -> PathBuf {
        self.path("state/reports")
    }

    /// Sends a signal and returns how the daemon ended, and the rest of its log.
    fn end(mut self, signal: &str) -> Result<(ExitStatus, String, TempDir)> {
        let sent = Command::new("kill").arg(signal).arg(self.child.id().to_string()).status()?;
        assert!(sent.success());
        let mut rest = String::new();
        self.log.read_to_string(&mut rest)?;
        Ok((self.child.wait()?, rest, self.folder.take().context("a folder")?))
    }
}

/// A short sweep: the simulated rig runs in real time here.
fn short() -> FocusRequest {
    FocusRequest {
        range: Some(LensRange { min: 1600.0, max: 2400.0 }),
        directions: Some("forward".to_owned()),
        ..FocusRequest::default()
    }
}

/// The same there and back, which teaches the delay of the pixels.
fn short_both_ways() -> FocusRequest {
    FocusRequest { directions: None, ..short() }
}

async fn focus(socket: &Path, request: &FocusRequest) -> Result<Report> {
    let report = Client::connect(socket).await?.focus_and_wait(request).await?;
    assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
    Ok(report)
}

fn block_on<T>(future: impl Future<Output = Result<T>>) -> Result<T> {
    tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(future)
}

async fn follow_to(socket: &Path, request: &FocusRequest, phase: Phase) -> Result<()> {
    let mut progress = Client::connect(socket).await?.focus(request).await?;
    while let Some(news) = progress.next().await? {
        if news.phase == phase {
            return Ok(());
        }
    }
    bail!("the run ended without {phase}")
}

fn run(arguments: &[&str]) -> Result<Output> {
    Ok(Command::new(EVFOCUSD).args(arguments).env_remove("JOURNAL_STREAM").output()?)
}

/// The daemon does not start, and its last line holds all of `words`.
fn refuses(arguments: &[&str], words: &[&str]) -> Result<()> {
    let output = run(arguments)?;
    let error = String::from_utf8(output.stderr)?;
    assert!(matches!(output.status.code(), Some(1 | 78)), "{:?}: {error}", output.status);
    let last = error.lines().last().unwrap_or_default();
    for word in words {
        assert!(last.contains(word), "{word:?} is not in {last:?}");
    }
    Ok(())
}

#[test]
fn a_run_over_the_socket_ends_in_focus_and_in_a_file() -> Result<()> {
    let daemon = Daemon::start()?;
    let (report, status) = block_on(async {
        let report = Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?;
        Ok((report, Client::connect(&daemon.socket()).await?.status().await?))
    })?;
    assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
    assert_eq!(status.state, State::Focused);
    assert_eq!(status.last_run.context("a last run")?.id, report.run_id);
    let file: Report = serde_json::from_slice(&fs::read(daemon.reports().join("run-00000001.json"))?)?;
    assert_eq!(file, report);
    let (exit, log, _) = daemon.end("-TERM")?;
    assert!(exit.success(), "{log}");
    Ok(())
}

#[test]
fn numbers_of_runs_go_on_after_a_restart() -> Result<()> {
    let daemon = Daemon::start()?;
    let first =
        block_on(async { Ok(Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?) })?;
    let (_, _, folder) = daemon.end("-TERM")?;
    let daemon = Daemon::start_in(folder)?;
    let (kept, second) = block_on(async {
        let kept = Client::connect(&daemon.socket()).await?.report(None).await?;
        Ok((kept, Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?))
    })?;
    assert_eq!(kept, first);
    assert_eq!(second.run_id, first.run_id + 1);
    Ok(())
}

#[test]
fn the_delay_that_runs_have_taught_is_kept_over_a_restart() -> Result<()> {
    let daemon = Daemon::start()?;
    let learnt = |report: &Report| report.rig_delay.map(|delay| delay.measurements);
    let one_way = block_on(focus(&daemon.socket(), &short()))?;
    assert_eq!(learnt(&one_way), Some(0));
    assert!(!daemon.path("state/rig-delay.json").exists(), "one way teaches nothing");
    let both_ways = block_on(focus(&daemon.socket(), &short_both_ways()))?;
    assert_eq!(learnt(&both_ways), Some(1));
    let (_, _, folder) = daemon.end("-TERM")?;
    let daemon = Daemon::start_in(folder)?;
    let one_way = block_on(focus(&daemon.socket(), &short()))?;
    assert_eq!(learnt(&one_way), Some(1));
    Ok(())
}

#[test]
fn a_damaged_delay_is_warned_of_and_learnt_anew() -> Result<()> {
    let folder = tempfile::tempdir()?;
    fs::create_dir_all(folder.path().join("state"))?;
    fs::write(folder.path().join("state/rig-delay.json"), "{\"format\": 1, \"base_")?;
    let daemon = Daemon::start_in(folder)?;
    assert!(daemon.started.contains("rig-delay.json"), "{}", daemon.started);
    assert!(daemon.started.contains("learnt anew"), "{}", daemon.started);
    let report = block_on(focus(&daemon.socket(), &short_both_ways()))?;
    assert_eq!(report.rig_delay.map(|delay| delay.measurements), Some(1));
    let (_, _, folder) = daemon.end("-TERM")?;
    let file = fs::read_to_string(folder.path().join("state/rig-delay.json"))?;
    assert!(file.contains("\"measurements\": 1") && file.contains("simulated"), "{file}");
    Ok(())
}

#[test]
fn a_full_disk_costs_the_learnt_delay_no_more_than_a_warning() -> Result<()> {
    let folder = tempfile::tempdir()?;
    fs::create_dir_all(folder.path().join("state"))?;
    symlink("/dev/full", folder.path().join("state/rig-delay.json.new"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        focus(&daemon.socket(), &short_both_ways()).await?;
        let mut client = Client::connect(&daemon.socket()).await?;
        let fault = client.status().await?.fault.context("a fault")?;
        assert!(fault.contains("rig-delay.json") && fault.contains("make room"), "{fault}");
        // It teaches nothing; what the one before has taught finds room now.
        let second = focus(&daemon.socket(), &short()).await?;
        assert_eq!(second.rig_delay.map(|delay| delay.measurements), Some(1), "from memory");
        assert_eq!(client.status().await?.fault, None);
        Ok(())
    })?;
    assert!(daemon.path("state/rig-delay.json").exists());
    Ok(())
}

#[test]
fn a_window_is_named_in_parts_of_the_picture_and_reported_in_pixels() -> Result<()> {
    let daemon = Daemon::start()?;
    let part = |x: f64| FocusWindow { x, y: 0.0, width: 0.5, height: 1.0, unit: Some(WindowUnit::Fraction) };
    block_on(async {
        let request = |windows, prefer: &str| FocusRequest {
            windows,
            prefer: Some(prefer.to_owned()),
            speed: Some("fast".to_owned()),
            ..short()
        };
        let client = Client::connect(&daemon.socket()).await?;
        let refused = client.focus_and_wait(&request(vec![part(0.0), part(0.6)], "strongest")).await;
        let error = refused.err().context("a refusal")?.to_string();
        assert!(error.contains("window 1") && error.contains("0.6"), "{error}");
        let client = Client::connect(&daemon.socket()).await?;
        let refused = client.focus_and_wait(&request(vec![part(0.0)], "1")).await;
        let error = refused.err().context("a refusal")?.to_string();
        assert!(error.contains("window 1") && error.contains("1 windows"), "{error}");
        let report = focus(&daemon.socket(), &request(vec![part(0.0), part(0.5)], "1")).await?;
        assert_eq!(report.request.speed.as_deref(), Some("fast"));
        let second = report.request.windows.get(1).context("a second window")?;
        assert_eq!((second.x, second.width, second.unit), (173.0, 173.0, Some(WindowUnit::Pixels)));
        assert_eq!((report.result.window, report.result.decided_by.as_deref()), (Some(1), Some("structure")));
        let position = report.result.position.context("a position")?;
        let error_bar = report.result.error_bar.context("an error bar")?;
        assert!((position - 1985.0).abs() < 4.0 * error_bar, "{position} of {error_bar}");
        let last = Client::connect(&daemon.socket()).await?.status().await?.last_run.context("a run")?;
        assert_eq!((last.error_bar, last.confidence), (Some(error_bar), report.result.confidence));
        let sweep = report.sweeps.first().context("a sweep")?;
        assert!(sweep.structure.is_some());
        assert_eq!(report.windows.get(1).context("a second window")?.position, Some(position));
        assert_eq!(report.windows.len(), 2);
        assert_eq!(report.map.as_ref().map(|map| map.confidence.len()), Some(24));
        Ok(())
    })
}

#[test]
fn a_signal_in_mid_sweep_stops_the_lens_and_leaves_a_report() -> Result<()> {
    for signal in ["-TERM", "-INT"] {
        let daemon = Daemon::start()?;
        block_on(follow_to(&daemon.socket(), &FocusRequest::default(), Phase::Sweeping))?;
        let (socket, report) = (daemon.socket(), daemon.reports().join("run-00000001.json"));
        let (exit, log, folder) = daemon.end(signal)?;
        assert!(exit.success(), "{signal}: {log}");
        assert!(log.contains("the lens is stopped"), "{log}");
        assert!(!socket.exists());
        let report: Report = serde_json::from_slice(&fs::read(report)?)?;
        assert_eq!(report.result.reason.as_deref(), Some("aborted"));
        drop(folder);
    }
    Ok(())
}

#[test]
fn a_full_disk_costs_neither_the_run_nor_the_daemon() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let reports = folder.path().join("state/reports");
    fs::create_dir_all(&reports)?;
    // Every write to this device fails for want of room.
    symlink("/dev/full", reports.join("run-00000001.json.new"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let report = Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?;
        assert_eq!(report.result.state, State::Focused);
        let mut client = Client::connect(&daemon.socket()).await?;
        let fault = client.status().await?.fault.context("a fault")?;
        assert!(fault.contains("run-00000001.json") && fault.contains("make room"), "{fault}");
        assert_eq!(client.report(Some(1)).await?, report, "from memory");
        let second = Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?;
        assert_eq!((second.run_id, client.status().await?.fault), (2, None), "the next one finds room");
        Ok(())
    })?;
    assert!(!daemon.reports().join("run-00000001.json").exists(), "half a report");
    Ok(())
}

#[test]
fn a_state_directory_that_cannot_be_made_costs_only_the_files() -> Result<()> {
    let folder = tempfile::tempdir()?;
    fs::write(folder.path().join("state"), "a file")?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let fault = Client::connect(&daemon.socket()).await?.status().await?.fault.context("a fault")?;
        assert!(fault.contains("state") && fault.contains("--state-dir"), "{fault}");
        let report = Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?;
        assert_eq!(report.result.state, State::Focused);
        Ok(())
    })
}

#[test]
fn a_state_directory_that_may_not_be_written_is_named_with_the_remedy() -> Result<()> {
    // Not even root makes directories here.
    let folder = tempfile::tempdir()?;
    symlink("/sys/kernel", folder.path().join("state"))?;
    let daemon = Daemon::start_in(folder)?;
    block_on(async {
        let fault = Client::connect(&daemon.socket()).await?.status().await?.fault.context("a fault")?;
        assert!(fault.contains("state") && fault.contains("let the daemon's user write there"), "{fault}");
        Ok(())
    })
}

#[test]
fn many_moves_at_once_cost_neither_the_lens_nor_the_stop() -> Result<()> {
    let daemon = Daemon::start()?;
    block_on(async {
        let mut clients = Vec::new();
        for _ in 0..50 {
            clients.push(Client::connect(&daemon.socket()).await?);
        }
        let mut moves = tokio::task::JoinSet::new();
        for (index, mut client) in clients.into_iter().enumerate() {
            moves.spawn(async move { client.move_to(1000.0 + index as f64 * 10.0).await });
        }
        while let Some(moved) = moves.join_next().await {
            moved??;
        }
        let mut client = Client::connect(&daemon.socket()).await?;
        client.abort().await?;
        let report = Client::connect(&daemon.socket()).await?.focus_and_wait(&short()).await?;
        assert_eq!(report.result.state, State::Focused, "{}", report.result.message);
        Ok(())
    })
}

#[test]
fn two_daemons_do_not_share_a_state_directory() -> Result<()> {
    let first = Daemon::start()?;
    let folder = tempfile::tempdir()?;
    symlink(first.path("state"), folder.path().join("state"))?;
    let second = Daemon::start_in(folder)?;
    block_on(async {
        let fault = Client::connect(&second.socket()).await?.status().await?.fault.context("a fault")?;
        assert!(fault.contains("another evfocusd") && fault.contains("--state-dir"), "{fault}");
        assert_eq!(Client::connect(&first.socket()).await?.status().await?.fault, None);
        Ok(())
    })
}

#[test]
fn a_run_aborted_at_once_has_its_date() -> Result<()> {
    let daemon = Daemon::start()?;
    block_on(async {
        let mut run = Client::connect(&daemon.socket()).await?.focus(&short()).await?;
        let mut aborted = false;
        while let Some(news) = run.next().await? {
            if let Some(report) = news.report {
                assert!(report.started_unix_s > 1.7e9, "{}", report.started_unix_s);
                return Ok(());
            }
            if !std::mem::replace(&mut aborted, true) {
                Client::connect(&daemon.socket()).await?.abort().await?;
            }
        }
        bail!("no report")
    })
}

#[test]
fn a_socket_in_use_is_refused_and_its_owner_lives() -> Result<()> {
    let daemon = Daemon::start()?;
    let socket = daemon.socket();
    refuses(&["--socket", &socket.to_string_lossy()], &[&socket.to_string_lossy(), "running"])?;
    block_on(async { Ok(Client::connect(&daemon.socket()).await?.status().await?) })?;
    Ok(())
}

#[test]
fn a_socket_that_a_killed_daemon_left_is_taken_over() -> Result<()> {
    let daemon = Daemon::start()?;
    let (exit, _, folder) = daemon.end("-KILL")?;
    assert!(!exit.success());
    assert!(folder.path().join("socket").exists());
    let daemon = Daemon::start_in(folder)?;
    block_on(async { Ok(Client::connect(&daemon.socket()).await?.status().await?) })?;
    Ok(())
}

#[test]
fn what_keeps_it_from_starting_is_said() -> Result<()> {
    let folder = tempfile::tempdir()?;
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    fs::write(path("bad.toml"), "[focus]\nmethod = \"esg\"\n")?;
    fs::write(path("unknown.toml"), "[fokus]\n")?;
    fs::write(path("good.toml"), "[focus]\nmethod = \"er-fixed\"\n")?;
    fs::write(path("file"), "")?;
    refuses(&["--config", &path("bad.toml")], &["bad.toml", "focus.method", "esg", "er-fixed"])?;
    refuses(&["check-config", &path("bad.toml")], &["bad.toml", "focus.method", "esg", "er-fixed"])?;
    let unknown = run(&["check-config", &path("unknown.toml")])?;
    let unknown = String::from_utf8(unknown.stderr)?;
    assert!(
        unknown.contains("unknown.toml") && unknown.contains("fokus") && unknown.contains("line 1"),
        "{unknown}"
    );
    refuses(&["--config", &path("none.toml")], &["none.toml", "No such file"])?;
    refuses(&["--socket", &path("file")], &["file"])?;
    refuses(&["--socket", "/proc/evfocus/socket"], &["/proc/evfocus"])?;
    let good = run(&["check-config", &path("good.toml")])?;
    assert!(good.status.success());
    assert!(String::from_utf8(good.stdout)?.contains("good"));
    assert_eq!(run(&["--sokcet", "x"])?.status.code(), Some(2), "wrong usage");
    Ok(())
}

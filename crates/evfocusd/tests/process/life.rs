//! How it starts, what keeps it from starting, how it ends, and what outlives it.

use std::fs;
use std::process::{Command, Output};

use anyhow::{Context, Result, bail};
use evfocus_ipc::{FocusRequest, FocusWindow, Phase, Report, State, WindowUnit};

use super::daemon::{Daemon, EVFOCUSD, block_on, short, short_both_ways};

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
        let report = daemon.focus(&short()).await?;
        Ok((report, daemon.status().await?))
    })?;
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
    let first = block_on(daemon.focus(&short()))?;
    let (_, _, folder) = daemon.end("-TERM")?;
    let daemon = Daemon::start_in(folder)?;
    let (kept, second) = block_on(async {
        let kept = daemon.client().await?.report(None).await?;
        Ok((kept, daemon.focus(&short()).await?))
    })?;
    assert_eq!(kept, first);
    assert_eq!(second.run_id, first.run_id + 1);
    Ok(())
}

#[test]
fn the_delay_that_runs_have_taught_is_kept_over_a_restart() -> Result<()> {
    let daemon = Daemon::start()?;
    let learnt = |report: &Report| report.rig_delay.map(|delay| delay.measurements);
    let one_way = block_on(daemon.focus(&short()))?;
    assert_eq!(learnt(&one_way), Some(0));
    assert!(!daemon.path("state/rig-delay.json").exists(), "one way teaches nothing");
    let both_ways = block_on(daemon.focus(&short_both_ways()))?;
    assert_eq!(learnt(&both_ways), Some(1));
    let (_, _, folder) = daemon.end("-TERM")?;
    let daemon = Daemon::start_in(folder)?;
    let one_way = block_on(daemon.focus(&short()))?;
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
    let report = block_on(daemon.focus(&short_both_ways()))?;
    assert_eq!(report.rig_delay.map(|delay| delay.measurements), Some(1));
    let (_, _, folder) = daemon.end("-TERM")?;
    let file = fs::read_to_string(folder.path().join("state/rig-delay.json"))?;
    assert!(file.contains("\"measurements\": 1") && file.contains("simulated"), "{file}");
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
        let client = daemon.client().await?;
        let refused = client.focus_and_wait(&request(vec![part(0.0), part(0.6)], "strongest")).await;
        let error = refused.err().context("a refusal")?.to_string();
        assert!(error.contains("window 1") && error.contains("0.6"), "{error}");
        let client = daemon.client().await?;
        let refused = client.focus_and_wait(&request(vec![part(0.0)], "1")).await;
        let error = refused.err().context("a refusal")?.to_string();
        assert!(error.contains("window 1") && error.contains("1 windows"), "{error}");
        let report = daemon.focus(&request(vec![part(0.0), part(0.5)], "1")).await?;
        assert_eq!(report.request.speed.as_deref(), Some("fast"));
        let second = report.request.windows.get(1).context("a second window")?;
        assert_eq!((second.x, second.width, second.unit), (173.0, 173.0, Some(WindowUnit::Pixels)));
        assert_eq!((report.result.window, report.result.decided_by.as_deref()), (Some(1), Some("structure")));
        let position = report.result.position.context("a position")?;
        let error_bar = report.result.error_bar.context("an error bar")?;
        assert!((position - 1985.0).abs() < 4.0 * error_bar, "{position} of {error_bar}");
        let last = daemon.status().await?.last_run.context("a run")?;
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
        block_on(daemon.focus_until(&FocusRequest::default(), Phase::Sweeping))?;
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
fn a_run_aborted_at_once_has_its_date() -> Result<()> {
    let daemon = Daemon::start()?;
    block_on(async {
        let mut run = daemon.client().await?.focus(&short()).await?;
        let mut aborted = false;
        while let Some(news) = run.next().await? {
            if let Some(report) = news.report {
                assert!(report.started_unix_s > 1.7e9, "{}", report.started_unix_s);
                return Ok(());
            }
            if !std::mem::replace(&mut aborted, true) {
                daemon.client().await?.abort().await?;
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
    block_on(daemon.status())?;
    Ok(())
}

#[test]
fn a_socket_that_a_killed_daemon_left_is_taken_over() -> Result<()> {
    let daemon = Daemon::start()?;
    let (exit, _, folder) = daemon.end("-KILL")?;
    assert!(!exit.success());
    assert!(folder.path().join("socket").exists());
    let daemon = Daemon::start_in(folder)?;
    block_on(daemon.status())?;
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

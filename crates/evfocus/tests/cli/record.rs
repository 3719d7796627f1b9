//! `record` and `replay`: what the camera sends comes back from the file, whatever ended the recording.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::program::{evfocus, json, json_with_status, number, refuses, stderr, text};

/// A recording of a real camera, 82,469 events.
fn real() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../evfocus-record/tests/data/evt3_hd_1280x720_trigger.raw")
        .canonicalize()
        .unwrap()
}

/// A folder with a configuration whose camera plays the real recording once, as fast as it can.
fn folder_with_replay() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("rig.toml");
    let camera = format!(
        "[camera]\nbackend = \"replay\"\nfile = {:?}\nreplay_pace = \"fastest\"\nreplay_end = \"disconnect\"\n",
        real()
    );
    fs::write(&config, camera).unwrap();
    (folder, config)
}

/// What `info` counts in a file.
fn sums(path: &Path) -> Value {
    let info = json(&["info", text(path), "--json"]);
    ["events", "on", "off", "first_t_us", "last_t_us", "geometry"]
        .iter()
        .map(|key| info[key].clone())
        .collect()
}

#[test]
fn what_the_camera_sent_until_it_was_gone_is_in_the_file() {
    let (folder, config) = folder_with_replay();
    for name in ["copy.raw", "copy.aedat4"] {
        let copy = folder.path().join(name);
        let output = evfocus(&["record", text(&copy), "--config", text(&config)]);
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        for part in ["the camera failed", "it is gone", "82469 events were recorded"] {
            assert!(stderr(&output).contains(part), "no {part:?} in {}", stderr(&output));
        }
        assert_eq!(sums(&copy), sums(&real()), "{name}");
        let positions = fs::read_to_string(copy.with_extension("positions.csv")).unwrap();
        assert!(positions.starts_with("t_us,position\n"), "{positions}");
        fs::remove_file(copy.with_extension("positions.csv")).unwrap();
    }
}

#[test]
fn a_recorded_sweep_can_be_analyzed() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["sweep.raw", "sweep.aedat4"] {
        let file = folder.path().join(name);
        let positions = folder.path().join("sweep.positions.csv");
        let recorded = json(&["record", text(&file), "--sweep", "--overwrite", "--json"]);
        assert_eq!(recorded["positions_file"], text(&positions));
        let analysis = json_with_status(
            &["analyze", text(&file), "--positions", text(&positions), "--method", "structure", "--json"],
            0,
        );
        // A machine that is too busy loses events, and says so.
        if recorded["lost"] == 0 {
            assert!((number(&analysis, "position") - 1985.0).abs() < 40.0, "{analysis}");
        }
        assert_eq!(json(&["info", text(&file), "--json"])["events"], recorded["events"]);
    }
}

#[test]
fn an_interrupt_ends_a_recording_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for (name, signal) in [("a.raw", "-INT"), ("b.aedat4", "-TERM")] {
        let file = folder.path().join(name);
        let mut recording = Command::new(env!("CARGO_BIN_EXE_evfocus"))
            .args(["record", text(&file), "--json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut said = String::new();
        BufReader::new(recording.stderr.take().unwrap()).read_line(&mut said).unwrap();
        assert!(said.contains("Ctrl-C"), "{said}");
        assert!(Command::new("kill").arg(signal).arg(recording.id().to_string()).status().unwrap().success());
        let mut printed = String::new();
        recording.stdout.take().unwrap().read_to_string(&mut printed).unwrap();
        assert_eq!(recording.wait().unwrap().code(), Some(0), "{name}");
        let recorded: Value = serde_json::from_str(&printed).unwrap();
        assert_eq!(json(&["info", text(&file), "--json"])["events"], recorded["events"], "{name}");
    }
}

#[test]
fn files_that_are_there_are_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (file, positions) = (folder.path().join("s.raw"), folder.path().join("s.positions.csv"));
    for taken in [&file, &positions] {
        fs::write(taken, "precious").unwrap();
        refuses(&["record", text(&file), "--seconds", "0.1"], 1, &[text(taken), "is there already"]);
        assert_eq!(fs::read_to_string(taken).unwrap(), "precious");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else was made");
        fs::remove_file(taken).unwrap();
    }
    fs::write(&file, "worthless").unwrap();
    json(&["record", text(&file), "--seconds", "0.1", "--overwrite", "--json"]);
    assert!(fs::read(&file).unwrap().starts_with(b"% "));
}

#[test]
fn a_full_disk_ends_a_recording_by_name() {
    let (folder, config) = folder_with_replay();
    for name in ["full.raw", "full.aedat4", "whole.positions.csv"] {
        symlink("/dev/full", folder.path().join(name)).unwrap();
    }
    for name in ["full.raw", "full.aedat4", "whole.raw"] {
        let file = folder.path().join(name);
        let named = if name == "whole.raw" { "whole.positions.csv" } else { name };
        let output = evfocus(&["record", text(&file), "--config", text(&config), "--overwrite"]);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{message}");
        for part in [named, "No space left on device", "events are in it", "make room"] {
            assert!(message.contains(part), "no {part:?} in {message}");
        }
    }
}

#[test]
fn what_cannot_be_recorded_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("s.raw");
    refuses(&["record", text(&folder.path().join("s.mp4"))], 1, &["s.mp4", ".raw", ".aedat4"]);
    refuses(&["record", "/nowhere/s.raw"], 1, &["/nowhere", "make it first"]);
    let config = folder.path().join("rig.toml");
    fs::write(&config, "[camera]\nbackend = \"evk4\"\nserial = \"none such\"\n").unwrap();
    refuses(&["record", text(&file), "--config", text(&config)], 1, &["attached"]);
    fs::write(&config, "[camera]\nbackend = \"replay\"\nfile = \"/nowhere/r.raw\"\n").unwrap();
    refuses(&["record", text(&file), "--config", text(&config)], 1, &["/nowhere/r.raw", "check its name"]);
    assert!(!file.exists());
    assert_eq!(evfocus(&["record", text(&file), "--seconds", "0"]).status.code(), Some(2));
}

#[test]
fn a_replay_is_a_daemon_with_the_recording_for_a_camera() {
    let folder = tempfile::tempdir().unwrap();
    let (socket, state) = (folder.path().join("socket"), folder.path().join("state"));
    let mut replay = Command::new(env!("CARGO_BIN_EXE_evfocus"))
        .args(["replay", text(&real()), "--socket", text(&socket), "--state-dir", text(&state)])
        .env_remove("JOURNAL_STREAM")
        .env_remove("EVFOCUS_LOG")
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut log = BufReader::new(replay.stderr.take().unwrap());
    let mut seen = String::new();
    while !seen.contains(" ready ") {
        assert!(log.read_line(&mut seen).unwrap() > 0, "not ready: {seen}");
    }
    let devices = json(&["devices", "--json", "--socket", text(&socket)]);
    let camera = &devices[0];
    assert_eq!((&camera["driver"], &camera["model"]), (&"replay".into(), &"replay".into()), "{devices}");
    assert_eq!(camera["location"], text(&real()));
    assert!(Command::new("kill").arg("-INT").arg(replay.id().to_string()).status().unwrap().success());
    log.read_to_string(&mut seen).unwrap();
    assert_eq!(replay.wait().unwrap().code(), Some(0), "{seen}");
}

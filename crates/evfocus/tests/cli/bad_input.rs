//! What is wrong is said: which file, which line, which value, what to do; with exit status 1 for files, 2 for usage.

use std::fs;
use std::path::{Path, PathBuf};

use crate::program::{evfocus, refuses, stderr, sweep, text};

/// A file with `content` that lives as long as the folder.
struct Files(tempfile::TempDir);

impl Files {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn file(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.path().join(name);
        fs::write(&path, content).unwrap();
        path
    }
}

fn refuses_positions(content: &str, parts: &[&str]) {
    let files = Files::new();
    let positions = files.file("lens.csv", content);
    let mut arguments = sweep().analyze();
    arguments.pop();
    arguments.push(text(&positions));
    let mut parts = parts.to_vec();
    parts.push("lens.csv");
    refuses(&arguments, 1, &parts);
}

fn refuses_recording(path: &Path, parts: &[&str]) {
    refuses(&["analyze", text(path), "--positions", text(&sweep().positions)], 1, parts);
    refuses(&["info", text(path)], 1, parts);
}

/// The lines of the good positions file.
fn good_lines() -> Vec<String> {
    fs::read_to_string(&sweep().positions).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn a_missing_recording_is_named() {
    refuses_recording(Path::new("/nowhere/sweep.raw"), &["/nowhere/sweep.raw", "cannot open", "check"]);
}

#[test]
fn an_empty_recording_is_refused() {
    let files = Files::new();
    refuses_recording(&files.file("empty.raw", ""), &["empty.raw", "empty"]);
}

#[test]
fn a_foreign_recording_is_refused_whatever_its_name() {
    let files = Files::new();
    let picture = files.file("picture.raw", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR and so on and so on");
    refuses_recording(&picture, &["picture.raw", "evfocus reads"]);
    let prose = files.file("prose.raw", "Dear reader, this is a letter and not a recording.\n".repeat(50));
    refuses_recording(&prose, &["prose.raw"]);
}

#[test]
fn a_misnamed_recording_is_recognised() {
    let files = Files::new();
    let copy = files.file("sweep.csv", fs::read(&sweep().recording).unwrap());
    let analysis =
        crate::program::json(&["analyze", text(&copy), "--positions", text(&sweep().positions), "--json"]);
    assert_eq!(analysis["format"], "evt3");
}

#[test]
fn a_recording_cut_off_in_the_sweep_is_refused() {
    let files = Files::new();
    let mut bytes = fs::read(&sweep().recording).unwrap();
    bytes.truncate(bytes.len() / 2 + 1);
    let cut = files.file("cut.raw", &bytes);
    refuses(
        &["analyze", text(&cut), "--positions", text(&sweep().positions)],
        1,
        &["cut.raw", "ends at", "missing", "cut off"],
    );
}

#[test]
fn missing_positions_are_named() {
    let recording = text(&sweep().recording);
    refuses(&["analyze", recording, "--positions", "/nowhere/p.csv"], 1, &["/nowhere/p.csv", "cannot open"]);
    refuses(&["analyze", recording], 2, &["--positions"]);
}

#[test]
fn positions_that_are_no_numbers_are_refused_with_their_line() {
    refuses_positions("t_us,position\n0,220\n1000,far\n", &["line 3", "far", "not a finite number"]);
    refuses_positions("t_us,position\n0,220\n1.5,221\n", &["line 3", "1.5", "whole"]);
    refuses_positions("t_us,position\n0,220\n1000,NaN\n", &["line 3", "NaN"]);
    refuses_positions("0,220\n1000,230\n", &["line 1", "t_us,position"]);
    refuses_positions("", &["empty"]);
}

#[test]
fn positions_out_of_order_are_refused_with_their_line() {
    let mut lines = good_lines();
    lines.swap(5, 6);
    refuses_positions(&lines.join("\n"), &["line 7", "does not come after", "sort"]);
}

#[test]
fn a_lens_that_never_moves_is_refused() {
    let lines: Vec<String> = good_lines()
        .iter()
        .map(|line| match line.split_once(',') {
            Some((time, _)) if time != "t_us" => format!("{time},500"),
            _ => line.clone(),
        })
        .collect();
    refuses_positions(&lines.join("\n"), &["never moves", "500.0"]);
}

#[test]
fn positions_that_do_not_cover_the_recording_are_refused_with_the_gap() {
    let lines = good_lines();
    let short = lines[..lines.len() - 200].join("\n");
    refuses_positions(&short, &["do not cover", "they end 0.2", "before the last event"]);
    let late: Vec<&str> =
        std::iter::once("t_us,position").chain(lines[101..].iter().map(String::as_str)).collect();
    refuses_positions(&late.join("\n"), &["they begin 0.10", "after the first event"]);
    let elsewhere: Vec<String> =
        (0..100).map(|index| format!("{},{}", 90_000_000 + index * 1000, 220 + index)).collect();
    refuses_positions(&format!("t_us,position\n{}", elsewhere.join("\n")), &["do not overlap"]);
}

#[test]
fn a_few_milliseconds_of_positions_may_be_missing() {
    let files = Files::new();
    let lines = good_lines();
    let mut kept = vec![lines[0].clone()];
    kept.extend_from_slice(&lines[5..lines.len() - 4]);
    let positions = files.file("p.csv", kept.join("\n"));
    crate::program::json(&["analyze", text(&sweep().recording), "--positions", text(&positions), "--json"]);
}

#[test]
fn unknown_methods_and_durations_without_a_unit_are_usage_errors() {
    let with = |option: &'static str, value: &'static str| {
        let mut arguments = sweep().analyze();
        arguments.extend([option, value]);
        arguments
    };
    refuses(&with("--method", "guess"), 2, &["guess", "egs-official", "er-fixed"]);
    refuses(&with("--interval", "55"), 2, &["55", "--interval", "55ms"]);
    refuses(&with("--interval", "55 minutes"), 2, &["--interval", "55ms"]);
    refuses(&with("--interval", "0ms"), 2, &["--interval", "1us"]);
    refuses(&with("--format", "mp4"), 2, &["mp4", "evt3"]);
}

#[test]
fn an_interval_longer_than_the_sweep_has_no_answer() {
    let mut arguments = sweep().analyze();
    arguments.extend(["--json", "--method", "er-fixed", "--interval", "9s"]);
    let analysis = crate::program::json_with_status(&arguments, 3);
    assert_eq!(analysis["reason"], "no-answer");
    assert!(analysis["message"].as_str().unwrap().contains("9000000"), "{analysis}");
}

#[test]
fn simulated_rigs_that_make_no_sense_are_refused() {
    let files = Files::new();
    let at = |name: &str| files.0.path().join(name);
    let (raw, csv, json) = (at("a.raw"), at("a.csv"), at("a.json"));
    let with = |options: &[&'static str]| {
        let mut arguments =
            vec!["simulate", "--out", text(&raw), "--positions", text(&csv), "--truth", text(&json)];
        arguments.extend(options);
        arguments.into_iter().map(str::to_owned).collect::<Vec<_>>()
    };
    refuses(&with(&["--focus", "9000"]), 2, &["focus", "9000", "3750"]);
    refuses(&with(&["--scene", "moon"]), 2, &["moon", "dead-leaves"]);
    refuses(&with(&["--sweep-s", "-2"]), 2, &["-2", "seconds"]);
    refuses(&with(&["--shake", "-2"]), 2, &["shake_px_rms", "-2"]);
    refuses(&with(&["--frames", "somewhere"]), 2, &["--fps"]);
}

#[test]
fn without_a_daemon_the_commands_say_so() {
    for command in [
        &["status"][..],
        &["focus"],
        &["abort"],
        &["watch"],
        &["devices"],
        &["report"],
        &["move", "1985"],
        &["mode", "auto"],
    ] {
        let mut arguments = command.to_vec();
        arguments.extend(["--socket", "/nowhere/socket"]);
        refuses(&arguments, 1, &["/nowhere/socket", "evfocusd"]);
    }
}

#[test]
fn wrong_usage_is_status_2() {
    refuses(&["fokus"], 2, &["fokus"]);
    refuses(&["move", "far"], 2, &["far", "counts"]);
    refuses(&["focus", "--speed", "-3"], 2, &["speed"]);
    refuses(&["focus", "--from", "300"], 2, &["--to"]);
    refuses(&["focus", "--from", "300", "--to", "200"], 2, &["300", "below", "200"]);
    let bare = evfocus::<&str>(&[]);
    assert_eq!(bare.status.code(), Some(2));
    assert!(stderr(&bare).contains("Usage"));
}

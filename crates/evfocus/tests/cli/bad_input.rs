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
    for shake in ["-2", "100", "NaN"] {
        refuses(&with(&["--shake", shake]), 2, &["--shake", shake, "from 0 to 60"]);
        refuses(&["demo", "--shake", shake], 2, &["--shake", shake, "from 0 to 60"]);
    }
    for speed in ["1e-12", "1", "1e300"] {
        refuses(&with(&["--speed", speed]), 2, &["--speed", "from 0.01 to 1000 s", "3.53 to 353000"]);
    }
    for seconds in ["1e-12", "1e12", "inf"] {
        refuses(&with(&["--sweep-s", seconds]), 2, &["--sweep-s", "from 0.01 to 1000"]);
    }
    refuses(&with(&["--rest", "80000s"]), 2, &["--rest", "100 s"]);
    refuses(&with(&["--frames", "somewhere"]), 2, &["--fps"]);
}

#[test]
fn two_outputs_into_one_file_are_refused_before_anything_is_written() {
    let files = Files::new();
    let folder = files.0.path();
    let (raw, csv, json) = (folder.join("a.raw"), folder.join("a.csv"), folder.join("a.json"));
    let again = folder.join(".").join("a.raw");
    let simulate = |out: &Path, positions: &Path, truth: &Path, parts: &[&str]| {
        let arguments = ["simulate", "--sweep-s", "0.05", "--out", text(out), "--positions", text(positions)];
        refuses(&[&arguments[..], &["--truth", text(truth)]].concat(), 2, parts);
    };
    simulate(&raw, &again, &json, &["--out", "--positions", "a.raw"]);
    simulate(&raw, &csv, &again, &["--out", "--truth", "a.raw"]);
    simulate(&raw, &csv, &csv, &["--positions", "--truth", "a.csv"]);
    assert_eq!(fs::read_dir(folder).unwrap().count(), 0, "nothing was written");

    let kept = files.file("kept.raw", "a recording");
    let linked = folder.join("linked.csv");
    std::os::unix::fs::symlink(&kept, &linked).unwrap();
    simulate(&kept, &linked, &json, &["--out", "--positions", "linked.csv"]);
    assert_eq!(fs::read_to_string(&kept).unwrap(), "a recording");
}

#[test]
fn a_plot_does_not_overwrite_what_it_is_drawn_from() {
    for (path, name) in [(&sweep().recording, "the recording"), (&sweep().positions, "--positions")] {
        let before = fs::read(path).unwrap();
        let mut arguments = sweep().analyze();
        arguments.extend(["--plot", text(path)]);
        refuses(&arguments, 2, &[name, "--plot"]);
        assert!(fs::read(path).unwrap() == before, "{name} was overwritten");
    }
}

#[test]
fn devices_take_any_number_of_outputs() {
    let null = "/dev/null";
    let files = Files::new();
    let raw = files.0.path().join("a.raw");
    let arguments =
        ["simulate", "--sweep-s", "0.05", "--out", text(&raw), "--positions", null, "--truth", null];
    assert!(evfocus(&arguments).status.success());
}

#[test]
fn a_missing_folder_is_named_before_anything_is_written() {
    let files = Files::new();
    let there = ["--out", "--positions", "--truth"].map(|option| (option, files.0.path().join(option)));
    for (missing, _) in &there {
        let mut arguments = vec!["simulate", "--sweep-s", "0.05"];
        for (option, path) in &there {
            arguments.extend([*option, if option == missing { "/nowhere/file" } else { text(path) }]);
        }
        refuses(&arguments, 1, &[missing, "/nowhere/file", "no directory /nowhere", "make it"]);
    }
    assert_eq!(fs::read_dir(files.0.path()).unwrap().count(), 0, "nothing was written");
}

#[test]
fn a_directory_is_no_recording_and_no_positions() {
    let files = Files::new();
    let folder = text(files.0.path());
    refuses_recording(files.0.path(), &[folder, "directory", "recording file"]);
    let recording = text(&sweep().recording);
    refuses(&["analyze", recording, "--positions", folder], 1, &[folder, "directory", "positions file"]);
}

/// Six thousand events, one every `step_us`, one a line.
fn csv_events(step_us: i64) -> String {
    let lines: Vec<String> =
        (0..6000).map(|index| format!("{},{},1,{}", index % 300, index % 200, index * step_us)).collect();
    lines.join("\n")
}

#[test]
fn times_that_are_far_apart_are_refused_and_take_no_memory() {
    let files = Files::new();
    for (begin, last) in [(0, 4_000_000_000_000_000_i64), (0, i64::MAX), (i64::MIN, i64::MAX)] {
        let events = format!("7,7,0,{begin}\n{}\n7,7,0,{last}", csv_events(1000));
        let recording = files.file("far.csv", format!("x,y,p,t\n{events}\n"));
        let positions = files.file("far-lens.csv", format!("t_us,position\n{begin},220\n{last},3750\n"));
        let output = evfocus(&["analyze", text(&recording), "--positions", text(&positions)]);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{message}");
        assert!(message.starts_with("error: "), "{message}");
        let output = evfocus(&["info", text(&recording)]);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{}", stderr(&output));
    }
    let recording = files.file("slow.csv", format!("x,y,p,t\n{}\n", csv_events(200_000)));
    let positions = files.file("slow-lens.csv", "t_us,position\n0,220\n1199800000,3750\n");
    refuses(
        &["analyze", text(&recording), "--positions", text(&positions)],
        1,
        &["slow-lens.csv", "1199800001 us", "1200 s", "at most 600 s", "microseconds", "cut"],
    );
}

#[test]
fn a_socket_that_nobody_listens_on_is_told_from_none() {
    let files = Files::new();
    let socket = files.0.path().join("socket");
    drop(std::os::unix::net::UnixListener::bind(&socket).unwrap());
    for command in [&["status"][..], &["focus"], &["move", "1985"], &["watch"]] {
        let arguments = [command, &["--socket", text(&socket)]].concat();
        refuses(&arguments, 1, &[text(&socket), "nobody listens", "evfocusd --socket"]);
    }
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
        &["pause", "--deferred"],
        &["resume"],
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
    refuses(&["focus", "--sweep-speed", "-3"], 2, &["sweep-speed"]);
    refuses(&["focus", "--speed", "800"], 2, &["--speed", "fast, normal, accurate"]);
    refuses(&["focus", "--window", "1,2,3"], 2, &["--window", "100,80,60,40"]);
    refuses(&["focus", "--window", "-1,2,3,4"], 2, &["--window", "pixels"]);
    refuses(&["focus", "--window", "0.5,0,0.5,1.5"], 2, &["--window", "0 to 1"]);
    refuses(&["focus", "--prefer", "farthest"], 2, &["--prefer", "strongest", "nearest"]);
    refuses(&["focus", "--from", "300"], 2, &["--to"]);
    refuses(&["focus", "--from", "300", "--to", "200"], 2, &["300", "below", "200"]);
    let bare = evfocus::<&str>(&[]);
    assert_eq!(bare.status.code(), Some(2));
    assert!(stderr(&bare).contains("Usage"));
}

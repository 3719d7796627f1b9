//! `analyze`, `info` and `simulate` on healthy recordings and on those that cannot be focused.

use std::fs;
use std::path::Path;

use crate::program::{Sweep, evfocus, json, json_with_status, number, sweep, text};
use serde_json::Value;

#[test]
fn a_shaken_sweep_is_focused_near_the_truth() {
    let mut arguments = sweep().analyze();
    arguments.push("--json");
    let analysis = json(&arguments);
    assert_eq!(analysis["state"], "focused");
    assert_eq!(analysis["reason"], Value::Null);
    assert_eq!((&analysis["method"], &analysis["decided_by"]), (&"auto".into(), &"structure".into()));
    let error = number(&analysis, "position") - number(&sweep().truth, "position");
    let error_bar = number(&analysis, "error_bar");
    assert!(error.abs() < 3.0 * error_bar && error_bar < 40.0, "error {error:+.1} of {error_bar:.1}");
    assert!((0.5..=1.0).contains(&number(&analysis, "confidence")));
    assert!(analysis["flags"].is_array() && analysis["second_depth"].is_null());
    let (t_us, events) = (number(&analysis, "t_us"), number(&analysis, "events"));
    assert!(t_us > 0.0 && t_us < number(&sweep().truth, "duration_us"));
    assert!((events - number(&sweep().truth, "events")).abs() < 0.5);
    assert!(number(&analysis, "iterations") > 0.5);
    let curve = &analysis["curve"];
    let lengths = ["position", "rate", "t_us"].map(|name| curve[name].as_array().map_or(0, Vec::len));
    assert!(lengths[0] > 100 && lengths == [lengths[0]; 3], "{lengths:?}");
}

#[test]
fn every_method_answers_when_asked() {
    for method in ["egs", "egs-official", "er-fixed", "er-squared", "structure", "mirror-pairs", "auto"] {
        let mut arguments = sweep().analyze();
        arguments.extend(["--json", "--method", method, "--interval", "0.03s"]);
        let analysis = json(&arguments);
        assert_eq!(analysis["method"], method);
        let said = analysis["sweeps"][0]["estimators"].as_array().unwrap();
        let own = said.iter().find(|said| said["method"] == method).unwrap();
        // The answers that rest on structure have the delay of the pixels taken off.
        let rests_on_structure = ["structure", "auto"].contains(&method);
        assert_eq!(own["position"] == analysis["position"], !rests_on_structure, "{method}");
        let error = number(&analysis, "position") - number(&sweep().truth, "position");
        let error_bar = number(&analysis, "error_bar");
        assert!(error.abs() < 3.0 * error_bar, "{method}: error {error:+.1} of {error_bar:.1}");
        // Every other one is asked beside the one that decides; `auto` only asks others.
        assert_eq!(said.len(), if method == "auto" { 7 } else { 6 }, "{method}");
    }
}

#[test]
fn the_mean_of_both_directions_cancels_the_delay() {
    let folder = tempfile::tempdir().unwrap();
    let options = ["--sweep-s", "0.5", "--shake", "2", "--both-directions", "--light", "dark"];
    let both = Sweep::simulate(folder.path(), &options);
    let mut arguments = both.analyze();
    arguments.push("--json");
    let analysis = json(&arguments);
    let sweeps = analysis["sweeps"].as_array().unwrap();
    assert_eq!(sweeps.len(), 2);
    assert_eq!((&sweeps[0]["direction"], &sweeps[1]["direction"]), (&"forward".into(), &"backward".into()));
    let answers: Vec<f64> = sweeps.iter().map(|sweep| number(sweep, "position")).collect();
    let mean = f64::midpoint(answers[0], answers[1]);
    // Each is weighted by how sure it is of itself, so that it lies between the two, near their mean.
    let position = number(&analysis, "position");
    assert!((answers[1]..answers[0]).contains(&position), "{position} is not between {answers:?}");
    assert!((position - mean).abs() < number(&analysis, "error_bar"), "{position}, mean {mean}");
    let delay_us = (answers[0] - answers[1]) / 2.0 / number(&sweeps[0], "speed_counts_per_s") * 1e6;
    assert!((number(&analysis, "delay_us") - delay_us).abs() < 1e-6);
    let words = crate::program::stdout(&evfocus(&both.analyze()));
    let half = (answers[0] - answers[1]) / 2.0;
    let told = format!("half the difference of the directions  {half:.1} counts ({:.2} ms)", delay_us * 1e-3);
    assert!(words.contains(&told) && !words.contains("delay"), "no {told:?} in {words}");
    assert_eq!(both.truth["times_us"].as_array().unwrap().len(), 2);
}

#[test]
fn a_blank_wall_fails_with_a_named_reason_and_shows_what_was_estimated() {
    let folder = tempfile::tempdir().unwrap();
    let wall = Sweep::simulate(folder.path(), &["--sweep-s", "0.5", "--scene", "blank-wall"]);
    let mut arguments = wall.analyze();
    arguments.push("--json");
    let analysis = json_with_status(&arguments, 3);
    assert_eq!(analysis["state"], "failed");
    assert!(["too-few-events", "flat"].contains(&analysis["reason"].as_str().unwrap()), "{analysis}");
    assert_eq!(analysis["position"], Value::Null);
    assert_eq!(analysis["sweeps"][0]["state"], "failed");
}

#[test]
fn the_answers_are_those_of_the_reference_implementations() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/sweeps");
    let table = fs::read_to_string(folder.join("reference.tsv")).unwrap();
    let mut lines = table.lines().map(|line| line.split('\t').collect::<Vec<_>>());
    let header = lines.next().unwrap();
    let mut compared = 0;
    for line in lines {
        let cell = |name: &str| line[header.iter().position(|column| *column == name).unwrap()];
        let file = |end: &str| folder.join(format!("{}.{end}", cell("recording")));
        let truth: Value = serde_json::from_slice(&fs::read(file("truth.json")).unwrap()).unwrap();
        let (recording, positions) = (file("raw"), file("positions.csv"));
        for (method, interval, column, tolerance) in [
            ("egs", "55ms", "egs", 4.0),
            ("egs-official", "55ms", "egs_official", 15.0),
            ("er-fixed", "55ms", "er_fixed_55ms", 5.0),
            ("er-fixed", "65ms", "er_fixed_65ms", 5.0),
        ] {
            let options = ["--method", method, "--interval", interval, "--json"];
            let files = ["analyze", text(&recording), "--positions", text(&positions)];
            let analysis = json(&[&files[..], &options].concat());
            let error = number(&analysis, "position") - number(&truth, "gt_position");
            let reference: f64 = cell(column).parse().unwrap();
            assert!(
                (error - reference).abs() <= tolerance,
                "{} {column}: {error:+.1} instead of {reference:+.1}",
                cell("recording")
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 16);
}

#[test]
fn the_plot_is_a_picture_of_the_curve() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("curve.svg");
    let mut arguments = sweep().analyze();
    arguments.extend(["--plot", text(&plot)]);
    assert!(evfocus(&arguments).status.success());
    let svg = fs::read_to_string(&plot).unwrap();
    for part in ["<svg", "polyline", "lens position (counts)", "event rate", "egs-official"] {
        assert!(svg.contains(part), "no {part:?}");
    }
    let mut arguments = sweep().analyze();
    arguments.extend(["--plot", "/nowhere/curve.svg"]);
    crate::program::refuses(&arguments, 1, &["/nowhere/curve.svg"]);
}

#[test]
fn info_counts_what_was_simulated() {
    let info = json(&["info", text(&sweep().recording), "--json"]);
    assert_eq!(info["format"], "evt3");
    assert_eq!((&info["width"], &info["height"]), (&346.into(), &260.into()));
    assert_eq!(info["events"], sweep().truth["events"]);
    assert!((number(&info, "on") + number(&info, "off") - number(&info, "events")).abs() < 0.5);
    assert!(number(&info, "first_t_us") < number(&info, "last_t_us"));
    assert!(number(&info, "mean_rate") <= number(&info, "peak_rate"));
    assert_eq!(info["damaged"], false);
}

#[test]
fn one_seed_makes_the_same_files() {
    let make = |seed: &str| {
        let folder = tempfile::tempdir().unwrap();
        let sweep = Sweep::simulate(folder.path(), &["--sweep-s", "0.2", "--seed", seed]);
        (fs::read(&sweep.recording).unwrap(), fs::read(&sweep.positions).unwrap(), sweep.truth)
    };
    let (first, again, other) = (make("7"), make("7"), make("8"));
    assert!(first == again, "seed 7 made two different recordings");
    assert!(first.0 != other.0 && first.2["position"] != other.2["position"]);
}

#[test]
fn frames_are_16_bit_grey_pictures_with_their_times() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames");
    let options = ["--sweep-s", "0.2", "--frames", text(&frames), "--fps", "100"];
    let sweep = Sweep::simulate(folder.path(), &options);
    let list = fs::read_to_string(frames.join("frames.csv")).unwrap();
    let listed = list.lines().count() - 1;
    assert_eq!(sweep.truth["frames"]["number"], listed);
    assert!(list.lines().nth(2).unwrap().starts_with("frame_000001.png,10000,"));
    let file = std::io::BufReader::new(fs::File::open(frames.join("frame_000001.png")).unwrap());
    let reader = png::Decoder::new(file).read_info().unwrap();
    assert_eq!(reader.info().size(), (346, 260));
    assert_eq!(reader.output_color_type(), (png::ColorType::Grayscale, png::BitDepth::Sixteen));
}

#[test]
fn a_reader_that_goes_away_is_no_panic() {
    let mut arguments = sweep().analyze();
    arguments.push("--json");
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_evfocus"))
        .args(&arguments)
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", crate::program::stderr(&output));
    assert!(output.stderr.is_empty(), "{}", crate::program::stderr(&output));
}

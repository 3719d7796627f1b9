//! `eval` and `measure`: judging methods and pictures.

use std::fs;

use crate::program::{Sweep, evfocus, json, refuses, stdout, sweep, text};

/// A folder with one sweep and its truth.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let place = |ending: &str| folder.path().join(format!("light_shake{ending}"));
    fs::copy(&sweep().recording, place(".raw")).unwrap();
    fs::copy(&sweep().positions, place(".positions.csv")).unwrap();
    fs::write(place(".truth.json"), sweep().truth.to_string()).unwrap();
    folder
}

#[test]
fn every_method_is_judged_on_sweeps_of_a_folder_and_what_is_done_is_not_done_again() {
    let (sweeps, cache) = (folder(), tempfile::tempdir().unwrap());
    let arguments = ["eval", "--sweeps", text(sweeps.path()), "--cache", text(cache.path()), "--json"];
    let judged = json(&arguments);
    let result = &judged[0]["results"][0];
    assert_eq!((&result["name"], &result["condition"]), (&"light_shake".into(), &"light_dynamic".into()));
    let answers = result["answers"].as_array().unwrap();
    let of = |method: &str| answers.iter().find(|answer| answer["method"] == method).unwrap();
    for method in
        ["GRAD (events)", "er-fixed 55 ms", "er-fixed 65 ms", "egs", "mirror-pairs", "structure", "auto"]
    {
        assert!(of(method)["error"].is_number(), "{method}: {}", of(method));
    }
    let auto = of("auto");
    assert!(auto["error"].as_f64().unwrap().abs() < 3.0 * auto["error_bar"].as_f64().unwrap(), "{auto}");
    assert!(answers.len() >= 11 + 2 + 6, "{}", answers.len());

    // What was found is kept: a second time it is read, even if somebody wrote something else there.
    let kept: Vec<_> =
        fs::read_dir(cache.path().join("results")).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert_eq!(kept.len(), 1);
    let changed = fs::read_to_string(&kept[0]).unwrap().replace("\"auto\"", "\"as kept\"");
    fs::write(&kept[0], changed).unwrap();
    let again = json(&arguments)[0]["results"][0]["answers"].to_string();
    assert!(
        again.contains("as kept")
            && !json(&[arguments.as_slice(), &["--fresh"]].concat()).to_string().contains("as kept")
    );
}

#[test]
fn tables_have_the_papers_figures_beside_ours() {
    let (sweeps, cache) = (folder(), tempfile::tempdir().unwrap());
    let output =
        evfocus(&["eval", "--sweeps", text(sweeps.path()), "--cache", text(cache.path()), "--markdown"]);
    let tables = stdout(&output);
    let egs = tables.lines().find(|line| line.starts_with("| egs | MAE |")).unwrap();
    assert!(egs.contains("(29.0)") && egs.contains("(56.3)"), "{egs}");
    assert!(tables.contains("| DCTM (events) | RMSE |") && tables.contains("error bars |"), "{tables}");
}

#[test]
fn what_cannot_be_judged_is_named() {
    let empty = tempfile::tempdir().unwrap();
    let cache = empty.path().join("cache");
    let cached = ["--cache", text(&cache)];
    refuses(&[["eval"].as_slice(), &cached].concat(), 2, &["nothing to judge", "--suite"]);
    let options = [("--sweeps", "no sweeps"), ("--ead", "gt_focus_points.txt"), ("--elp", "event.npy")];
    for (option, words) in options {
        refuses(&[&["eval", option, text(empty.path())], cached.as_slice()].concat(), 1, &[words]);
        refuses(&[&["eval", option, "/nowhere"], cached.as_slice()].concat(), 1, &["/nowhere"]);
    }
    fs::write(empty.path().join("gt_focus_points.txt"), "office 1200\n").unwrap();
    let header =
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 .";
    let mut file = header.to_vec();
    file.resize(124, b' ');
    file.extend([0, 2, b'I', b'M']);
    file.resize(1024, 0);
    fs::create_dir(empty.path().join("office")).unwrap();
    fs::write(empty.path().join("office/a.mat"), file).unwrap();
    refuses(
        &[&["eval", "--ead", text(empty.path())], cached.as_slice()].concat(),
        1,
        &["office/a.mat", "7.3", "'-v7'"],
    );
}

#[test]
fn a_sharp_picture_measures_more_than_a_blurred_one() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, level: fn(usize, usize) -> u8| {
        let mut bytes = b"P5 64 48 255\n".to_vec();
        bytes.extend((0..48).flat_map(|row| (0..64).map(move |column| level(row, column))));
        let path = folder.path().join(name);
        fs::write(&path, bytes).unwrap();
        path
    };
    let sharp = picture("sharp.pgm", |row, column| if (row / 4 + column / 4) % 2 == 0 { 40 } else { 200 });
    let soft = picture("soft.pgm", |row, column| (120 + (row + column) % 8) as u8);
    let measured = json(&["measure", text(&sharp), text(&soft), "--json"]);
    let of = |index: usize, operator: &str| measured[index]["operators"][operator].as_f64().unwrap();
    for operator in ["GRAD", "LAP3", "SML", "GLLV", "ACMO", "WAVS", "SFIL", "EIGV"] {
        assert!(of(0, operator) > of(1, operator), "{operator}: {measured}");
    }
    assert_eq!(measured[0]["operators"].as_object().unwrap().len(), 11);
    assert!(stdout(&evfocus(&["measure", text(&soft)])).contains("DCTM"));
    refuses(&["measure", text(&sharp), "/nowhere.png"], 1, &["/nowhere.png"]);
    let not_one = folder.path().join("a.png");
    fs::write(&not_one, "no picture").unwrap();
    refuses(&["measure", text(&not_one)], 1, &["a.png"]);
}

#[test]
fn windows_and_the_map_are_of_the_recording() {
    let folder = tempfile::tempdir().unwrap();
    let two = Sweep::simulate(folder.path(), &["--scene", "two-depths", "--focus", "1400", "--sweep-s", "1"]);
    let map = folder.path().join("map.svg");
    let analyze = |more: &[&str]| json(&[two.analyze().as_slice(), more, &["--json"]].concat());
    let position = |analysis: &serde_json::Value| analysis["position"].as_f64().unwrap();
    let whole = analyze(&["--map", text(&map)]);
    assert_eq!(whole["flags"], serde_json::json!(["two-depths"]));
    let depths = [position(&whole), whole["second_depth"].as_f64().unwrap()];
    let truths: Vec<f64> = serde_json::from_value(two.truth["positions"].clone()).unwrap();
    for &truth in &truths {
        assert!(depths.iter().any(|depth| (depth - truth).abs() < 40.0), "{depths:?}");
    }
    let svg = fs::read_to_string(&map).unwrap();
    assert!(svg.starts_with("<svg") && svg.matches('±').count() > 12, "{svg}");
    let left = analyze(&["--window", "0,0,0.45,1.0"]);
    let right = analyze(&["--window", "0,0,150,260", "--window", "55%,0%,45%,100%", "--prefer", "1"]);
    assert!((position(&left) - truths[0]).abs() < 30.0 && (position(&right) - truths[1]).abs() < 30.0);
    assert_eq!((&left["window"], &right["window"]), (&0.into(), &1.into()));
    let each: Vec<f64> = right["windows"].as_array().unwrap().iter().map(position).collect();
    assert!((each[0] - truths[0]).abs() < 30.0 && (each[1] - position(&right)).abs() < 1e-9, "{each:?}");
    let off = [two.analyze().as_slice(), &["--window", "300,0,100,100"]].concat();
    refuses(&off, 2, &["--window", "346 x 260"]);
    let refused =
        |more: &[&str], words: &[&str]| refuses(&[two.analyze().as_slice(), more].concat(), 2, words);
    refused(&["--window", "0,0,0.5,1.0", "--method", "egs"], &["egs", "whole picture"]);
    refused(&["--prefer", "3"], &["--prefer"]);
    refused(&["--window", "0,0,0.5,1.0", "--prefer", "1"], &["--prefer"]);
}

//! The demonstration, help and completions.

use crate::program::{evfocus, json, json_with_status, number, stdout};

#[test]
fn one_seed_always_finds_the_same_position() {
    let run = || json(&["demo", "--json", "--shake", "2", "--seed", "5"]);
    let (first, again) = (run(), run());
    assert_eq!(first, again);
    assert_eq!(
        (&first["seed"], &first["state"], &first["method"]),
        (&5.into(), &"focused".into(), &"auto".into())
    );
    let error = number(&first, "position") - number(&first, "truth");
    assert!((error - number(&first, "error")).abs() < 1e-9);
    assert!(error.abs() < 4.0 * number(&first, "error_bar"), "error {error:+.1}");
    assert!(number(&first, "confidence") > 0.5 && first["decided_by"] == "structure", "{first}");
    assert!(number(&first, "elapsed_s") > 1.0);
}

#[test]
fn a_blank_wall_is_status_3_with_a_reason() {
    let outcome = json_with_status(&["demo", "--json", "--scene", "blank-wall"], 3);
    assert_eq!(outcome["state"], "failed");
    assert!(outcome["reason"].is_string() && outcome["position"].is_null());
}

#[test]
fn without_a_terminal_nothing_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let plot = folder.path().join("demo.svg");
    let output = evfocus(&["demo", "--seed", "3", "--shake", "2", "--report", crate::program::text(&plot)]);
    let text = stdout(&output);
    assert!(output.status.success() && !text.contains('\x1b'), "{text}");
    for part in [
        "focused at",
        " ± ",
        " % sure (structure)",
        "truth",
        "error",
        "seed       3",
        "half the difference of the directions  ",
    ] {
        assert!(text.contains(part), "no {part:?} in {text}");
    }
    assert!(!text.contains("delay"), "{text}");
    assert!(std::fs::read_to_string(&plot).unwrap().contains("truth"));
}

#[test]
fn every_help_has_examples_and_those_with_quantities_name_units() {
    for command in [
        "focus",
        "abort",
        "status",
        "watch",
        "move",
        "mode",
        "pause",
        "resume",
        "devices",
        "report",
        "analyze",
        "info",
        "simulate",
        "demo",
        "completions",
    ] {
        let output = evfocus(&[command, "--help"]);
        let help = stdout(&output);
        assert!(output.status.success(), "{command}");
        assert!(
            help.contains("Examples:") && help.contains(&format!("evfocus {command}")),
            "{command}: {help}"
        );
        if !["abort", "mode", "pause", "resume", "devices", "completions"].contains(&command) {
            assert!(
                help.contains("Units:") && help.contains("counts") || command == "info",
                "{command}: {help}"
            );
        }
    }
    let help = stdout(&evfocus(&["--help"]));
    for part in ["Exit status", "counts/s", "55ms"] {
        assert!(help.contains(part), "no {part:?}");
    }
}

#[test]
fn the_help_of_report_shows_where_the_estimators_are() {
    let help = stdout(&evfocus(&["report", "--help"]));
    assert!(help.contains("jq '.sweeps[].estimators'"), "{help}");
}

#[test]
fn completions_know_the_commands() {
    for shell in ["bash", "zsh", "fish"] {
        let script = stdout(&evfocus(&["completions", shell]));
        assert!(
            script.contains("analyze") && script.contains("er-squared") && script.contains("structure"),
            "{shell}"
        );
    }
}

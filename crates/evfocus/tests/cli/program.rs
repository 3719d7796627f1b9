//! What the tests of the program share: running it, and a small simulated recording.
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

/// Runs the program with `arguments`.
pub(crate) fn evfocus<S: AsRef<std::ffi::OsStr>>(arguments: &[S]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_evfocus"))
        .args(arguments)
        .env_remove("EVFOCUS_SIM_SEED")
        .env_remove("EVFOCUS_SOCKET")
        .output()
        .expect("the program runs")
}

/// Standard output as text.
pub(crate) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).expect("output is UTF-8")
}

/// Standard error as text.
pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).expect("errors are UTF-8")
}

/// Runs the program, wants exit status 0, and reads its output as JSON.
pub(crate) fn json<S: AsRef<std::ffi::OsStr> + std::fmt::Debug>(arguments: &[S]) -> Value {
    json_with_status(arguments, 0)
}

/// Runs the program, wants `status`, and reads its output as JSON.
pub(crate) fn json_with_status<S: AsRef<std::ffi::OsStr> + std::fmt::Debug>(
    arguments: &[S],
    status: i32,
) -> Value {
    let output = evfocus(arguments);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {}", stderr(&output));
    serde_json::from_str(&stdout(&output)).expect("output is JSON")
}

/// Runs the program and wants an error: exit status `status`, and every one of `parts` in the message.
pub(crate) fn refuses<S: AsRef<std::ffi::OsStr> + std::fmt::Debug>(
    arguments: &[S],
    status: i32,
    parts: &[&str],
) {
    let output = evfocus(arguments);
    let message = stderr(&output);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {message}");
    assert!(message.starts_with("error: "), "{arguments:?}: {message}");
    assert!(stdout(&output).is_empty(), "{arguments:?} printed {}", stdout(&output));
    for part in parts {
        assert!(message.contains(part), "{arguments:?}: no {part:?} in: {message}");
    }
}

/// A recording with positions and truth.
#[derive(Debug, Clone)]
pub(crate) struct Sweep {
    pub(crate) recording: PathBuf,
    pub(crate) positions: PathBuf,
    pub(crate) truth: Value,
}

impl Sweep {
    /// Simulates with `options` into `folder`.
    pub(crate) fn simulate(folder: &Path, options: &[&str]) -> Self {
        let (recording, positions, truth) =
            (folder.join("s.raw"), folder.join("s.csv"), folder.join("s.json"));
        let mut arguments = vec!["simulate", "--out", text(&recording), "--positions", text(&positions)];
        arguments.extend(["--truth", text(&truth)]);
        arguments.extend(options);
        let output = evfocus(&arguments);
        assert!(output.status.success(), "{}", stderr(&output));
        let truth = serde_json::from_slice(&std::fs::read(&truth).expect("a truth file")).expect("JSON");
        Self { recording, positions, truth }
    }

    /// The arguments of `analyze` for this sweep.
    pub(crate) fn analyze(&self) -> Vec<&str> {
        vec!["analyze", text(&self.recording), "--positions", text(&self.positions)]
    }
}

/// A hand-held sweep of half a second, made once for all tests of a file.
pub(crate) fn sweep() -> &'static Sweep {
    static SWEEP: OnceLock<(tempfile::TempDir, Sweep)> = OnceLock::new();
    let (_, sweep) = SWEEP.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let sweep = Sweep::simulate(folder.path(), &["--sweep-s", "0.5", "--shake", "2", "--focus", "1700"]);
        (folder, sweep)
    });
    sweep
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// A number in `value`.
pub(crate) fn number(value: &Value, field: &str) -> f64 {
    value.get(field).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number {field} in {value}"))
}

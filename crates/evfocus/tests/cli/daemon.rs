//! The commands that speak to a daemon, against one on a simulated rig in a thread of the test.

use std::path::PathBuf;
use std::process::{Command, Output, Stdio};
use std::thread::JoinHandle;

use evfocusd::{Config, daemon};
use serde_json::Value;
use tokio::sync::oneshot;

use crate::program::{number, stderr, stdout};

/// A daemon that runs until it is dropped.
struct Daemon {
    folder: tempfile::TempDir,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Daemon {
    fn start() -> Self {
        Self::start_with(Config::simulated().unwrap())
    }

    fn start_with(config: Config) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let config = Config {
            socket: folder.path().join("socket"),
            state_dir: folder.path().join("reports"),
            ..config
        };
        let again = config.clone();
        let reread = Box::new(move || Ok(again.clone()));
        let (ready, is_ready) = std::sync::mpsc::channel();
        let (stop, stopped) = oneshot::channel::<()>();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
            let until = async { drop(stopped.await) };
            runtime.block_on(daemon::run(config, reread, move || ready.send(()).unwrap(), until)).unwrap();
        });
        is_ready.recv().expect("the daemon starts");
        let daemon = Self { folder, stop: Some(stop), thread: Some(thread) };
        daemon.wait_for_devices();
        daemon
    }

    /// Clients are served before camera and lens have said that they are there.
    fn wait_for_devices(&self) {
        let are_there = |status: &Value| status["camera"].is_string() && status["lens_position"].is_number();
        assert!((0..500).any(|_| are_there(&self.json(&["status", "--json"]))), "no camera or no lens");
    }

    fn socket(&self) -> PathBuf {
        self.folder.path().join("socket")
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_evfocus"));
        command.args(arguments).env("EVFOCUS_SOCKET", self.socket());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{arguments:?}: {}", stderr(&output));
        serde_json::from_str(&stdout(&output)).unwrap()
    }

    fn refuses(&self, arguments: &[&str], parts: &[&str]) {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}: {}", stdout(&output));
        for part in parts {
            assert!(stderr(&output).contains(part), "{arguments:?}: no {part:?} in {}", stderr(&output));
        }
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        drop(self.stop.take());
        let ended = self.thread.take().unwrap().join();
        assert!(ended.is_ok() || std::thread::panicking(), "the daemon ended badly");
    }
}

#[test]
fn continuous_mode_starts_runs_by_itself_unless_it_is_paused() {
    let daemon = Daemon::start();
    daemon.refuses(&["pause"], &["the mode is auto", "continuous"]);
    let comes_to = |state: &str| {
        let is_there = |status: &Value| status["state"] == state;
        assert!((0..2_000).any(|_| is_there(&daemon.json(&["status", "--json"]))), "never {state}");
    };
    assert_eq!(daemon.json(&["mode", "continuous", "--json"])["mode"], "continuous");
    comes_to("scanning");
    assert_eq!(daemon.json(&["pause", "--json"])["continuous"], "paused");
    comes_to("idle");
    assert!(stdout(&daemon.run(&["status"])).contains("mode      continuous, paused"));
    assert!(stdout(&daemon.run(&["resume"])).contains("continuous mode resumed"));
    comes_to("scanning");
    assert!(daemon.run(&["pause", "--deferred"]).status.success());
    assert_eq!(daemon.json(&["status", "--json"])["pause"], "pausing");
    assert_eq!(daemon.run(&["focus"]).status.code(), Some(0), "follows the run under way");
    comes_to("focused");
    assert_eq!(daemon.json(&["status", "--json"])["pause"], "paused");
}

#[test]
fn a_session_with_the_daemon() {
    let daemon = Daemon::start();
    let status = daemon.json(&["status", "--json"]);
    assert_eq!((&status["mode"], &status["state"]), (&"auto".into(), &"idle".into()));
    // And the serial ports of this machine, if it has any.
    assert!(daemon.json(&["devices", "--json"]).as_array().is_some_and(|devices| devices.len() >= 2));
    for command in ["status", "devices"] {
        assert!(stdout(&daemon.run(&[command])).contains("simulated"), "{command}");
    }
    daemon.refuses(&["report"], &["no report"]);
    daemon.refuses(&["move", "9999"], &["9999", "3750"]);
    daemon.refuses(&["focus", "--method", "guess"], &["guess", "egs"]);
    let speed = daemon.run(&["focus", "--sweep-speed", "1"]);
    let message = stderr(&speed);
    assert!(message.starts_with("error: --sweep-speed: ") && !message.contains("counts_per_s"), "{message}");
    assert_eq!(message.matches("a sweep of").count(), 1, "{message}");
    daemon.refuses(
        &["focus", "--sweep-speed", "1e6"],
        &["error: --sweep-speed is 1000000; it must be from 0 to "],
    );
    let interval = daemon.run(&["focus", "--method", "er-fixed", "--interval", "9s"]);
    assert!(stderr(&interval).starts_with("error: --interval: an interval of 9 s"), "{}", stderr(&interval));
    daemon.refuses(&["focus", "--from", "1", "--to", "2"], &["error: --from", "220", "3750"]);
    let off = ["focus", "--window", "0,0,10,10", "--window", "340,0,10,10"];
    daemon.refuses(&off, &["error: --window: window 1: 10 x 10 pixels at 340, 0", "346 x 260"]);
    daemon.refuses(&["focus", "--prefer", "1"], &["error: --prefer: window 1", "0 windows"]);
    daemon
        .refuses(&["focus", "--method", "egs", "--window", "0,0,9,9"], &["error: --method: ", "egs", "auto"]);
    assert_eq!(daemon.json(&["abort", "--json"])["run_id"], Value::Null);

    let moved = daemon.json(&["move", "400", "--wait", "--json"]);
    assert!((number(&moved, "arrived_at") - 400.0).abs() < 20.0, "{moved}");

    assert_eq!(daemon.json(&["mode", "manual", "--json"])["mode"], "manual");
    daemon.refuses(&["focus"], &["manual", "auto"]);
    assert_eq!(daemon.json(&["mode", "auto", "--json"])["mode"], "auto");
}

#[test]
fn a_run_is_followed_to_its_report() {
    let daemon = Daemon::start();
    let focus = ["focus", "--from", "1500", "--to", "2500", "--one-way", "--method", "er-fixed"];
    let output = daemon.run(&[&focus[..], &["--interval", "50ms", "--json"]].concat());
    let report: Value = serde_json::from_str(&stdout(&output)).unwrap();
    // A machine that is too busy may make the run fail, but never without a reason.
    match output.status.code() {
        Some(0) => assert!((number(&report["result"], "position") - 1985.0).abs() < 400.0, "{report}"),
        Some(3) => assert!(report["result"]["reason"].is_string(), "{report}"),
        other => panic!("status {other:?}: {}", stderr(&output)),
    }
    assert_eq!(report["request"]["interval_us"], 50_000);
    assert_eq!(report["request"]["directions"], "forward");
    let plot = daemon.folder.path().join("run.svg");
    let again = daemon.json(&["report", "1", "--json", "--plot", plot.to_str().unwrap()]);
    assert_eq!(again, report);
    assert!(std::fs::read_to_string(plot).unwrap().contains("<svg"));
    assert!(stdout(&daemon.run(&["report"])).contains("sweep from 1500.0 to 2500.0"));
}

#[test]
fn a_window_is_focused_on_and_the_answer_says_how_sure_it_is() {
    let daemon = Daemon::start();
    let focus = ["focus", "--from", "1500", "--to", "2500", "--speed", "fast", "--window", "25%,25%,50%,50%"];
    let text = stdout(&daemon.run(&[&focus[..], &["--prefer", "0", "--one-way"]].concat()));
    let report = daemon.json(&["report", "--json"]);
    let (request, result) = (&report["request"], &report["result"]);
    assert_eq!((&request["speed"], &request["directions"]), (&"fast".into(), &"forward".into()));
    assert_eq!((&request["windows"][0]["x"], &request["prefer"]), (&87.0.into(), &"0".into()));
    assert_eq!(report["windows"][0]["width"], 173);
    // A machine that is too busy may make the run fail.
    if result["state"] == "focused" {
        for part in [" ± ", " % sure (structure)", "window 0 decided, 173 x 130 pixels at 87, 65"] {
            assert!(text.contains(part), "no {part:?} in {text}");
        }
        assert_eq!(report["windows"][0]["position"], result["position"]);
        assert_eq!(report["map"]["confidence"].as_array().map(Vec::len), Some(24));
        let map = daemon.folder.path().join("map.svg");
        stdout(&daemon.run(&["report", "--map", map.to_str().unwrap()]));
        assert!(std::fs::read_to_string(map).unwrap().contains("<svg"));
        assert!((number(result, "position") - 1985.0).abs() < 4.0 * number(result, "error_bar"), "{result}");
        assert!(stdout(&daemon.run(&["status"])).contains(" % sure"));
    }
    let long = stdout(&daemon.run(&["report"]));
    for part in ["delay of the pixels  6.0 ms", "assumed", "window 0", "peak   "] {
        assert!(long.contains(part), "no {part:?} in {long}");
    }
}

#[test]
fn an_aborted_run_is_status_3() {
    let daemon = Daemon::start();
    let mut focus = daemon.command(&["focus", "--json"]).stdout(Stdio::piped()).spawn().unwrap();
    let aborted = loop {
        let run = daemon.json(&["status", "--json"])["run_id"].clone();
        if !run.is_null() {
            assert_eq!(daemon.json(&["abort", "--json"])["run_id"], run);
            break run;
        }
        assert!(focus.try_wait().unwrap().is_none(), "the run ended before it could be aborted");
    };
    let output = focus.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let report: Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&report["run_id"], &report["result"]["state"]), (&aborted, &"idle".into()));
}

#[test]
fn watching_an_idle_daemon_prints_a_line_a_second() {
    use std::io::BufRead;
    let daemon = Daemon::start();
    let mut watch = daemon.command(&["watch", "--json"]).stdout(Stdio::piped()).spawn().unwrap();
    let lines = std::io::BufReader::new(watch.stdout.take().unwrap()).lines();
    let statuses: Vec<Value> =
        lines.take(8).map(|line| serde_json::from_str(&line.unwrap()).unwrap()).collect();
    watch.kill().unwrap();
    watch.wait().unwrap();
    // The first ones may tell that the lens has come to rest.
    let uptimes: Vec<f64> = statuses.iter().map(|status| number(status, "uptime_s")).collect();
    let steps: Vec<f64> = uptimes.windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert!(steps.iter().skip(3).all(|&step| step > 0.8), "{steps:?}");
}

#[test]
fn watching_ends_with_its_reader() {
    use std::io::BufRead;
    let daemon = Daemon::start();
    let mut watch = daemon.command(&["watch", "--json"]).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = std::io::BufReader::new(watch.stdout.take().unwrap()).lines();
    let status: Value = serde_json::from_str(&lines.next().unwrap().unwrap()).unwrap();
    assert_eq!(status["mode"], "auto");
    drop(lines);
    assert_eq!(watch.wait().unwrap().code(), Some(0));
}

/// With a fast lens, so that it does not take long in real time.
#[test]
fn a_lens_is_calibrated_and_stays_so() {
    let mut config = Config::simulated().unwrap();
    config.rig.lens.max_speed = evfocus_core::LensSpeed::new(12_000.0).unwrap();
    config.rig.lens.acceleration = 400_000.0;
    let daemon = Daemon::start_with(config);
    let known = daemon.json(&["calibrate", "lens", "--json"]);
    assert!(known["lens"].as_str().unwrap().starts_with("simulated lens"), "{known}");
    let speed = number(&known, "speed_counts_per_s");
    assert!((speed - 12_000.0).abs() < 600.0, "{known}");
    assert_eq!(daemon.json(&["status", "--json"])["calibration"], known);
    assert!(stdout(&daemon.run(&["status"])).contains("counts/s"));
    let kept = std::fs::read(daemon.folder.path().join("reports/lens-calibration.json")).unwrap();
    assert_eq!(serde_json::from_slice::<Value>(&kept).unwrap(), known);
    let devices = daemon.json(&["devices", "--probe", "/dev/ttyNOBODY", "--json"]);
    let asked = devices.as_array().unwrap().iter().find(|device| device["location"] == "/dev/ttyNOBODY");
    assert_eq!(asked.unwrap()["state"], "missing", "{devices}");
}

//! The configuration: the files that come with evfocus are good, and what is wrong with others is said.

use std::path::{Path, PathBuf};
use std::time::Duration;

use evfocus_core::Prefer;
use evfocus_core::controller::{Pace, WatchConfig};
use evfocusd::Config;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../config")
}

#[test]
fn every_file_that_comes_with_evfocus_is_good() {
    let mut files = 0;
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            Config::read(&path).unwrap();
            files += 1;
        }
    }
    assert!(files > 0);
}

#[test]
fn the_annotated_file_says_what_no_file_means() {
    let annotated = Config::read(&folder().join("evfocusd.toml")).unwrap();
    let nothing = Config::simulated().unwrap();
    assert_eq!(format!("{annotated:?}"), format!("{nothing:?}"));
}

#[test]
fn the_optional_keys_are_annotated_with_what_is_used_without_them() {
    let text = std::fs::read_to_string(folder().join("evfocusd.toml")).unwrap();
    let (_, after) = text.split_once("[focus]").unwrap();
    let (section, _) = after.split_once("# The rig that").unwrap();
    let keys: Vec<_> = section.lines().map(|line| line.trim_start_matches("# ")).collect();
    let written = Config::parse(&format!("[focus]\n{}", keys.join("\n")), Path::new("annotated")).unwrap();
    let nothing = Config::simulated().unwrap();
    let rig = |config: &Config| evfocusd::VirtualRig::new(config).unwrap().controller().config().clone();
    let (mut written, nothing) = (rig(&written), rig(&nothing));
    assert!((written.approach_margin - nothing.approach_margin).abs() < 1e-9, "a decimal and a product");
    written.approach_margin = nothing.approach_margin;
    assert_eq!(written, nothing);
}

/// The optional keys of a camera's file mean what is used without them, except those that must name something.
#[test]
fn the_cameras_files_are_annotated_with_what_is_used_without_them() {
    use evfocusd::config::CameraConfig;
    let written = |name: &str, left_out: &[&str]| {
        let text = std::fs::read_to_string(folder().join(name)).unwrap();
        let is_left_out = |line: &str| left_out.iter().any(|key| line.starts_with(&format!("# {key} =")));
        let line = |line: &str| {
            let key = line
                .strip_prefix("# ")
                .filter(|rest| rest.split_once(" = ").is_some_and(|(key, _)| !key.contains(' ')));
            key.filter(|_| !is_left_out(line)).unwrap_or(line).to_owned()
        };
        let keys: Vec<String> = text.lines().map(line).collect();
        Config::parse(&keys.join("\n"), Path::new(name)).unwrap().camera
    };
    let whole = |geometry| Some(evfocus_core::Window::whole(geometry));
    let left_out = ["serial", "masked_pixels", "activity_filter_ms", "refractory_filter_ms"];
    let CameraConfig::Davis346 { mut settings, .. } = written("davis346.toml", &left_out) else { panic!() };
    assert_eq!(settings.roi.take(), whole(evfocus_camera::davis346::GEOMETRY));
    let biases = std::mem::take(&mut settings.biases);
    assert_eq!(settings, evfocus_camera::davis346::Settings::default());
    assert_eq!(biases.len(), 6);
    let left_out = ["serial", "masked_pixels", "rate_limit_events_per_s", "anti_flicker_hz"];
    let CameraConfig::Evk4 { mut settings, .. } = written("evk4.toml", &left_out) else { panic!() };
    assert_eq!(settings.roi.take(), whole(evfocus_camera::evk4::GEOMETRY));
    let biases = std::mem::take(&mut settings.biases);
    assert_eq!(settings, evfocus_camera::evk4::Settings::default());
    assert_eq!(biases.iter().filter(|(_, offset)| *offset == 0).count(), 6);
}

/// What a mistake is answered with must name the file and everything in `words`.
fn refused(text: &str, words: &[&str]) {
    let parsed = Config::parse(text, Path::new("/etc/evfocus/rig.toml"));
    let error = parsed.err().map(|error| error.to_string()).unwrap_or_default();
    for word in ["/etc/evfocus/rig.toml"].iter().chain(words) {
        assert!(error.contains(word), "{word:?} is not in {error:?}");
    }
}

#[test]
fn mistakes_are_named_with_key_value_and_remedy() {
    refused("[focus]\nmethud = \"egs\"", &["methud", "line 2"]);
    refused("[focus]\nmethod = \"esg\"", &["focus.method", "esg", "er-fixed"]);
    refused("[focus]\nrest_ms = \"100 ms\"", &["rest_ms", "line 2"]);
    refused("[focus]\nrest_ms = 5", &["focus.rest_ms", "5", "10"]);
    refused("[focus]\nrest_ms = nan", &["focus.rest_ms", "NaN"]);
    refused("[focus]\nsweep_speed_counts_per_s = 9000", &["sweep_speed_counts_per_s", "9000", "1765"]);
    refused("[focus]\nspeed = \"quick\"", &["line 2", "focus.speed", "quick", "fast", "normal", "accurate"]);
    refused("[focus]\nprefer = \"0\"", &["line 2", "focus.prefer", "0", "strongest", "nearest"]);
    refused("[focus]\nnearest_at = \"top\"", &["line 2", "focus.nearest_at", "top", "max", "min"]);
    refused("[focus]\ndepth_of_focus_counts = -1", &["line 2", "focus.depth_of_focus_counts", "-1", "3530"]);
    refused("[focus]\nextend_range = 1.5", &["line 2", "focus.extend_range", "1.5"]);
    refused("[focus]\ndirections = \"both\"", &["line 2", "directions"]);
    refused(
        "[lens]\nbackend = \"moonlight\"",
        &["line 2", "lens.backend", "moonlight", "simulated", "moonlite"],
    );
    refused("[lens]\nport = \"/dev/ttyUSB0\"", &["line 2", "lens.port", "simulated"]);
    refused("[camera]\nbackend = \"evk5\"", &["line 2", "camera.backend", "evk5", "davis346", "evk4"]);
    refused("[camera]\nserial = \"1\"", &["line 2", "camera.serial", "simulated"]);
    refused(
        "[camera]\nbackend = \"evk4\"\npacket_delay_ms = 1",
        &["line 3", "camera.packet_delay_ms", "evk4"],
    );
    refused(
        "[camera]\nbackend = \"davis346\"\nrow_order = \"top-down\"",
        &["line 3", "row_order", "davis346"],
    );
    refused("[camera]\nbackend = \"davis346\"\nserial = \"\"", &["line 3", "camera.serial"]);
    refused(
        "[camera]\nbackend = \"davis346\"\n[camera.biases]\nPrBp = 5",
        &["line 4", "PrBp", "[coarse, fine]"],
    );
    refused(
        "[camera]\nbackend = \"davis346\"\n[camera.biases]\nPrBp = [9, 5]",
        &["line 4", "PrBp", "0 to 7"],
    );
    refused(
        "[camera]\nbackend = \"evk4\"\n[camera.biases]\nbias_fo = [1, 2]",
        &["line 4", "bias_fo", "offset"],
    );
    refused(
        "[camera]\nbackend = \"evk4\"\n[camera.biases]\nbias_fo = 201",
        &["line 4", "bias_fo", "-150 to 200"],
    );
    refused("[camera]\nbackend = \"evk4\"\n[camera.biases]\nbias_x = 1", &["bias_x", "bias_diff_on"]);
    refused("[camera]\nbackend = \"evk4\"\nroi = [1200, 0, 100, 10]", &["line 3", "camera.roi", "1280x720"]);
    refused("[camera]\nbackend = \"evk4\"\nrate_limit_events_per_s = 1", &["line 3", "rate_limit", "5000"]);
    refused(
        "[camera]\nbackend = \"davis346\"\ntrigger_input = \"edges\"",
        &["line 3", "trigger_input", "pulse"],
    );
    refused(
        "[camera]\nbackend = \"davis346\"\nactivity_filter_ms = 0.1",
        &["line 3", "activity_filter_ms", "0.25"],
    );
    refused("[lens]\nmin_counts = 3000\nmax_counts = 300", &["lens.min_counts", "3000", "300"]);
    refused("[lens]\nmax_counts = 9999", &["lens.max_counts", "9999", "3750"]);
    refused("[simulation]\nscene = \"cat\"", &["simulation.scene", "cat", "dead-leaves"]);
    refused("[simulation]\nlight = \"dim\"", &["simulation.light", "dim", "dark"]);
    refused("[simulation]\nfocus_counts = 99999", &["line 2", "simulation.focus_counts", "99999", "3750"]);
    refused("[[simulation.faults]]\nkind = \"gremlin\"\nafter_ms = 1", &["gremlin", "lens-stalled"]);
    refused("[[simulation.faults]]\nkind = \"lens-stalled\"", &["lens-stalled", "after_ms"]);
    refused("[daemon]\nmode = \"continual\"", &["daemon.mode", "continual", "manual", "continuous"]);
    refused("[continuous]\nrefocus_below = 1.0", &["line 2", "continuous.refocus_below", "1", "0.95"]);
    refused("[continuous]\npatience_s = 0", &["line 2", "continuous.patience_s", "0.1"]);
    refused("[continuous]\nrest_s = 90\n", &["continuous.longest_rest_s", "60", "90"]);
    refused("[continuous]\npatience = 1", &["line 2", "patience"]);
    refused("[daemon]\nreports_kept = 0", &["daemon.reports_kept", "0", "1"]);
    refused("[daemon\n", &["line 1"]);
    refused("[serial]\nport = 1", &["serial"]);
    refused(
        "[focus]\nposition_tolerance_counts = 3000",
        &["line 2", "focus.position_tolerance_counts", "3000", "176.5"],
    );
    refused("[focus]\napproach_margin_counts = 0", &["focus.approach_margin_counts", "0", "21.18"]);
    refused("[focus]\nlongest_sweep_s = 0.5", &["line 2", "focus.longest_sweep_s", "2.0 s"]);
    refused("[focus]\n\nmethod = \"er-fixed\"\ninterval_ms = 5000", &["line 4", "focus.interval_ms", "5 s"]);
    refused("[focus]\nbin_us = 1.5", &["bin_us", "line 2"]);
    refused(
        "[focus]\nbin_us = 1\nlongest_sweep_s = 120\nevents_kept = 999999999",
        &["focus.events_kept", "GB"],
    );
    refused("[simulation]\nflicker_hz = -100", &["line 2", "simulation.flicker_hz", "-100"]);
    refused("[simulation]\nflicker_depth = 7", &["simulation.flicker_depth", "7"]);
    refused("[simulation]\nshake_px_rms = -2", &["line 2", "simulation.shake_px_rms", "-2"]);
    refused(
        "[[simulation.faults]]\nkind = \"lens-silent\"\nafter_ms = 1\nshare = 0.5",
        &["simulation.faults.share", "lens-silent", "event-loss"],
    );
    refused("[daemon]\nsocket = \"\"", &["line 2", "daemon.socket"]);
}

/// A lens section for the driver `name`, with `keys` of its own.
fn driver(name: &str, keys: &str) -> String {
    format!("[lens]\nbackend = \"{name}\"\nmin_counts = 0\nmax_counts = 3000\n{keys}")
}

#[test]
fn mistakes_about_lens_drivers_are_named() {
    let moonlite = |keys: &str| driver("moonlite", keys);
    refused(&moonlite(""), &["lens.port", "missing", "/dev/serial/by-id"]);
    refused(&moonlite("address = \"10.0.0.5:99\""), &["line 5", "lens.address", "10.0.0.5:99", "lens.port"]);
    refused("[lens]\nbackend = \"moonlite\"\nport = \"x\"", &["lens.min_counts", "missing", "moonlite"]);
    refused(
        "[lens]\nbackend = \"moonlite\"\nport = \"x\"\nmin_counts = -5\nmax_counts = 9",
        &["line 4", "lens.min_counts", "-5", "16777215"],
    );
    refused(
        &moonlite("port = \"x\"\n[lens.moonlite]\nmax_speed_counts_per_s = 0"),
        &["line 7", "lens.moonlite.max_speed_counts_per_s", "0"],
    );
    refused(
        &moonlite("port = \"x\"\n[lens.moonlite]\nsteps = \"quarter\""),
        &["lens.moonlite.steps", "quarter", "half"],
    );
    refused(&driver("grbl", "port = \"x\"\n[lens.grbl]\naxis = \"A\""), &["lens.grbl.axis", "A", "X"]);
    refused(
        &driver("firmata", "port = \"x\"\npoll_ms = 50"),
        &["line 6", "lens.poll_ms", "50", "steers", "at most 10"],
    );
    refused(
        &driver("firmata", "port = \"x\"\n[lens.firmata]\ndirection_pin = 3"),
        &["line 7", "lens.firmata.direction_pin", "another pin"],
    );
    refused(
        &driver("labjack", "address = \"emulated\"\n[lens.drive]\ncounts_at_full = 2000"),
        &["line 4", "lens.max_counts", "3000", "2000"],
    );
    refused(&driver("labjack", "address = \"10.0.0.5\""), &["line 5", "lens.address", "10.0.0.5", ":502"]);
    refused(&driver("labjack", "port = \"/dev/ttyUSB0\""), &["line 5", "lens.port", "lens.address"]);
    refused(
        &driver("indi", "address = \"localhost:7624\""),
        &["lens.indi.device", "missing", "indi_getprop"],
    );
    refused(
        &driver("indi", "address = \"a:1\"\n[lens.indi]\ndevice = \"F\"\npolling_ms = 1"),
        &["line 8", "lens.indi.polling_ms", "1", "10"],
    );
    let optotune = |keys: &str| driver("optotune", &format!("port = \"x\"\n[lens.optotune]\n{keys}"));
    refused(&optotune("quantity = \"diopters\""), &["lens.optotune.quantity", "diopters", "focal-power"]);
    refused(&optotune("damping = 1.5"), &["line 7", "lens.optotune.damping", "1.5", "0.99"]);
}

#[test]
fn the_keys_of_a_run_reach_the_controller() {
    let text = "[focus]\nspeed = \"fast\"\nprefer = \"nearest\"\nnearest_at = \"min\"\ndepth_of_focus_counts = 50\nextend_range = 0\n\
                [continuous]\nrefocus_below = 0.5\nlongest_rest_s = 600";
    let config = Config::parse(text, Path::new("rig.toml")).unwrap();
    let rig = evfocusd::VirtualRig::new(&config).unwrap();
    let controller = rig.controller().config();
    assert_eq!((controller.pace, controller.prefer), (Pace::Fast, Prefer::Nearest));
    assert!(!controller.nearest_is_high);
    let expected =
        WatchConfig { refocus_below: 0.5, longest_rest: Duration::from_secs(600), ..WatchConfig::default() };
    assert_eq!(controller.watch, expected);
    assert!((controller.depth_of_focus - 50.0).abs() + controller.extension < 1e-9);
}

#[test]
fn a_file_that_cannot_be_read_is_named() {
    let error = Config::read(Path::new("/nonexistent/evfocus.toml")).unwrap_err().to_string();
    assert!(error.contains("/nonexistent/evfocus.toml"), "{error}");
}

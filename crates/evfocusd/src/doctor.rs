//! What of the machine stands in the way of good focus runs, and what to do about it. It looks and changes nothing.

mod machine;

use std::path::Path;

use evfocus_camera::{Access, discovery, usb};
use rustix::fs::Access as Mode;

use crate::config::{CameraConfig, Config, LensBackend, LensPlace};
use machine::Machine;

/// How serious a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// All is well.
    Good,
    /// It works, and could work better.
    Advice,
    /// It does not work like this.
    Trouble,
}

/// What a check found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How serious it is.
    pub severity: Severity,
    /// What was found.
    pub found: String,
    /// What to do; nothing if all is well.
    pub remedy: Option<String>,
}

impl Finding {
    /// All is well.
    pub fn good(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, severity: Severity::Good, found: found.into(), remedy: None }
    }

    /// It could be better.
    pub fn advice(check: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, severity: Severity::Advice, found: found.into(), remedy: Some(remedy.into()) }
    }

    /// It does not work.
    pub fn trouble(check: &'static str, found: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, severity: Severity::Trouble, found: found.into(), remedy: Some(remedy.into()) }
    }
}

/// The devices that a running daemon has in use. Whether whoever asks may open them is of no importance then.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct InUse {
    /// The camera.
    pub camera: bool,
    /// The lens.
    pub lens: bool,
}

/// Examines the machine for a daemon with `config`, which has `in_use` if it runs.
pub fn examine(config: &Config, in_use: InUse) -> Vec<Finding> {
    let machine = Machine::new(Path::new("/"));
    let mut findings = cameras(&config.camera, in_use.camera);
    findings.push(lens(&config.lens, in_use.lens));
    let needs_usb = config.camera.driver().is_some();
    findings.push(machine.udev_rule(needs_usb));
    findings.push(machine.usb_memory(needs_usb));
    findings.push(machine.governor());
    findings.push(machine.clock_source());
    if config.real_time.camera_priority.is_some() || config.real_time.control_priority.is_some() {
        findings.push(machine.real_time_share());
    }
    findings.push(machine::disk(&config.state_dir));
    findings
}

/// Whether the camera is there, can be opened, and is fast enough.
fn cameras(wanted: &CameraConfig, in_use: bool) -> Vec<Finding> {
    const CHECK: &str = "camera";
    let Some(driver) = wanted.driver() else {
        return vec![Finding::good(CHECK, wanted.name())];
    };
    let found = match usb::list() {
        Ok(found) => found,
        Err(error) => {
            let remedy = "is USB there at all? lsusb should list something";
            return vec![Finding::trouble(CHECK, error.to_string(), remedy)];
        }
    };
    let ours: Vec<_> = found.into_iter().filter(|camera| camera.device.driver == driver).collect();
    if ours.is_empty() {
        let remedy = "plug it in, or try another cable or port; `evfocus devices` lists what is attached";
        return vec![Finding::trouble(CHECK, format!("no {driver} is attached"), remedy)];
    }
    ours.into_iter()
        .map(|camera| {
            let name = format!(
                "{} {} at {}, firmware {}",
                camera.device.model, camera.serial, camera.location, camera.version
            );
            let access = if in_use { Access::Busy } else { camera.access };
            match (access, discovery::advice_on_speed(camera.speed)) {
                (Access::Denied(remedy) | Access::Faulty(remedy), _) => {
                    Finding::trouble(CHECK, format!("{name}: cannot be opened"), remedy)
                }
                (Access::Free | Access::Busy, Some(advice)) => Finding::advice(CHECK, name, advice),
                // The daemon has it, or could have it.
                (Access::Free | Access::Busy, None) => Finding::good(CHECK, name),
            }
        })
        .collect()
}

/// Whether the lens's port is there and may be used.
fn lens(backend: &LensBackend, in_use: bool) -> Finding {
    const CHECK: &str = "lens";
    let (driver, place) = (backend.name(), backend.location());
    let serial = matches!(backend, LensBackend::Driver { place: LensPlace::Serial { .. }, .. });
    if !serial || in_use {
        return Finding::good(CHECK, format!("{driver} {place}").trim_end());
    }
    match rustix::fs::access(place, Mode::READ_OK | Mode::WRITE_OK) {
        Ok(()) => Finding::good(CHECK, format!("{driver} at {place}")),
        Err(rustix::io::Errno::NOENT) => Finding::trouble(
            CHECK,
            format!("{place} is not there"),
            "plug it in; /dev/evfocus/lens-SERIAL keeps its name wherever it is plugged in",
        ),
        Err(error) => Finding::advice(
            CHECK,
            format!("{place}: {error}"),
            "if the daemon may not open it either, add its user to the group dialout",
        ),
    }
}

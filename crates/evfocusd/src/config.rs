//! The configuration file: what users write, and what it means once it has been checked.

mod access;
mod camera;
mod continuous;
mod focus;
mod lens;
mod metrics;
mod real_time;
mod simulation;
mod value;

use std::path::{Path, PathBuf};
use std::time::Duration;

use evfocus_core::LensPosition;
use evfocus_core::controller::{FocusRequest, Mode, Refusal, WatchConfig};
use evfocus_ipc::Calibration;
use serde::Deserialize;

use crate::calibration;
use crate::reports::Kept;

pub use access::AccessSection;
pub use camera::{Bias, CameraConfig, CameraSection};
pub use continuous::ContinuousSection;
pub use focus::FocusSection;
pub use lens::{
    DriveSection, FirmataSection, GrblSection, IndiSection, LabJackSection, LensBackend, LensDriver,
    LensPlace, LensSection, MoonLiteSection, OptotuneSection, SettingSection,
};
pub use metrics::MetricsSection;
pub use real_time::RealTimeSection;
pub use simulation::{FaultSection, SimulationSection};
pub(crate) use value::BadValue;

/// The file as written. Every key has a default; no file at all is the simulated rig.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConfigFile {
    /// The daemon itself.
    pub daemon: DaemonSection,
    /// Who may move the lens.
    pub access: AccessSection,
    /// What is asked of the operating system.
    pub real_time: RealTimeSection,
    /// Figures for Prometheus.
    pub metrics: MetricsSection,
    /// The camera.
    pub camera: CameraSection,
    /// The lens.
    pub lens: LensSection,
    /// When mode continuous starts a run by itself.
    pub continuous: ContinuousSection,
    /// How to focus.
    pub focus: FocusSection,
    /// The simulated rig, for what is simulated.
    pub simulation: SimulationSection,
}

/// `[daemon]`
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DaemonSection {
    /// Where to listen; absent: see [`default_socket`].
    pub socket: Option<PathBuf>,
    /// Where to keep reports; absent: see [`default_state_dir`].
    pub state_dir: Option<PathBuf>,
    /// How many reports to keep; the oldest go first. 1 to 1,000,000.
    pub reports_kept: u32,
    /// After how many days reports are deleted, however few there are; 1 to 36,500; absent: never.
    pub report_days: Option<u32>,
    /// `auto`: focus runs when triggered; `manual`: the caller moves the lens; `continuous`: focus runs also when the picture has lost
    /// its sharpness.
    pub mode: String,
}

impl Default for DaemonSection {
    fn default() -> Self {
        Self { socket: None, state_dir: None, reports_kept: 1000, report_days: None, mode: "auto".to_owned() }
    }
}

/// The configuration, checked.
#[derive(Debug, Clone)]
pub struct Config {
    /// Where to listen.
    pub socket: PathBuf,
    /// Where to keep reports.
    pub state_dir: PathBuf,
    /// How many reports to keep.
    pub reports_kept: usize,
    /// The mode to start in.
    pub mode: Mode,
    /// After how many days reports are deleted.
    pub report_days: Option<u32>,
    /// Who may move the lens.
    pub access: AccessSection,
    /// What is asked of the operating system.
    pub real_time: RealTimeSection,
    /// Figures for Prometheus.
    pub metrics: MetricsSection,
    /// Which lens, and where.
    pub lens: LensBackend,
    /// How often the lens is asked where it is.
    pub lens_poll: Duration,
    /// Play between what the lens reports and the glass, counts; nothing: as it was calibrated.
    pub lens_backlash: Option<f64>,
    /// The positions the lens may be sent to, where they are narrower than its own.
    pub lens_min: Option<LensPosition>,
    /// See [`lens_min`](Self::lens_min).
    pub lens_max: Option<LensPosition>,
    /// The camera.
    pub camera: CameraConfig,
    /// When mode continuous starts a run by itself.
    pub continuous: WatchConfig,
    /// How to focus.
    pub focus: FocusSection,
    /// The simulated rig.
    pub rig: hil_sim::RigConfig,
}

/// What is wrong with a configuration.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read the configuration {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The file is not the TOML that is expected; the parser's words name line, column and key.
    #[error("{}: {cause}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, column, key.
        cause: Box<toml::de::Error>,
    },
    /// A value that makes no sense.
    #[error("{}{}: {key} is {value}: {remedy}", path.display(), line.map(|line| format!(", line {line}")).unwrap_or_default())]
    Value {
        /// The file.
        path: PathBuf,
        /// The line that sets the key, from 1; absent for a key that the file leaves out.
        line: Option<usize>,
        /// The key with its section.
        key: String,
        /// The value given.
        value: String,
        /// What it must be.
        remedy: String,
    },
}

impl Config {
    /// The configuration in the file at `path`.
    ///
    /// # Errors
    /// [`ConfigError`], naming the file, the key, the value and what it must be.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let text = std::fs::read_to_string(path)
            .map_err(|cause| ConfigError::Read { path: path.to_owned(), cause })?;
        Self::parse(&text, path)
    }

    /// The configuration in `text`, which came from `path`.
    ///
    /// # Errors
    /// As [`read`](Self::read).
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let file: ConfigFile = toml::from_str(text)
            .map_err(|cause| ConfigError::Syntax { path: path.to_owned(), cause: Box::new(cause) })?;
        Self::check(file).map_err(|bad| ConfigError::Value {
            path: path.to_owned(),
            line: line_of(text, &bad.key),
            key: bad.key,
            value: bad.value,
            remedy: bad.remedy,
        })
    }

    /// The simulated rig with every default.
    ///
    /// # Errors
    /// None; the defaults are checked by the same code as a file.
    pub fn simulated() -> Result<Self, ConfigError> {
        Self::parse("", Path::new("(no configuration file)"))
    }

    fn check(file: ConfigFile) -> Result<Self, BadValue> {
        let mode = match file.daemon.mode.as_str() {
            "auto" => Mode::Auto,
            "manual" => Mode::Manual,
            "continuous" => Mode::Continuous,
            other => {
                let remedy = "it must be \"auto\", \"manual\" or \"continuous\"";
                return Err(BadValue::new("daemon.mode", other, remedy));
            }
        };
        let reports = f64::from(file.daemon.reports_kept);
        BadValue::check("daemon.reports_kept", reports, 1.0, 1e6)?;
        if let Some(days) = file.daemon.report_days {
            BadValue::check("daemon.report_days", f64::from(days), 1.0, 36_500.0)?;
        }
        let lens = file.lens.backend()?;
        for (key, path) in
            [("daemon.socket", &file.daemon.socket), ("daemon.state_dir", &file.daemon.state_dir)]
        {
            if path.as_ref().is_some_and(|path| path.as_os_str().is_empty()) {
                return Err(BadValue::new(key, "empty", "give a path, or leave the key out for the default"));
            }
        }
        let config = Self {
            socket: file.daemon.socket.unwrap_or_else(default_socket),
            state_dir: file.daemon.state_dir.unwrap_or_else(default_state_dir),
            reports_kept: file.daemon.reports_kept as usize,
            mode,
            report_days: file.daemon.report_days,
            access: file.access,
            real_time: file.real_time.check()?,
            metrics: file.metrics.check()?,
            lens_poll: BadValue::duration("lens.poll_ms", file.lens.poll_ms, 1e-3, 0.5, 1000.0)?,
            lens_backlash: (file.lens.backlash_counts)
                .map(|play| BadValue::check("lens.backlash_counts", play, 0.0, 1e6))
                .transpose()?,
            camera: file.camera.camera()?,
            lens_min: file.lens.min_counts.map(LensPosition),
            lens_max: file.lens.max_counts.map(LensPosition),
            rig: file.simulation.rig(lens.emulated().as_ref())?,
            lens,
            continuous: file.continuous.check()?,
            focus: file.focus,
        };
        // Against the lens, where it is known without asking it, and the default run against both: now rather than at the
        // first run.
        if let Some(lens) = config.lens.expected(&config.rig) {
            let controller = config.controller(&lens, None)?;
            if let Some(geometry) = config.camera.geometry(config.rig.sensor.geometry) {
                FocusRequest::default().resolve(&controller, geometry).map_err(|refusal| {
                    let is_interval = matches!(refusal, Refusal::Interval { .. });
                    let key = if is_interval { "focus.interval_ms" } else { "focus.longest_sweep_s" };
                    BadValue::new(key, "not fit for a default run", refusal.to_string())
                })?;
            }
        }
        Ok(config)
    }

    /// Which reports stay.
    pub(crate) fn kept(&self) -> Kept {
        let age = self.report_days.map(|days| Duration::from_secs(u64::from(days) * 24 * 3600));
        Kept { newest: self.reports_kept, age }
    }

    /// The controller's settings for `lens`, of which `calibration` is known.
    pub(crate) fn controller(
        &self,
        lens: &evfocus_hal::LensInfo,
        calibration: Option<&Calibration>,
    ) -> Result<evfocus_core::ControllerConfig, BadValue> {
        if let Some(longest) = lens.class.longest_poll().filter(|longest| self.lens_poll > *longest) {
            let remedy = format!("a {} lens moves with each poll; at most {longest:?}", lens.class.name());
            return Err(BadValue::new("lens.poll_ms", self.lens_poll.as_secs_f64() * 1e3, remedy));
        }
        let controller = self.focus.controller(lens, self.lens_min, self.lens_max)?;
        let mut controller = calibration::apply(calibration, controller, lens.speed_is_share);
        // Room for a position at every poll of the longest sweep, and for the rests around it.
        let polls = controller.capacity.longest.as_secs_f64() / self.lens_poll.as_secs_f64();
        // What somebody has written down counts before what was measured.
        let measured = calibration.and_then(|known| known.backlash);
        controller.backlash = self.lens_backlash.or(measured).unwrap_or(0.0);
        if self.focus.approach_margin_counts.is_none() {
            // The last approach must take the play up.
            controller.approach_margin = controller.approach_margin.max(2.0 * controller.backlash);
        }
        controller.watch = self.continuous;
        controller.lens_samples = polls as usize * 2 + 1_000;
        Ok(controller)
    }
}

/// The line, from 1, on which `key` (section and name) is set in `text`; nothing if it is not.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let (section, name) = key.rsplit_once('.')?;
    let mut here = "";
    text.lines().enumerate().find_map(|(index, line)| {
        let line = line.trim();
        if line.starts_with('[') {
            here = line.trim_start_matches('[').split(']').next().unwrap_or_default().trim();
        }
        let (left, _) = line.split_once('=')?;
        (here == section && left.trim() == name).then_some(index + 1)
    })
}

/// `$EVFOCUS_SOCKET`, else `evfocus/socket` in `$XDG_RUNTIME_DIR`, else `/run/evfocus/socket`. Daemon and command line agree on it.
pub fn default_socket() -> PathBuf {
    if let Some(socket) = std::env::var_os("EVFOCUS_SOCKET") {
        return PathBuf::from(socket);
    }
    let base = std::env::var_os("XDG_RUNTIME_DIR").map_or_else(|| PathBuf::from("/run"), PathBuf::from);
    base.join("evfocus").join("socket")
}

/// `$STATE_DIRECTORY` (set by systemd), else `evfocus` in `$XDG_STATE_HOME` or `~/.local/state`, else `/var/lib/evfocus`.
pub fn default_state_dir() -> PathBuf {
    let in_home = || Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/state"));
    if let Some(systemd) = std::env::var_os("STATE_DIRECTORY") {
        return PathBuf::from(systemd);
    }
    let base = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(in_home);
    base.map_or_else(|| PathBuf::from("/var/lib/evfocus"), |base| base.join("evfocus"))
}

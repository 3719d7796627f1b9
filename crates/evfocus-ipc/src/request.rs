//! The methods of the interface, typed: what a call asks for, and what a reply says.

use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::{
    Calibration, Device, Error, FocusRequest, FocusWindow, LensRange, Mode, PauseWhen, Progress, Report,
    Status,
};

/// Longest part of a wrong argument that is quoted back, in characters.
const QUOTED_CHARS: usize = 100;

/// A call of one of the interface's methods.
#[derive(Debug, Clone, PartialEq)]
pub enum Request {
    /// What is the daemon doing?
    GetStatus,
    /// Start a focus run, or follow the one under way.
    Focus(FocusRequest),
    /// Stop the run under way, and the lens.
    Abort,
    /// Move the lens.
    MoveTo {
        /// Where to, in counts.
        position: f64,
    },
    /// Measure the lens.
    Calibrate,
    /// Change the mode.
    SetMode {
        /// The new mode.
        mode: Mode,
    },
    /// Pause continuous mode.
    Pause {
        /// At once if absent.
        when: Option<PauseWhen>,
    },
    /// Go on with continuous mode.
    Resume,
    /// Follow the status.
    Monitor,
    /// Read a report.
    GetReport {
        /// The run; the last one if absent.
        id: Option<u64>,
    },
    /// Which devices are there?
    ListDevices {
        /// Free serial ports to ask what answers there: all that are on USB if empty; absent: none.
        probe: Option<Vec<String>>,
    },
    /// Read the configuration anew.
    Reload,
}

/// What a call of one of the interface's methods is answered with.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Reply {
    /// To `GetStatus` and `Monitor`.
    Status {
        /// The daemon at one moment.
        status: Arc<Status>,
    },
    /// To `Focus`.
    Progress {
        /// News of the run.
        progress: Arc<Progress>,
    },
    /// To `GetReport`.
    Report {
        /// The report.
        report: Box<Report>,
    },
    /// To `ListDevices`.
    Devices {
        /// The cameras and lenses.
        devices: Vec<Device>,
    },
    /// To `Calibrate`.
    Calibration {
        /// What was measured.
        calibration: Box<Calibration>,
    },
    /// To `Abort`.
    Aborted {
        /// The run that was stopped; nothing if none was under way.
        run_id: Option<u64>,
    },
    /// To `Reload`.
    Reloaded {
        /// The settings that have changed and hold from now on.
        applied: Vec<String>,
        /// The settings that have changed and hold after a restart.
        needs_restart: Vec<String>,
    },
    /// To the methods without results.
    Done {},
}

impl Request {
    /// The names of the interface's methods.
    pub const NAMES: [&str; 12] = [
        "GetStatus",
        "Focus",
        "Abort",
        "MoveTo",
        "Calibrate",
        "SetMode",
        "Pause",
        "Resume",
        "Monitor",
        "GetReport",
        "ListDevices",
        "Reload",
    ];

    /// The method called `name` with `parameters`; nothing if there is no such method.
    pub(crate) fn parse(name: &str, parameters: Map<String, Value>) -> Option<Result<Self, Error>> {
        let mut arguments = Arguments(parameters);
        let request = match name {
            "GetStatus" => Ok(Self::GetStatus),
            "Focus" => arguments.focus_request().map(Self::Focus),
            "Abort" => Ok(Self::Abort),
            "MoveTo" => arguments.take("position").map(|position| Self::MoveTo { position }),
            "Calibrate" => Ok(Self::Calibrate),
            "SetMode" => arguments.take("mode").map(|mode| Self::SetMode { mode }),
            "Pause" => arguments.take("when").map(|when| Self::Pause { when }),
            "Resume" => Ok(Self::Resume),
            "Monitor" => Ok(Self::Monitor),
            "GetReport" => arguments.take("id").map(|id| Self::GetReport { id }),
            "ListDevices" => arguments.take("probe").map(|probe| Self::ListDevices { probe }),
            "Reload" => Ok(Self::Reload),
            _ => return None,
        };
        Some(request.and_then(|request| arguments.finish().map(|()| request)))
    }

    /// The method's name without the interface.
    pub fn name(&self) -> &'static str {
        match self {
            Self::GetStatus => "GetStatus",
            Self::Focus(_) => "Focus",
            Self::Abort => "Abort",
            Self::MoveTo { .. } => "MoveTo",
            Self::Calibrate => "Calibrate",
            Self::SetMode { .. } => "SetMode",
            Self::Pause { .. } => "Pause",
            Self::Resume => "Resume",
            Self::Monitor => "Monitor",
            Self::GetReport { .. } => "GetReport",
            Self::ListDevices { .. } => "ListDevices",
            Self::Reload => "Reload",
        }
    }

    /// Whether it does something, rather than tell.
    pub fn controls(&self) -> bool {
        match self {
            Self::Focus(_)
            | Self::Abort
            | Self::MoveTo { .. }
            | Self::Calibrate
            | Self::SetMode { .. }
            | Self::Pause { .. }
            | Self::Resume
            | Self::Reload
            // Asking a port resets what is on it.
            | Self::ListDevices { probe: Some(_) } => true,
            Self::GetStatus | Self::Monitor | Self::GetReport { .. } | Self::ListDevices { probe: None } => false,
        }
    }

    /// The method's arguments.
    pub(crate) fn parameters(&self) -> Result<Map<String, Value>, serde_json::Error> {
        let value = match self {
            Self::GetStatus | Self::Abort | Self::Calibrate | Self::Resume | Self::Monitor | Self::Reload => {
                return Ok(Map::new());
            }
            Self::Focus(request) => serde_json::to_value(request)?,
            Self::MoveTo { position } => serde_json::json!({ "position": position }),
            Self::SetMode { mode } => serde_json::json!({ "mode": mode }),
            Self::Pause { when } => serde_json::json!({ "when": when }),
            Self::GetReport { id } => serde_json::json!({ "id": id }),
            Self::ListDevices { probe } => serde_json::json!({ "probe": probe }),
        };
        serde_json::from_value(value)
    }
}

/// Arguments that are taken one by one, so that a wrong one can be named.
struct Arguments(Map<String, Value>);

impl Arguments {
    fn focus_request(&mut self) -> Result<FocusRequest, Error> {
        Ok(FocusRequest {
            method: self.take("method")?,
            range: self.take::<Option<LensRange>>("range")?,
            speed: self.take("speed")?,
            speed_counts_per_s: self.take("speed_counts_per_s")?,
            interval_us: self.take("interval_us")?,
            directions: self.take("directions")?,
            windows: self.take::<Option<Vec<FocusWindow>>>("windows")?.unwrap_or_default(),
            prefer: self.take("prefer")?,
        })
    }

    /// The argument `name`; left out is the same as null.
    fn take<Argument: DeserializeOwned>(&mut self, name: &str) -> Result<Argument, Error> {
        let value = self.0.remove(name).unwrap_or(Value::Null);
        serde_json::from_value(value.clone()).map_err(|error| invalid(name, &value, &error.to_string()))
    }

    /// Refuses what is left: a misspelt argument must not be ignored where a lens moves.
    fn finish(self) -> Result<(), Error> {
        match self.0.iter().next() {
            Some((name, value)) => Err(invalid(name, value, "the method has no such argument")),
            None => Ok(()),
        }
    }
}

fn invalid(name: &str, value: &Value, remedy: &str) -> Error {
    let cut = |text: &str| text.chars().take(QUOTED_CHARS).collect::<String>();
    Error::InvalidArgument { name: cut(name), value: cut(&value.to_string()), remedy: cut(remedy) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::WindowUnit;

    fn parse(name: &str, json: &str) -> Result<Request, Error> {
        Request::parse(name, serde_json::from_str(json).unwrap()).unwrap()
    }

    #[test]
    fn requests_survive_the_wire() {
        let range = Some(LensRange { min: 220.0, max: 3750.0 });
        let unit = Some(WindowUnit::Fraction);
        let window = FocusWindow { x: 0.25, y: 0.0, width: 0.5, height: 1.0, unit };
        for request in [
            Request::GetStatus,
            Request::Focus(FocusRequest::default()),
            Request::Focus(FocusRequest { method: Some("egs".into()), range, ..FocusRequest::default() }),
            Request::Focus(FocusRequest {
                speed: Some("fast".into()),
                windows: vec![window],
                prefer: Some("0".into()),
                ..FocusRequest::default()
            }),
            Request::Abort,
            Request::MoveTo { position: 1234.5 },
            Request::Calibrate,
            Request::SetMode { mode: Mode::Manual },
            Request::SetMode { mode: Mode::Continuous },
            Request::Pause { when: None },
            Request::Pause { when: Some(PauseWhen::Deferred) },
            Request::Resume,
            Request::Monitor,
            Request::GetReport { id: Some(7) },
            Request::GetReport { id: None },
            Request::ListDevices { probe: None },
            Request::ListDevices { probe: Some(vec!["/dev/ttyUSB0".into()]) },
        ] {
            let parsed = Request::parse(request.name(), request.parameters().unwrap()).unwrap();
            assert_eq!(parsed, Ok(request));
        }
    }

    #[test]
    fn a_wrong_argument_is_named_and_quoted() {
        for (name, json, argument) in [
            ("MoveTo", r#"{"position": "far"}"#, "position"),
            ("MoveTo", "{}", "position"),
            ("MoveTo", r#"{"position": 3, "speeed": 4}"#, "speeed"),
            ("SetMode", r#"{"mode": "continual"}"#, "mode"),
            ("Pause", r#"{"when": "soon"}"#, "when"),
            ("Focus", r#"{"range": {"min": 1}}"#, "range"),
            ("Focus", r#"{"range": {"min": 1, "max": 2, "step": 3}}"#, "range"),
            ("Focus", r#"{"interval_us": -1}"#, "interval_us"),
            ("Focus", r#"{"speed": 100}"#, "speed"),
            ("Focus", r#"{"windows": "all"}"#, "windows"),
            ("Focus", r#"{"windows": [{"x": 1, "y": 2, "width": 3}]}"#, "windows"),
            ("Focus", r#"{"windows": [{"x": 1, "y": 2, "width": 3, "height": 4, "unit": "mm"}]}"#, "windows"),
            ("Focus", r#"{"prefer": 1}"#, "prefer"),
            ("GetReport", r#"{"id": 1.5}"#, "id"),
            ("GetStatus", r#"{"verbose": true}"#, "verbose"),
        ] {
            match parse(name, json) {
                Err(Error::InvalidArgument { name: wrong, .. }) => {
                    assert_eq!(wrong, argument, "{name}({json})");
                }
                other => panic!("{name}({json}): {other:?}"),
            }
        }
        let long = format!(r#"{{"position": "{}"}}"#, "x".repeat(10_000));
        assert!(parse("MoveTo", &long).unwrap_err().to_string().len() < 400);
    }

    #[test]
    fn the_list_of_names_is_complete() {
        for name in Request::NAMES {
            assert!(Request::parse(name, Map::new()).is_some(), "{name}");
        }
        assert!(Request::parse("Fokus", Map::new()).is_none());
    }
}

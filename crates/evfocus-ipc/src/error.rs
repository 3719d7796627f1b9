//! The typed errors of the interface, and those of Varlink itself.

use serde::{Deserialize, Serialize};

use crate::{DeviceRole, Mode};

/// Why a call was refused. Each says what is wrong and what to do about it.
///
/// A focus run that fails is not one of these: the call succeeded, and the report says how the run ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "error", content = "parameters")]
pub enum Error {
    /// A run is under way: one with other parameters, or one that needs the lens.
    #[error("run {run_id} is under way; wait for its end, or abort it first")]
    #[serde(rename = "org.evfocus.Controller.Busy")]
    Busy {
        /// The run under way.
        run_id: u64,
    },
    /// The call makes no sense in the present mode.
    #[error("the mode is {mode}; set it to {needed} first")]
    #[serde(rename = "org.evfocus.Controller.WrongMode")]
    WrongMode {
        /// The present mode.
        mode: Mode,
        /// The mode in which the call is possible.
        needed: Mode,
    },
    /// The configuration or the operating system forbids it.
    #[error("{what} is not permitted: {remedy}")]
    #[serde(rename = "org.evfocus.Controller.NotPermitted")]
    NotPermitted {
        /// What was tried.
        what: String,
        /// What to change.
        remedy: String,
    },
    /// The camera or the lens is not there.
    #[error("no {}: {remedy}", match role { DeviceRole::Camera => "camera", DeviceRole::Lens => "lens" })]
    #[serde(rename = "org.evfocus.Controller.NoSuchDevice")]
    NoSuchDevice {
        /// Which one is missing.
        role: DeviceRole,
        /// What was looked for, and what to do.
        remedy: String,
    },
    /// A number outside of what is possible.
    #[error("{what} is {value}; it must be from {min} to {max}")]
    #[serde(rename = "org.evfocus.Controller.OutOfRange")]
    OutOfRange {
        /// The argument.
        what: String,
        /// Its value.
        value: f64,
        /// The least possible value.
        min: f64,
        /// The greatest possible value.
        max: f64,
    },
    /// There is no such search.
    #[error("no focus method is called {given:?}; there are {}", known.join(", "))]
    #[serde(rename = "org.evfocus.Controller.UnknownMethod")]
    UnknownMethod {
        /// The name given.
        given: String,
        /// The names that there are.
        known: Vec<String>,
    },
    /// An argument of the wrong type, or one that the method does not have.
    #[error("argument {name} = {value}: {remedy}")]
    #[serde(rename = "org.evfocus.Controller.InvalidArgument")]
    InvalidArgument {
        /// The argument.
        name: String,
        /// Its value as JSON, cut off if long.
        value: String,
        /// What is expected.
        remedy: String,
    },
    /// There is no report of that run.
    #[error("{}", match id {
        Some(id) => format!("there is no report of run {id}: it never was, or its report has been deleted"),
        None => "no run has ended yet, so there is no report".to_owned(),
    })]
    #[serde(rename = "org.evfocus.Controller.NoSuchReport")]
    NoSuchReport {
        /// The run asked for; nothing if the last one was asked for.
        id: Option<u64>,
    },
    /// The camera or the lens failed in the course of the call.
    #[error("{device}: {message}")]
    #[serde(rename = "org.evfocus.Controller.DeviceFailed")]
    DeviceFailed {
        /// The device, model and serial.
        device: String,
        /// What happened, and what to do.
        message: String,
    },
    /// The lens could not be calibrated; it stands still.
    #[error("{reason}: {message}")]
    #[serde(rename = "org.evfocus.Controller.CalibrationFailed")]
    CalibrationFailed {
        /// `aborted`, or what a focus run would call it: `lens-lost`, `lens-fault`, `lens-silent`, `lens-not-moving`,
        /// `lens-wrong-way`, `timed-out`.
        reason: String,
        /// What happened, and what to do.
        message: String,
    },
    /// A report or a recording could not be read or written.
    #[error("{path}: {message}")]
    #[serde(rename = "org.evfocus.Controller.StorageFailed")]
    StorageFailed {
        /// The file.
        path: String,
        /// What happened, and what to do.
        message: String,
    },
    /// The control thread did not answer in time: a fault of the daemon.
    #[error("the control thread has not answered for {waited_s} s; the daemon's log may say why; restart it")]
    #[serde(rename = "org.evfocus.Controller.NotResponding")]
    NotResponding {
        /// Seconds waited.
        waited_s: f64,
    },
    /// The run ended without a report: a fault of the daemon.
    #[error("run {run_id} ended without a report; the daemon's log may say why")]
    #[serde(rename = "org.evfocus.Controller.RunLost")]
    RunLost {
        /// The run.
        run_id: u64,
    },
    /// Too many clients are connected; this connection is closed.
    #[error("{limit} clients are connected and no more are taken; close one and try again")]
    #[serde(rename = "org.evfocus.Controller.TooManyClients")]
    TooManyClients {
        /// How many are taken.
        limit: u64,
    },
    /// The daemon is about to exit.
    #[error("the daemon is shutting down")]
    #[serde(rename = "org.evfocus.Controller.ShuttingDown")]
    ShuttingDown {},
}

/// The errors that every Varlink service knows, of the interface `org.varlink.service`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "error", content = "parameters")]
pub enum ProtocolError {
    /// There is no such interface.
    #[error("the service has no interface {interface}")]
    #[serde(rename = "org.varlink.service.InterfaceNotFound")]
    InterfaceNotFound {
        /// Its name.
        interface: String,
    },
    /// There is no such method.
    #[error("the service has no method {method}")]
    #[serde(rename = "org.varlink.service.MethodNotFound")]
    MethodNotFound {
        /// Its full name.
        method: String,
    },
    /// The interface has the method but the service does not.
    #[error("the service does not implement {method}")]
    #[serde(rename = "org.varlink.service.MethodNotImplemented")]
    MethodNotImplemented {
        /// Its full name.
        method: String,
    },
    /// A parameter is wrong. Of ours, only the methods of `org.varlink.service` and the flag `upgrade` are answered so;
    /// the others say more, with [`Error::InvalidArgument`].
    #[error("the parameter {parameter} is not valid")]
    #[serde(rename = "org.varlink.service.InvalidParameter")]
    InvalidParameter {
        /// Its name.
        parameter: String,
    },
    /// The method only makes sense as a stream.
    #[error("the method replies many times: call it with the flag `more`")]
    #[serde(rename = "org.varlink.service.ExpectedMore")]
    ExpectedMore {},
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn busy_fits_a_motion_as_well_as_a_second_run() {
        let text = Error::Busy { run_id: 3 }.to_string();
        assert_eq!(text, "run 3 is under way; wait for its end, or abort it first");
    }
}

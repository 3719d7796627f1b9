//! The socket of evfocusd: the Varlink interface `org.evfocus.Controller`.
//!
//! [Varlink](https://varlink.org) is JSON objects, each ended by a NUL byte, over a Unix stream socket. The interface is
//! described in `org.evfocus.Controller.varlink` ([`DESCRIPTION`]), which the daemon also serves to any client that asks.
//!
//! - Wire types: [`Status`], [`FocusRequest`], [`Progress`], [`Report`], [`Device`], [`Calibration`], and the typed errors, [`Error`].
//!   [`Report`] is the report file of a run as well. They carry plain numbers with the unit in the name or in the
//!   documentation; the inner crates' types do not appear here.
//! - [`client`]: what the command line uses, and any other Rust program may.
//! - [`server`]: the socket's set-up and a server that survives any client.
//!
//! Not here: what the methods do. That is the daemon's, behind [`server::Service`].

mod calibration;
pub mod client;
mod device;
mod error;
mod focus;
mod frame;
mod message;
mod parts;
mod report;
mod request;
pub mod server;
mod status;
mod sweep;

pub use calibration::{CALIBRATION_FORMAT, Calibration};
pub use device::{Device, DeviceRole, DeviceState};
pub use error::{Error, ProtocolError};
pub use focus::{CurvePoint, FocusRequest, FocusWindow, LensRange, Progress, WindowUnit};
pub use parts::{FocusMap, WindowAnswer};
pub use report::{ClockMap, EventCounts, Outcome, PhaseTiming, REPORT_FORMAT, Report, RigDelay, RunDevices};
pub use request::{Reply, Request};
pub use status::{Grant, LastRun, Mode, PauseState, PauseWhen, Phase, State, Status};
pub use sweep::{Curve, Direction, Estimate, Quality, Structure, Sweep};

/// The name of the interface.
pub const INTERFACE: &str = "org.evfocus.Controller";

/// The interface description, as `org.varlink.service.GetInterfaceDescription` answers it.
pub const DESCRIPTION: &str = include_str!("org.evfocus.Controller.varlink");

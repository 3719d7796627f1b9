//! The evfocus daemon: it reads the camera, polls and moves the lens, feeds the controller, and serves the socket.
//!
//! Not its job: deciding anything about focus (evfocus-core), speaking a device's protocol (the driver crates), or judging results.

pub mod access;
pub mod arguments;
pub mod calibration;
pub mod config;
pub mod daemon;
mod device_list;
pub mod devices;
pub mod doctor;
pub mod handle;
pub mod logging;
mod metrics;
pub mod parts_report;
mod publisher;
mod real_time;
pub mod recorder;
pub mod reload;
pub mod reports;
pub mod rig_delay;
mod serial_ports;
pub mod service;
pub mod storage;
pub mod supervisor;
pub mod sweep_report;
mod threads;
pub mod virtual_rig;
mod vitals;
pub mod windows;
mod wire;

pub use config::{Config, ConfigError};
pub use threads::latency::{Departures, command_latency};
pub use virtual_rig::{VirtualRig, VirtualRigError};

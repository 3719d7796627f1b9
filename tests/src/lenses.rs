//! Each lens driver before the model of its device.

use std::path::Path;

use anyhow::{Context, Result};
use evfocusd::Config;

/// A driver and what its section of the configuration says.
#[derive(Debug, Clone, Copy)]
pub struct EmulatedLens {
    /// As the configuration calls it.
    pub name: &'static str,
    /// What follows `[lens]`.
    pub section: &'static str,
}

/// One of each; all have the range of the simulated lens.
pub const LENSES: [EmulatedLens; 6] = [
    EmulatedLens {
        name: "moonlite",
        section:
            "backend = \"moonlite\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 1
    [lens.moonlite]\nmax_speed_counts_per_s = 1000",
    },
    EmulatedLens {
        name: "optotune",
        section: "backend = \"optotune\"\nport = \"emulated\"\npoll_ms = 1
    [lens.optotune]\nmax_speed_counts_per_s = 1765",
    },
    EmulatedLens {
        name: "grbl",
        section: "backend = \"grbl\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 20",
    },
    EmulatedLens {
        name: "firmata",
        section: "backend = \"firmata\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 2",
    },
    EmulatedLens {
        name: "labjack",
        section: "backend = \"labjack\"\naddress = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 2",
    },
    EmulatedLens {
        name: "indi",
        section: "backend = \"indi\"\naddress = \"emulated\"\npoll_ms = 2
    [lens.indi]\ndevice = \"Focuser\"\nmax_speed_counts_per_s = 1765",
    },
];

/// The simulated rig with the lens of `section`.
///
/// # Errors
/// What is wrong with it.
pub fn config(section: &str, seed: u64) -> Result<Config> {
    Ok(Config::parse(&format!("[simulation]\nseed = {seed}\n[lens]\n{section}"), Path::new("(in the test)"))?)
}

/// The section of the driver `name`.
///
/// # Errors
/// There is no such driver.
pub fn section(name: &str) -> Result<&'static str> {
    let lens = LENSES.iter().find(|lens| lens.name == name);
    Ok(lens.with_context(|| format!("no driver is called {name}"))?.section)
}

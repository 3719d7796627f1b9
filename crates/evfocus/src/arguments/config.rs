//! The daemon's configuration, for commands that open the devices themselves.

use std::path::PathBuf;

use clap::Args;
use evfocusd::{Config, ConfigError};

/// Which configuration.
#[derive(Debug, Clone, Args)]
pub struct ConfigArguments {
    /// The daemon's configuration (TOML), which names camera and lens; without one, the simulated rig
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
}

impl ConfigArguments {
    /// What it says.
    ///
    /// # Errors
    /// [`ConfigError`], naming the file, the key, the value and what it must be.
    pub fn read(&self) -> Result<Config, ConfigError> {
        self.config.as_ref().map_or_else(Config::simulated, |path| Config::read(path))
    }
}

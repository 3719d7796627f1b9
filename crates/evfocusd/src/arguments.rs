//! What `evfocusd` understands on its command line.

use std::path::PathBuf;

use clap::{Parser, Subcommand};

use crate::config::{Config, ConfigError};

/// The evfocus daemon: focuses an event camera.
///
/// Without a configuration it drives a simulated rig. It listens on a Varlink socket (interface org.evfocus.Controller), which
/// `evfocus` and other programs use.
#[derive(Debug, Clone, Parser)]
#[command(name = "evfocusd", version, subcommand_negates_reqs = true, args_conflicts_with_subcommands = true)]
pub struct Arguments {
    /// What to do instead of running.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// The configuration file (TOML); without one, the simulated rig
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Where to listen; default $EVFOCUS_SOCKET, else evfocus/socket in $XDG_RUNTIME_DIR or /run
    #[arg(long, value_name = "PATH")]
    pub socket: Option<PathBuf>,
    /// Where to keep reports; default $STATE_DIRECTORY, else evfocus in $XDG_STATE_HOME or ~/.local/state, else /var/lib/evfocus
    #[arg(long, value_name = "DIR")]
    pub state_dir: Option<PathBuf>,
}

/// What to do instead of running.
#[derive(Debug, Clone, Subcommand)]
pub enum Command {
    /// Check a configuration file and say what is wrong with it
    CheckConfig {
        /// The file
        file: PathBuf,
    },
}

impl Arguments {
    /// The configuration that the arguments ask for.
    ///
    /// # Errors
    /// [`ConfigError`] for the file named with `--config`.
    pub fn configuration(&self) -> Result<Config, ConfigError> {
        let mut config = match &self.config {
            Some(path) => Config::read(path)?,
            None => Config::simulated()?,
        };
        if let Some(socket) = &self.socket {
            config.socket.clone_from(socket);
        }
        if let Some(state_dir) = &self.state_dir {
            config.state_dir.clone_from(state_dir);
        }
        Ok(config)
    }
}

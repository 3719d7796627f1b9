//! `evfocus replay`: the daemon with a recording for a camera.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use evfocus_record::{ReplayEnd, ReplayPace};
use evfocusd::config::CameraConfig;
use evfocusd::{Config, ConfigError, daemon, logging};
use tokio::signal::unix::{SignalKind, signal};

use crate::arguments::ConfigArguments;
use crate::connection::block_on;
use crate::exit::Exit;
use crate::files::must_not_be_folder;

/// Run the daemon with a recording in place of the camera
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  evfocus replay sweep.raw --socket /tmp/replay.sock &
  evfocus watch --socket /tmp/replay.sock

Reads Prophesee RAW (EVT3, EVT2), AEDAT4, CSV and DAVIS346 USB words. The same is the backend \"replay\" of a configuration: \
config/replay.toml has its keys. The lens is the configuration's, and the recording does not know it: this tries out what a stream \
does to the daemon (rates, noise, hot pixels, wraps); focus in a recorded sweep is found by `evfocus analyze`.")]
pub struct Arguments {
    /// The recording
    file: PathBuf,
    /// How fast it is played
    #[arg(long, value_enum, default_value_t = Pace::RealTime)]
    pace: Pace,
    /// What comes after its end: the recording again, or a camera that is gone for a second, and then the recording again
    #[arg(long, value_enum, default_value_t = End::Repeat)]
    end: End,
    /// Where to listen [default: as the configuration says]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Where to keep reports [default: as the configuration says]
    #[arg(long, value_name = "DIR")]
    state_dir: Option<PathBuf>,
    #[command(flatten)]
    config: ConfigArguments,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Pace {
    RealTime,
    Fastest,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum End {
    Repeat,
    Disconnect,
}

impl Arguments {
    /// The configuration, with the recording for a camera.
    fn configuration(&self) -> Result<Config, ConfigError> {
        let mut config = self.config.read()?;
        config.camera = CameraConfig::Replay {
            file: self.file.clone(),
            pace: match self.pace {
                Pace::RealTime => ReplayPace::RealTime,
                Pace::Fastest => ReplayPace::AsFastAsPossible,
            },
            end: match self.end {
                End::Repeat => ReplayEnd::Repeat,
                End::Disconnect => ReplayEnd::Disconnect,
            },
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

/// Runs until it is told to stop.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    must_not_be_folder(&arguments.file, "recording")?;
    let config = arguments.configuration()?;
    logging::start();
    block_on(async {
        let (mut interrupt, mut terminate) =
            (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
        let shutdown = async move {
            tokio::select! {
                _ = interrupt.recv() => {}
                _ = terminate.recv() => {}
            }
        };
        let arguments = arguments.clone();
        daemon::run(config, Box::new(move || arguments.configuration()), || {}, shutdown).await
    })?;
    Ok(Exit::Done)
}

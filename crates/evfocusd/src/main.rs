//! `evfocusd`.

use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;
use evfocusd::access::UnknownName;
use evfocusd::arguments::{Arguments, Command};
use evfocusd::{Config, ConfigError, daemon, logging};
use tokio::signal::unix::{SignalKind, signal};

/// `EX_CONFIG` of sysexits.h: the service manager need not try again.
const BAD_CONFIGURATION: u8 = 78;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match start(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            #[expect(clippy::print_stderr, reason = "the last word of a program that ends")]
            {
                eprintln!("evfocusd: {error:#}");
            }
            if error.is::<ConfigError>() || error.is::<UnknownName>() {
                ExitCode::from(BAD_CONFIGURATION)
            } else {
                ExitCode::FAILURE
            }
        }
    }
}

fn start(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(Command::CheckConfig { file }) = &arguments.command {
        Config::read(file)?;
        #[expect(clippy::print_stdout, reason = "this is what the command is for")]
        {
            println!("{}: good", file.display());
        }
        return Ok(());
    }
    logging::start();
    let config = arguments.configuration()?;
    let runtime =
        tokio::runtime::Builder::new_current_thread().enable_all().build().context("cannot start tokio")?;
    let ended = runtime.block_on(async {
        let (mut terminate, mut interrupt) =
            (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
        let shutdown = async move {
            tokio::select! {
                _ = terminate.recv() => tracing::info!(signal = "SIGTERM", "stopping"),
                _ = interrupt.recv() => tracing::info!(signal = "SIGINT", "stopping"),
            }
        };
        let arguments = arguments.clone();
        daemon::run(config, Box::new(move || arguments.configuration()), || {}, shutdown).await
    });
    // A device call that hangs must not keep the process: it has been named in the error.
    runtime.shutdown_background();
    ended
}

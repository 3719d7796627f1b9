//! `evfocusd`.

use std::process::ExitCode;

use anyhow::Context;
use clap::Parser;
use evfocusd::arguments::{Arguments, Command};
use evfocusd::{Config, daemon, logging};
use tokio::signal::unix::{SignalKind, signal};

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match start(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            #[expect(clippy::print_stderr, reason = "the last word of a program that ends")]
            {
                eprintln!("evfocusd: {error:#}");
            }
            ExitCode::FAILURE
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
        daemon::run(config, || {}, shutdown).await
    });
    // A device call that hangs must not keep the process: it has been named in the error.
    runtime.shutdown_background();
    ended
}

//! A connection to the daemon for one command.

use std::future::Future;

use anyhow::Context;
use evfocus_ipc::client::Client;

use crate::arguments::SocketArguments;

/// Runs `work` to its end on this thread.
pub(crate) fn block_on<T>(work: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.context("cannot set up the socket")?.block_on(work)
}

/// Connects to the daemon that the options name.
pub(crate) async fn connect(arguments: &SocketArguments) -> anyhow::Result<Client> {
    Ok(Client::connect(arguments.path()).await?)
}

//! The server: one task for each connection, so that no client can delay another, and a bound on everything that a
//! client can make grow.
//!
//! What is bounded: the number of connections, the length of a call, the time from a call's first byte to its last, the
//! time that a reply may take to be written. A client that breaks a bound is disconnected. A connection has no queue: the
//! next call is read when the one before has been answered, and a stream's next reply is made when the one before has been
//! written; in between, the kernel's socket buffers hold what they hold.

mod bind;
mod connection;
mod varlink;

use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{UnixListener, UnixStream};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

pub use bind::{BindError, Socket};
pub use connection::{CallError, Stream};
pub use varlink::Info;

use crate::frame::encode;
use crate::{Error, Reply, Request};

/// What the methods do.
pub trait Service: Send + Sync + 'static {
    /// Who is serving, for `org.varlink.service.GetInfo`.
    fn info(&self) -> Info;

    /// Answers a call: with the last reply, or an error. Replies before the last go into `stream`, which is there only if
    /// the caller said `more`.
    ///
    /// It may wait as long as it likes, since only its own connection waits with it. It is dropped at any await when the
    /// server shuts down or the client cannot be written to.
    fn call(
        &self,
        request: Request,
        stream: Option<&mut Stream<'_>>,
    ) -> impl Future<Output = Result<Reply, CallError>> + Send;
}

/// The server's bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// How many clients are served at a time.
    pub clients: usize,
    /// The longest call, in bytes. The longest one that means anything has a few hundred.
    pub call_bytes: usize,
    /// How long a client may take to end a call that it has begun.
    pub call_time: Duration,
    /// How long a reply may take to be written: the patience with a client that does not read.
    pub reply_time: Duration,
    /// How long calls may go on once the server is told to shut down.
    pub grace: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            clients: 64,
            call_bytes: 64 * 1024,
            call_time: Duration::from_secs(10),
            reply_time: Duration::from_secs(5),
            grace: Duration::from_millis(500),
        }
    }
}

/// Serves `service` on `listener` until `shutdown` completes; then takes no more clients, gives the calls under way a
/// moment to end, and hangs up.
pub async fn serve<S: Service>(
    listener: &UnixListener,
    service: Arc<S>,
    limits: Limits,
    shutdown: impl Future<Output = ()>,
) {
    let mut connections = JoinSet::new();
    let mut shutdown = std::pin::pin!(shutdown);
    let mut was_full = false;
    loop {
        tokio::select! {
            () = &mut shutdown => break,
            Some(ended) = connections.join_next() => log_panic(ended),
            accepted = listener.accept() => match accepted {
                Ok((stream, _address)) => {
                    // Those that have hung up meanwhile do not count.
                    while let Some(ended) = connections.try_join_next() {
                        log_panic(ended);
                    }
                    let full = connections.len() >= limits.clients;
                    if full && !was_full {
                        // Once, not for each: a client that tries again and again must not fill the log.
                        tracing::warn!(clients = limits.clients, "too many clients, turning more away");
                    }
                    was_full = full;
                    if full {
                        turn_away(&stream, limits);
                    } else {
                        connections.spawn(connection::run(stream, Arc::clone(&service), limits));
                    }
                }
                Err(error) => {
                    // Mostly too many open files: accepting again at once would spin.
                    tracing::error!(%error, "cannot accept a client");
                    sleep(Duration::from_millis(100)).await;
                }
            },
        }
    }
    let drained = async {
        while let Some(ended) = connections.join_next().await {
            log_panic(ended);
        }
    };
    if timeout(limits.grace, drained).await.is_err() {
        connections.shutdown().await;
    }
}

/// Tells a client that it is one too many, if that can be done at once.
fn turn_away(stream: &UnixStream, limits: Limits) {
    if let Ok(bytes) = encode(&Error::TooManyClients { limit: limits.clients as u64 })
        && let Err(error) = stream.try_write(&bytes)
    {
        tracing::debug!(%error, "could not tell a client that it is one too many");
    }
}

fn log_panic(ended: Result<(), tokio::task::JoinError>) {
    if let Err(error) = ended
        && error.is_panic()
    {
        tracing::error!(%error, "the task of a connection has panicked");
    }
}

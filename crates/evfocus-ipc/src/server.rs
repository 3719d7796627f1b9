//! The server: one task for each connection, so that no client can delay another, and a bound on everything that a
//! client can make grow.
//!
//! What is bounded: the number of connections, of all and of each user, the length of a call, the time from a call's first byte
//! to its last, the time that a reply may take to be written. A client that breaks a bound is disconnected; one that calls too
//! often is served late. A connection has no queue: the
//! next call is read when the one before has been answered, and a stream's next reply is made when the one before has been
//! written; in between, the kernel's socket buffers hold what they hold.

mod bind;
mod connection;
mod peer;
mod rate;
mod varlink;

use std::collections::BTreeMap;
use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::{UnixListener, UnixStream};
use tokio::task::{Id, JoinError, JoinSet};
use tokio::time::{sleep, timeout};

pub use bind::{BindError, Socket};
pub use connection::{CallError, Stream};
pub use peer::Peer;
pub use varlink::Info;

use crate::frame::encode;
use crate::{Error, Reply, Request};

/// What the methods do.
pub trait Service: Send + Sync + 'static {
    /// Who is serving, for `org.varlink.service.GetInfo`.
    fn info(&self) -> Info;

    /// Answers a call of `peer`: with the last reply, or an error. Replies before the last go into `stream`, which is there only if
    /// the caller said `more`.
    ///
    /// It may wait as long as it likes, since only its own connection waits with it. It is dropped at any await when the
    /// server shuts down or the client cannot be written to.
    fn call(
        &self,
        peer: Peer,
        request: Request,
        stream: Option<&mut Stream<'_>>,
    ) -> impl Future<Output = Result<Reply, CallError>> + Send;
}

/// The server's bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limits {
    /// How many clients are served at a time.
    pub clients: usize,
    /// How many of them may belong to one user: nobody can take all places.
    pub clients_of_a_user: usize,
    /// Calls a second of one client; more are answered as late as this demands. A burst of as many is served at once.
    pub calls_per_s: u32,
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
            clients: 96,
            clients_of_a_user: 64,
            calls_per_s: 1000,
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
    let mut connections = Connections::default();
    let mut shutdown = std::pin::pin!(shutdown);
    let mut was_full = false;
    loop {
        tokio::select! {
            () = &mut shutdown => break,
            Some(ended) = connections.tasks.join_next_with_id() => connections.remove(ended),
            accepted = listener.accept() => match accepted.and_then(|(stream, _address)| Ok((Peer::of(&stream)?, stream))) {
                Ok((peer, stream)) => {
                    // Those that have hung up meanwhile do not count.
                    while let Some(ended) = connections.tasks.try_join_next_with_id() {
                        connections.remove(ended);
                    }
                    let full = connections.limit(peer, limits);
                    if let Some(limit) = full && !was_full {
                        // Once, not for each: a client that tries again and again must not fill the log.
                        tracing::warn!(uid = peer.uid, limit, "too many clients, turning more away");
                    }
                    was_full = full.is_some();
                    match full {
                        Some(limit) => turn_away(&stream, limit),
                        None => connections.add(peer, connection::run(stream, peer, Arc::clone(&service), limits)),
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
    let mut connections = connections.tasks;
    let drained = async {
        while let Some(ended) = connections.join_next().await {
            log_panic(ended);
        }
    };
    if timeout(limits.grace, drained).await.is_err() {
        connections.shutdown().await;
    }
}

/// The clients that are served, and whose they are.
#[derive(Debug, Default)]
struct Connections {
    tasks: JoinSet<()>,
    owners: BTreeMap<Id, u32>,
}

impl Connections {
    /// The limit that one more client of `peer`'s user would break.
    fn limit(&self, peer: Peer, limits: Limits) -> Option<usize> {
        let of_the_user = self.owners.values().filter(|uid| **uid == peer.uid).count();
        if self.tasks.len() >= limits.clients {
            Some(limits.clients)
        } else {
            (of_the_user >= limits.clients_of_a_user).then_some(limits.clients_of_a_user)
        }
    }

    fn add(&mut self, peer: Peer, connection: impl Future<Output = ()> + Send + 'static) {
        let task = self.tasks.spawn(connection);
        self.owners.insert(task.id(), peer.uid);
    }

    fn remove(&mut self, ended: Result<(Id, ()), JoinError>) {
        let id = ended.as_ref().map_or_else(JoinError::id, |(id, ())| *id);
        self.owners.remove(&id);
        log_panic(ended);
    }
}

/// Tells a client that it is one too many, if that can be done at once.
fn turn_away(stream: &UnixStream, limit: usize) {
    if let Ok(bytes) = encode(&Error::TooManyClients { limit: limit as u64 })
        && let Err(error) = stream.try_write(&bytes)
    {
        tracing::debug!(%error, "could not tell a client that it is one too many");
    }
}

fn log_panic<Value>(ended: Result<Value, JoinError>) {
    if let Err(error) = ended
        && error.is_panic()
    {
        tracing::error!(%error, "the task of a connection has panicked");
    }
}

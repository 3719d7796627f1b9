//! A service that answers without a daemon behind it.

#![expect(clippy::unwrap_used, clippy::panic, reason = "part of a test")]

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use evfocus_ipc::client::Client;
use evfocus_ipc::server::{self, CallError, Info, Limits, Peer, Service, Socket, Stream};
use evfocus_ipc::{Error, ProtocolError, Reply, Request, Status};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::UnixStream;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

/// Counts what it is asked, and sends statuses of 10 kB as fast as they are taken.
#[derive(Debug, Default)]
pub(crate) struct Plain {
    /// Statuses that were sent into streams.
    pub(crate) sent: AtomicU64,
}

impl Service for Plain {
    fn info(&self) -> Info {
        let text = |text: &str| text.to_owned();
        Info { vendor: text("v"), product: text("p"), version: text("1"), url: text("https://example.org") }
    }

    async fn call(
        &self,
        _: Peer,
        request: Request,
        stream: Option<&mut Stream<'_>>,
    ) -> Result<Reply, CallError> {
        match (request, stream) {
            (Request::GetStatus, _) => Ok(Reply::Status { status: Arc::default() }),
            (Request::Monitor, Some(stream)) => {
                let status = Arc::new(Status { fault: Some("x".repeat(10_000)), ..Status::default() });
                loop {
                    stream.send(&Reply::Status { status: Arc::clone(&status) }).await?;
                    self.sent.fetch_add(1, Ordering::Relaxed);
                    tokio::task::yield_now().await;
                }
            }
            (Request::Monitor, None) => Err(ProtocolError::ExpectedMore {}.into()),
            (Request::Abort, _) => Ok(Reply::Aborted { run_id: None }),
            (Request::MoveTo { position }, _) => {
                Err(Error::OutOfRange { what: "position".into(), value: position, min: 0.0, max: 1.0 }.into())
            }
            // Never answered.
            (Request::Focus(_), _) => std::future::pending().await,
            (
                Request::SetMode { .. }
                | Request::Pause { .. }
                | Request::Resume
                | Request::GetReport { .. }
                | Request::ListDevices { .. }
                | Request::Calibrate
                | Request::Reload,
                _,
            ) => Ok(Reply::Done {}),
        }
    }
}

/// A served socket.
pub(crate) struct Served {
    pub(crate) path: PathBuf,
    pub(crate) service: Arc<Plain>,
    pub(crate) server: JoinHandle<()>,
    /// Dropping it ends the server.
    pub(crate) shutdown: Option<oneshot::Sender<()>>,
    _directory: tempfile::TempDir,
}

/// Short times, so that a test of them ends soon.
pub(crate) fn limits() -> Limits {
    Limits {
        clients: 8,
        call_time: Duration::from_millis(200),
        reply_time: Duration::from_millis(200),
        ..Limits::default()
    }
}

pub(crate) fn serve(limits: Limits) -> Served {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("evfocus.sock");
    let socket = Socket::bind(&path).unwrap();
    let service = Arc::new(Plain::default());
    let (shutdown, told) = oneshot::channel::<()>();
    let serving = Arc::clone(&service);
    let server = tokio::spawn(async move {
        let until = async {
            let _closed = told.await;
        };
        server::serve(socket.listener(), serving, limits, until).await;
    });
    Served { path, service, server, shutdown: Some(shutdown), _directory: directory }
}

impl Served {
    pub(crate) async fn client(&self) -> Client {
        Client::connect(&self.path).await.unwrap()
    }
}

/// A connection that has said `bytes`.
pub(crate) async fn say(path: &Path, bytes: &[u8]) -> UnixStream {
    let mut stream = UnixStream::connect(path).await.unwrap();
    stream.write_all(bytes).await.unwrap();
    stream
}

/// All that comes until the other side hangs up.
pub(crate) async fn hear(stream: &mut UnixStream) -> String {
    let mut heard = Vec::new();
    match stream.read_to_end(&mut heard).await {
        Ok(_) => {}
        // What had not been read when the other side closed.
        Err(error) if error.kind() == std::io::ErrorKind::ConnectionReset => {}
        Err(error) => panic!("{error}"),
    }
    String::from_utf8(heard).unwrap()
}

/// One message.
pub(crate) async fn hear_one(stream: &mut UnixStream) -> serde_json::Value {
    let mut heard = Vec::new();
    loop {
        match stream.read_u8().await.unwrap() {
            0 => return serde_json::from_slice(&heard).unwrap(),
            byte => heard.push(byte),
        }
    }
}

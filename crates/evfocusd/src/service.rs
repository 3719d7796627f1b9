//! The methods of the socket, on top of a [`Handle`]. What Varlink is, and what a client may do to us, is the business of
//! [`evfocus_ipc::server`]; what focusing is, that of the control thread.

mod stream;

use std::future::Future;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::controller::Pause;
use evfocus_ipc::server::{self, CallError, Info, Limits, Peer, Service, Socket, Stream};
use evfocus_ipc::{Calibration, Error, FocusRequest, PauseWhen, ProtocolError, Reply, Request};
use tokio::sync::oneshot;
use tokio::time::timeout;

use crate::handle::{Answer, Command, Handle, Reloaded};

/// How long the control thread has for an answer. It needs about a millisecond; a clock is the only one that can tell
/// that it has stopped.
const ANSWER_TIME: Duration = Duration::from_secs(2);

/// Serves `handle` on `socket` until `shutdown` completes. The socket's file is gone when this returns.
///
/// Needs a tokio runtime with time and input/output; a current-thread one will do.
pub async fn serve(socket: Socket, handle: Handle, limits: Limits, shutdown: impl Future<Output = ()>) {
    server::serve(socket.listener(), Arc::new(Controller { handle }), limits, shutdown).await;
}

#[derive(Debug)]
struct Controller {
    handle: Handle,
}

impl Service for Controller {
    fn info(&self) -> Info {
        Info {
            vendor: "evfocus".to_owned(),
            product: "evfocusd".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            url: env!("CARGO_PKG_REPOSITORY").to_owned(),
        }
    }

    async fn call(
        &self,
        peer: Peer,
        request: Request,
        stream: Option<&mut Stream<'_>>,
    ) -> Result<Reply, CallError> {
        if request.controls() {
            self.handle.access.borrow().check(peer, request.name())?;
        }
        match request {
            Request::GetStatus => Ok(Reply::Status { status: Arc::clone(&self.handle.status.borrow()) }),
            Request::Focus(request) => self.focus(request, stream).await,
            Request::Abort => {
                let run_id = self.command(|answer| Command::Abort { answer }).await?;
                Ok(Reply::Aborted { run_id })
            }
            Request::MoveTo { position } => {
                self.command(|answer| Command::MoveTo { position, answer }).await?;
                Ok(Reply::Done {})
            }
            Request::Calibrate => Ok(Reply::Calibration { calibration: Box::new(self.calibrate().await?) }),
            Request::SetMode { mode } => {
                self.command(|answer| Command::SetMode { mode, answer }).await?;
                Ok(Reply::Done {})
            }
            Request::Pause { when } => {
                let pause = match when.unwrap_or_default() {
                    PauseWhen::Immediate => Pause::Immediate,
                    PauseWhen::Deferred => Pause::Deferred,
                };
                self.command(|answer| Command::Pause { pause, answer }).await?;
                Ok(Reply::Done {})
            }
            Request::Resume => {
                self.command(|answer| Command::Pause { pause: Pause::Resume, answer }).await?;
                Ok(Reply::Done {})
            }
            Request::Monitor => match stream {
                Some(stream) => stream::status(self.handle.status.clone(), stream).await,
                None => Err(ProtocolError::ExpectedMore {}.into()),
            },
            Request::GetReport { id } => {
                let lookups = Arc::clone(&self.handle.lookups);
                let report = aside(move || lookups.report(id)).await?;
                Ok(Reply::Report { report: Box::new(report) })
            }
            Request::ListDevices { probe } => {
                let lookups = Arc::clone(&self.handle.lookups);
                Ok(Reply::Devices { devices: aside(move || lookups.devices(probe.as_deref())).await? })
            }
            Request::Reload => {
                let lookups = Arc::clone(&self.handle.lookups);
                let Reloaded { applied, needs_restart } = aside(move || lookups.reload()).await?;
                Ok(Reply::Reloaded { applied, needs_restart })
            }
        }
    }
}

impl Controller {
    async fn focus(
        &self,
        request: FocusRequest,
        stream: Option<&mut Stream<'_>>,
    ) -> Result<Reply, CallError> {
        // Listen first, so that nothing of the run is missed.
        let progress = self.handle.progress.upgrade().ok_or(Error::ShuttingDown {})?.subscribe();
        let run_id = self.command(|answer| Command::Focus { request, answer }).await?;
        stream::progress(progress, run_id, stream).await
    }

    /// Waits for as long as it takes, for as long as the control thread is there.
    async fn calibrate(&self) -> Result<Calibration, Error> {
        let (answer, answered) = oneshot::channel();
        let sent = self.handle.commands.send(Command::Calibrate { answer }).await;
        sent.map_err(|_| Error::ShuttingDown {})?;
        answered.await.map_err(|_| Error::ShuttingDown {})?
    }

    /// Hands a command to the control thread and waits for its answer, but not for ever.
    async fn command<Value>(&self, command: impl FnOnce(Answer<Value>) -> Command) -> Result<Value, Error> {
        let (answer, answered) = oneshot::channel();
        let exchange = async {
            self.handle.commands.send(command(answer)).await.map_err(|_| Error::ShuttingDown {})?;
            answered.await.map_err(|_| Error::ShuttingDown {})?
        };
        timeout(ANSWER_TIME, exchange).await.unwrap_or_else(|_elapsed| {
            tracing::error!(waited = ?ANSWER_TIME, "the control thread does not answer");
            Err(Error::NotResponding { waited_s: ANSWER_TIME.as_secs_f64() })
        })
    }
}

/// Runs what may block on a thread of its own.
async fn aside<Value: Send + 'static>(
    lookup: impl FnOnce() -> Result<Value, Error> + Send + 'static,
) -> Result<Value, Error> {
    match tokio::task::spawn_blocking(lookup).await {
        Ok(value) => value,
        Err(error) => {
            tracing::error!(%error, "a lookup has panicked");
            Err(Error::ShuttingDown {})
        }
    }
}

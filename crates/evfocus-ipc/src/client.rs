//! A client: connects with errors that say what to do, calls the methods, follows runs and the status.

mod error;
mod follow;
mod results;

use std::path::Path;
use std::time::Duration;

use serde::de::DeserializeOwned;
use tokio::io::AsyncWriteExt;
use tokio::net::UnixStream;
use tokio::net::unix::{OwnedReadHalf, OwnedWriteHalf};
use tokio::time::timeout;

pub use error::ClientError;
pub use follow::{Following, News};
pub use results::Reloaded;

use crate::frame::{FrameReader, encode};
use crate::message::{Call, Incoming};
use crate::{
    Calibration, Device, FocusRequest, INTERFACE, Mode, PauseWhen, Progress, Report, Request, Status,
};

/// The longest reply taken, in bytes: far above any report, far below any memory.
const REPLY_BYTES: usize = 64 * 1024 * 1024;

/// How long to wait for the reply to a call that the daemon answers at once. It gives the control thread two seconds.
const PATIENCE: Duration = Duration::from_secs(10);

/// A connection to the daemon. A Varlink connection does one thing at a time: while one follows a run, another is needed
/// to abort it.
#[derive(Debug)]
pub struct Client {
    reader: FrameReader<OwnedReadHalf>,
    writer: OwnedWriteHalf,
}

impl Client {
    /// Connects to the daemon's socket.
    ///
    /// # Errors
    /// One variant for each thing to do about it, see [`ClientError`].
    pub async fn connect(path: impl AsRef<Path>) -> Result<Self, ClientError> {
        let path = path.as_ref();
        let stream = UnixStream::connect(path).await.map_err(|error| ClientError::connecting(path, error))?;
        let (reader, writer) = stream.into_split();
        Ok(Self { reader: FrameReader::new(reader, REPLY_BYTES, None), writer })
    }

    /// What the daemon is doing.
    pub async fn status(&mut self) -> Result<Status, ClientError> {
        Ok(self.call::<results::OfStatus>(&Request::GetStatus).await?.status)
    }

    /// Starts a run, or finds the one under way, and follows it. A refusal comes as the first of the news.
    pub async fn focus(self, request: &FocusRequest) -> Result<Following<Progress>, ClientError> {
        self.follow(&Request::Focus(request.clone())).await
    }

    /// Starts a run, or finds the one under way, and waits for its report, however long that takes.
    pub async fn focus_and_wait(self, request: &FocusRequest) -> Result<Report, ClientError> {
        let mut run = self.focus(request).await?;
        while let Some(progress) = run.next().await? {
            if let Some(report) = progress.report {
                return Ok(report);
            }
        }
        Err(ClientError::Malformed { message: "the run ended without a report".to_owned() })
    }

    /// Stops the run under way and the lens. Says which run that was.
    pub async fn abort(&mut self) -> Result<Option<u64>, ClientError> {
        Ok(self.call::<results::OfAbort>(&Request::Abort).await?.run_id)
    }

    /// Starts to move the lens to `position` counts.
    pub async fn move_to(&mut self, position: f64) -> Result<(), ClientError> {
        self.call::<results::Nothing>(&Request::MoveTo { position }).await.map(drop)
    }

    /// Measures the lens, however long that takes: its way there and back, and two focus runs.
    pub async fn calibrate(&mut self) -> Result<Calibration, ClientError> {
        self.send(&Request::Calibrate, false).await?;
        let (results, _continues): (results::OfCalibrate, bool) = self.receive().await?;
        Ok(results.calibration)
    }

    /// Changes the mode.
    pub async fn set_mode(&mut self, mode: Mode) -> Result<(), ClientError> {
        self.call::<results::Nothing>(&Request::SetMode { mode }).await.map(drop)
    }

    /// Pauses continuous mode.
    pub async fn pause(&mut self, when: PauseWhen) -> Result<(), ClientError> {
        self.call::<results::Nothing>(&Request::Pause { when: Some(when) }).await.map(drop)
    }

    /// Goes on with continuous mode.
    pub async fn resume(&mut self) -> Result<(), ClientError> {
        self.call::<results::Nothing>(&Request::Resume).await.map(drop)
    }

    /// Follows the status: now, whenever it changes, and once a second if it does not. A change of the lens's position or of
    /// the lost events alone is told at most ten times a second, one of the event rate alone with the next second.
    pub async fn monitor(self) -> Result<Following<Status>, ClientError> {
        self.follow(&Request::Monitor).await
    }

    /// The report of run `id`, or the last one.
    pub async fn report(&mut self, id: Option<u64>) -> Result<Report, ClientError> {
        Ok(self.call::<results::OfReport>(&Request::GetReport { id }).await?.report)
    }

    /// The cameras and lenses in use, attached or configured.
    pub async fn devices(&mut self) -> Result<Vec<Device>, ClientError> {
        Ok(self.call::<results::OfDevices>(&Request::ListDevices { probe: None }).await?.devices)
    }

    /// The same, and what answers on the free serial ports `probe`, on those on USB if there are none; takes up to 8 s a port.
    pub async fn devices_asked(&mut self, probe: Vec<String>) -> Result<Vec<Device>, ClientError> {
        self.send(&Request::ListDevices { probe: Some(probe) }, false).await?;
        let (results, _continues): (results::OfDevices, bool) = self.receive().await?;
        Ok(results.devices)
    }

    /// Has the daemon read its configuration anew.
    pub async fn reload(&mut self) -> Result<Reloaded, ClientError> {
        self.call(&Request::Reload).await
    }

    async fn call<Results: DeserializeOwned>(&mut self, request: &Request) -> Result<Results, ClientError> {
        let exchange = async {
            self.send(request, false).await?;
            self.receive().await
        };
        let (results, _continues) =
            timeout(PATIENCE, exchange).await.map_err(|_| ClientError::NoAnswer { waited: PATIENCE })??;
        Ok(results)
    }

    async fn follow<Item: News>(mut self, request: &Request) -> Result<Following<Item>, ClientError> {
        self.send(request, true).await?;
        Ok(Following::new(self))
    }

    async fn send(&mut self, request: &Request, more: bool) -> Result<(), ClientError> {
        let call = Call {
            method: format!("{INTERFACE}.{}", request.name()),
            parameters: Some(request.parameters()?),
            more,
            oneway: false,
            upgrade: false,
        };
        match self.writer.write_all(&encode(&call)?).await {
            // A daemon that closes the connection may have said why: that is found by reading.
            Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(ClientError::Io(error)),
            _ => Ok(()),
        }
    }

    /// One reply, and whether more follow.
    async fn receive<Results: DeserializeOwned>(&mut self) -> Result<(Results, bool), ClientError> {
        let frame = self.reader.next().await?.ok_or(ClientError::Closed)?;
        let incoming: Incoming = serde_json::from_slice(frame)?;
        let continues = incoming.continues;
        match incoming.error.clone() {
            Some(name) => Err(incoming.refusal(&name).into()),
            None => Ok((incoming.results()?, continues)),
        }
    }
}

//! One client: calls are read and answered one after the other until it hangs up or breaks a bound.

use std::io;
use std::sync::Arc;

use serde::Serialize;
use tokio::io::AsyncWriteExt;
use tokio::net::UnixStream;
use tokio::net::unix::OwnedWriteHalf;
use tokio::time::timeout;

use super::rate::Rate;
use super::{Limits, Peer, Service, varlink};
use crate::frame::{FrameError, FrameReader, encode};
use crate::message::{Call, Outgoing};
use crate::{Error, INTERFACE, ProtocolError, Reply, Request};

/// Why a connection is closed from our side.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct Closed(#[from] Reason);

#[derive(Debug, thiserror::Error)]
enum Reason {
    #[error(transparent)]
    Frame(#[from] FrameError),
    #[error("the client sent what is not a Varlink call: {0}")]
    Garbage(#[source] serde_json::Error),
    #[error("the client wants many replies and none: the call is both `more` and `oneway`")]
    ManyAndNone,
    #[error("a reply cannot be encoded: {0}")]
    Encoding(#[source] serde_json::Error),
    #[error("the client has not read a reply of {bytes} bytes within {limit:?}")]
    SlowReader { bytes: usize, limit: std::time::Duration },
    #[error("cannot write: {0}")]
    Write(#[source] io::Error),
}

/// Why a call has no last reply.
#[derive(Debug, thiserror::Error)]
pub enum CallError {
    /// The call is refused, and the caller is told so.
    #[error(transparent)]
    Refused(#[from] Error),
    /// The call is refused as Varlink itself prescribes, and the caller is told so.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The client is gone or does not read; there is nobody to tell.
    #[error(transparent)]
    Closed(#[from] Closed),
}

/// Where the replies before the last one go.
#[derive(Debug)]
pub struct Stream<'a> {
    writer: &'a mut Writer,
}

impl Stream<'_> {
    /// Sends one reply. Waits until it is written, and gives up on a client that does not read.
    ///
    /// # Errors
    /// [`CallError::Closed`]: hand it on, there is nothing else to do.
    pub async fn send(&mut self, reply: &Reply) -> Result<(), CallError> {
        self.writer.reply(reply, true).await.map_err(|reason| CallError::Closed(reason.into()))
    }
}

/// Serves one client.
pub(super) async fn run<S: Service>(stream: UnixStream, peer: Peer, service: Arc<S>, limits: Limits) {
    let (reader, writer) = stream.into_split();
    let mut reader = FrameReader::new(reader, limits.call_bytes, Some(limits.call_time));
    let mut writer = Writer { socket: writer, limits, muted: false };
    match serve(&mut reader, &mut writer, peer, &*service).await {
        Ok(()) => tracing::trace!("a client has hung up"),
        Err(Closed(Reason::Write(error))) => tracing::debug!(%error, "a client has gone away"),
        Err(reason) => tracing::warn!(uid = peer.uid, %reason, "disconnecting a client"),
    }
}

async fn serve<S: Service>(
    reader: &mut FrameReader<tokio::net::unix::OwnedReadHalf>,
    writer: &mut Writer,
    peer: Peer,
    service: &S,
) -> Result<(), Closed> {
    let mut rate = Rate::new(writer.limits.calls_per_s);
    while let Some(frame) = reader.next().await.map_err(Reason::from)? {
        let call: Call = serde_json::from_slice(frame).map_err(Reason::Garbage)?;
        // Varlink excludes the pair. A stream that writes nothing would never learn that its client has gone away.
        if call.more && call.oneway {
            return Err(Reason::ManyAndNone.into());
        }
        writer.muted = call.oneway;
        rate.admit().await;
        match answer(call, writer, peer, service).await {
            Ok(()) => {}
            Err(CallError::Refused(error)) => writer.send(&error).await?,
            Err(CallError::Protocol(error)) => writer.send(&error).await?,
            Err(CallError::Closed(closed)) => return Err(closed),
        }
        // A client with many calls ready must not keep the others waiting.
        tokio::task::yield_now().await;
    }
    Ok(())
}

/// Answers one call up to its last reply.
async fn answer<S: Service>(
    call: Call,
    writer: &mut Writer,
    peer: Peer,
    service: &S,
) -> Result<(), CallError> {
    if call.upgrade {
        return Err(ProtocolError::InvalidParameter { parameter: "upgrade".to_owned() }.into());
    }
    let parameters = call.parameters.unwrap_or_default();
    let (interface, method) = call.method.rsplit_once('.').unwrap_or(("", &call.method));
    match interface {
        varlink::INTERFACE => {
            let results = varlink::call(&call.method, method, &parameters, &service.info())?;
            Ok(writer.reply(&results, false).await.map_err(Closed::from)?)
        }
        INTERFACE => {
            let request = Request::parse(method, parameters)
                .ok_or_else(|| ProtocolError::MethodNotFound { method: call.method.clone() })??;
            let mut stream = Stream { writer };
            let reply = service.call(peer, request, call.more.then_some(&mut stream)).await?;
            Ok(writer.reply(&reply, false).await.map_err(Closed::from)?)
        }
        _ => Err(ProtocolError::InterfaceNotFound { interface: interface.to_owned() }.into()),
    }
}

/// The write half with its bound.
#[derive(Debug)]
struct Writer {
    socket: OwnedWriteHalf,
    limits: Limits,
    /// The call was `oneway`: nothing is answered, not even errors.
    muted: bool,
}

impl Writer {
    async fn reply<Results: Serialize>(
        &mut self,
        parameters: &Results,
        continues: bool,
    ) -> Result<(), Reason> {
        self.send(&Outgoing { parameters, continues }).await
    }

    async fn send<Message: Serialize>(&mut self, message: &Message) -> Result<(), Reason> {
        if self.muted {
            return Ok(());
        }
        let bytes = encode(message).map_err(Reason::Encoding)?;
        let limit = self.limits.reply_time;
        match timeout(limit, self.socket.write_all(&bytes)).await {
            Ok(written) => written.map_err(Reason::Write),
            Err(_) => Err(Reason::SlowReader { bytes: bytes.len(), limit }),
        }
    }
}

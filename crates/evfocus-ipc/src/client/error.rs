//! What can go wrong on the client's side, each with what to do about it.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::frame::FrameError;
use crate::message::Refusal;
use crate::{Error, ProtocolError};

/// Why a call brought no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// There is no socket.
    #[error(
        "there is no socket {0}: is evfocusd running? Start it with `evfocusd --socket {0}`, or name the right socket",
        path.display()
    )]
    NotRunning {
        /// Where it should be.
        path: PathBuf,
    },
    /// There is a socket, but nobody listens.
    #[error(
        "nobody listens on {0}: evfocusd has died and left its socket behind. Start it again with `evfocusd --socket {0}`",
        path.display()
    )]
    Stale {
        /// The socket.
        path: PathBuf,
    },
    /// The socket or a directory above it is closed to this user.
    #[error(
        "no permission to use {}: add yourself to the socket's group (`ls -l` names it; `sudo usermod -aG GROUP $USER`, \
         then log in again)", path.display()
    )]
    PermissionDenied {
        /// The socket.
        path: PathBuf,
    },
    /// Some other trouble with connecting.
    #[error("cannot connect to {}: {source}", path.display())]
    Connect {
        /// The socket.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The daemon hung up.
    #[error("evfocusd has closed the connection; its log may say why")]
    Closed,
    /// The daemon is there and does not answer.
    #[error("evfocusd has not answered for {waited:?}; its log may say why")]
    NoAnswer {
        /// How long it had.
        waited: Duration,
    },
    /// The daemon says no, and why.
    #[error(transparent)]
    Refused(#[from] Error),
    /// The service does not know what we want.
    #[error("{0}; are the client (version {version}) and evfocusd of the same version?", version = env!("CARGO_PKG_VERSION"))]
    Protocol(#[from] ProtocolError),
    /// An answer that is not one.
    #[error(
        "an answer that this client (version {version}) does not understand: {message}; are it and evfocusd of the same \
         version?", version = env!("CARGO_PKG_VERSION")
    )]
    Malformed {
        /// What is wrong with it.
        message: String,
    },
    /// The connection broke.
    #[error("the connection to evfocusd broke: {0}")]
    Io(#[source] io::Error),
}

impl ClientError {
    pub(super) fn connecting(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        let kind = source.kind();
        if kind == io::ErrorKind::NotFound {
            Self::NotRunning { path }
        } else if kind == io::ErrorKind::ConnectionRefused {
            Self::Stale { path }
        } else if kind == io::ErrorKind::PermissionDenied {
            Self::PermissionDenied { path }
        } else {
            Self::Connect { path, source }
        }
    }
}

impl From<FrameError> for ClientError {
    fn from(error: FrameError) -> Self {
        match error {
            FrameError::Io(error) if error.kind() == io::ErrorKind::ConnectionReset => Self::Closed,
            FrameError::Io(error) => Self::Io(error),
            FrameError::TooLong { .. } | FrameError::Truncated | FrameError::TooSlow(_) => {
                Self::Malformed { message: error.to_string() }
            }
        }
    }
}

impl From<serde_json::Error> for ClientError {
    fn from(error: serde_json::Error) -> Self {
        Self::Malformed { message: error.to_string() }
    }
}

impl From<Refusal> for ClientError {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::Ours(error) => Self::Refused(error),
            Refusal::Protocol(error) => Self::Protocol(error),
            Refusal::Unknown(message) => Self::Malformed { message },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_trouble_with_connecting_has_its_own_remedy() {
        for (kind, part) in [
            (io::ErrorKind::NotFound, "is evfocusd running?"),
            (io::ErrorKind::ConnectionRefused, "Start it again"),
            (io::ErrorKind::PermissionDenied, "usermod -aG"),
            (io::ErrorKind::TimedOut, "cannot connect"),
        ] {
            let text = ClientError::connecting(Path::new("/run/evfocus/socket"), kind.into()).to_string();
            assert!(text.contains(part) && text.contains("/run/evfocus/socket"), "{kind}: {text}");
        }
    }
}

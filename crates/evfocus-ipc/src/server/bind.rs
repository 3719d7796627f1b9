//! Setting the socket up and taking it away.

use std::fs;
use std::io;
use std::os::unix::fs::{FileTypeExt, MetadataExt, PermissionsExt};
use std::os::unix::net::UnixListener as StdListener;
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use rustix::net::{AddressFamily, SocketAddrUnix, SocketFlags, SocketType, connect, socket_with};
use tokio::net::UnixListener;

/// Owner and group may connect, nobody else: who may connect may move the lens.
const SOCKET_MODE: u32 = 0o660;

/// Why there is no socket.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BindError {
    /// A daemon answers on it.
    #[error("the socket {} is taken by a running daemon; stop that one first, or name another socket", path.display())]
    Taken {
        /// The socket.
        path: PathBuf,
    },
    /// Another daemon is setting up a socket in the same directory at this moment.
    #[error("another daemon is setting up a socket in {} at this moment; try again", path.display())]
    Starting {
        /// The directory.
        path: PathBuf,
    },
    /// The path names something else.
    #[error("{} is there and not a socket; remove it, or name another path for the socket", path.display())]
    NotASocket {
        /// The path.
        path: PathBuf,
    },
    /// The directory is not there.
    #[error(
        "the directory {} for the socket does not exist; create it (systemd does, with RuntimeDirectory=), or name \
         another path for the socket", path.display()
    )]
    NoDirectory {
        /// The directory.
        path: PathBuf,
    },
    /// The directory or an old socket is not ours.
    #[error("no permission to set up the socket {}: {source}; run as its owner, or name another path", path.display())]
    PermissionDenied {
        /// The socket.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Some other trouble.
    #[error("cannot set up the socket {}: {source}", path.display())]
    Io {
        /// The socket.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// The daemon's socket. The file goes away with it, unless another daemon has put its own there meanwhile.
#[derive(Debug)]
pub struct Socket {
    listener: UnixListener,
    /// The file, if it is ours to remove: path, device, inode.
    file: Option<(PathBuf, u64, u64)>,
}

impl Socket {
    /// Makes the socket at `path`, in place of one that a dead daemon has left there.
    ///
    /// Clients find either the old socket or one that works: it gets its permissions under another name first.
    /// Needs a tokio runtime.
    ///
    /// # Errors
    /// One variant for each thing to do about it, see [`BindError`].
    pub fn bind(path: &Path) -> Result<Self, BindError> {
        let failed = |error| failure(path, error);
        let directory = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let lock = match fs::File::open(directory) {
            Ok(lock) => lock,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Err(BindError::NoDirectory { path: directory.to_owned() });
            }
            Err(error) => return Err(failed(error)),
        };
        // Two daemons that find the same dead socket must not both replace it.
        match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => {
                return Err(BindError::Starting { path: directory.to_owned() });
            }
            Err(error) => return Err(failed(error.into())),
        }
        refuse_if_in_use(path)?;

        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(".new");
        let unfinished = directory.join(name);
        remove_if_there(&unfinished).map_err(failed)?;
        let listener = StdListener::bind(&unfinished).map_err(failed)?;
        let finish = || {
            fs::set_permissions(&unfinished, fs::Permissions::from_mode(SOCKET_MODE))?;
            fs::rename(&unfinished, path)?;
            listener.set_nonblocking(true)?;
            fs::metadata(path)
        };
        let metadata = finish().map_err(|error| {
            // The first error is the one to report.
            drop(remove_if_there(&unfinished));
            failed(error)
        })?;
        let file = Some((path.to_owned(), metadata.dev(), metadata.ino()));
        Ok(Self { listener: UnixListener::from_std(listener).map_err(failed)?, file })
    }

    /// A socket that somebody else has set up and will take away: systemd, in socket activation. Needs a tokio runtime.
    pub fn inherited(listener: StdListener) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self { listener: UnixListener::from_std(listener)?, file: None })
    }

    /// What [`serve`](super::serve) takes.
    pub fn listener(&self) -> &UnixListener {
        &self.listener
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        let Some((path, device, inode)) = &self.file else { return };
        let ours = fs::symlink_metadata(path).is_ok_and(|file| file.dev() == *device && file.ino() == *inode);
        if ours && let Err(error) = fs::remove_file(path) {
            tracing::warn!(path = %path.display(), %error, "cannot remove the socket");
        }
    }
}

/// Nothing, or a dead socket, may be at `path`.
fn refuse_if_in_use(path: &Path) -> Result<(), BindError> {
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(failure(path, error)),
        Ok(metadata) if !metadata.file_type().is_socket() => {
            return Err(BindError::NotASocket { path: path.to_owned() });
        }
        Ok(_) => {}
    }
    match probe(path) {
        // Would block: its queue of clients is full, so it is alive, if not well.
        Ok(()) | Err(Errno::AGAIN) => Err(BindError::Taken { path: path.to_owned() }),
        Err(Errno::CONNREFUSED) => Ok(()),
        Err(error) => Err(failure(path, error.into())),
    }
}

/// Tries to connect, without waiting.
fn probe(path: &Path) -> Result<(), Errno> {
    let socket = socket_with(
        AddressFamily::UNIX,
        SocketType::STREAM,
        SocketFlags::NONBLOCK | SocketFlags::CLOEXEC,
        None,
    )?;
    connect(&socket, &SocketAddrUnix::new(path)?)
}

fn remove_if_there(path: &Path) -> io::Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

fn failure(path: &Path, source: io::Error) -> BindError {
    let path = path.to_owned();
    if source.kind() == io::ErrorKind::PermissionDenied {
        BindError::PermissionDenied { path, source }
    } else {
        BindError::Io { path, source }
    }
}

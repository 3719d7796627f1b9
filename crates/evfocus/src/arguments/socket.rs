//! Where the daemon is.

use std::path::{Path, PathBuf};

use clap::Args;

/// Where the system's daemon listens, for users who run none of their own.
const SYSTEM_SOCKET: &str = "/run/evfocus/socket";

/// Options of every command that talks to the daemon.
#[derive(Debug, Args)]
pub struct SocketArguments {
    /// The daemon's socket [default: $EVFOCUS_SOCKET, else $XDG_RUNTIME_DIR/evfocus/socket, else /run/evfocus/socket]
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
    /// Print JSON instead of text
    #[arg(long)]
    pub json: bool,
}

impl SocketArguments {
    /// The socket to connect to: where a daemon started by the same user listens, unless only the system's is there.
    pub fn path(&self) -> PathBuf {
        if let Some(socket) = &self.socket {
            return socket.clone();
        }
        let own = evfocusd::config::default_socket();
        let named = std::env::var_os("EVFOCUS_SOCKET").is_some();
        if !named && !own.exists() && Path::new(SYSTEM_SOCKET).exists() {
            return PathBuf::from(SYSTEM_SOCKET);
        }
        own
    }
}

//! A TCP connection.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Transport};

use super::watch::Watch;

const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);
/// Most bytes that are thrown away at once: a peer that never pauses must not hold the lens's thread.
const MOST_DRAINED: usize = 1 << 20;

struct Tcp {
    address: String,
    stream: TcpStream,
    watch: Watch,
    clock: Arc<dyn Clock>,
}

/// Connects to the first of the name's addresses that answers.
pub(super) fn open(address: &str, clock: Arc<dyn Clock>) -> Result<Box<dyn Transport>, DeviceError> {
    let unreachable = |what: String| DeviceError::new(DeviceErrorKind::Disconnected, address, what);
    let candidates = address
        .to_socket_addrs()
        .map_err(|error| unreachable(format!("the address cannot be looked up: {error}; write host:port")))?;
    let mut failure = "the name has no address".to_owned();
    for candidate in candidates {
        match TcpStream::connect_timeout(&candidate, CONNECT_TIMEOUT) {
            Ok(stream) => {
                let ready =
                    stream.set_nodelay(true).and_then(|()| stream.set_write_timeout(Some(WRITE_TIMEOUT)));
                let watch = ready
                    .and_then(|()| Watch::new(stream.as_raw_fd()))
                    .map_err(|error| unreachable(error.to_string()))?;
                return Ok(Box::new(Tcp { address: address.to_owned(), stream, watch, clock }));
            }
            Err(error) => failure = error.to_string(),
        }
    }
    Err(unreachable(format!("cannot connect: {failure}; is the server running, on this port?")))
}

impl Tcp {
    fn lost(&self, doing: &str, error: &impl std::fmt::Display) -> DeviceError {
        let what = format!("cannot {doing}: {error}; has the server gone away?");
        DeviceError::new(DeviceErrorKind::Disconnected, &self.address, what)
    }

    /// What is there.
    fn take(&mut self, buffer: &mut [u8]) -> Result<usize, DeviceError> {
        // The operating system has no timeout of zero; hence the other mode.
        let read = self.stream.set_nonblocking(true).and_then(|()| {
            let read = self.stream.read(buffer);
            self.stream.set_nonblocking(false).and(read)
        });
        match read {
            Ok(0) if !buffer.is_empty() => Err(self.lost("read", &"the peer closed the connection")),
            Ok(length) => Ok(length),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => Ok(0),
            Err(error) => Err(self.lost("read", &error)),
        }
    }
}

impl Transport for Tcp {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        match self.stream.write_all(bytes) {
            Ok(()) => Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                let what = format!("the peer took no bytes for {WRITE_TIMEOUT:?}");
                Err(DeviceError::new(DeviceErrorKind::TimedOut, &self.address, what))
            }
            Err(error) => Err(self.lost("write", &error)),
        }
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        loop {
            let length = self.take(buffer)?;
            let left = deadline.since(self.clock.now());
            if length > 0 || !self.watch.wait(left).map_err(|error| self.lost("read", &error))? {
                return Ok(length);
            }
        }
    }

    fn listen(&mut self, bell: &Bell) {
        if let Err(error) = self.watch.listen(bell) {
            tracing::error!(address = self.address, %error, "orders will wait for the answers to questions");
        }
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        let (mut scrap, mut drained) = ([0; 4096], 0);
        while drained < MOST_DRAINED {
            match self.take(&mut scrap)? {
                0 => break,
                length => drained += length,
            }
        }
        Ok(())
    }
}

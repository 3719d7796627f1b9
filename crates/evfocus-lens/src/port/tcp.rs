//! A TCP connection.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::{Clock, DeviceError, DeviceErrorKind, Transport};

const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);
/// Most bytes that are thrown away at once: a peer that never pauses must not hold the lens's thread.
const MOST_DRAINED: usize = 1 << 20;

struct Tcp {
    address: String,
    stream: TcpStream,
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
                ready.map_err(|error| unreachable(error.to_string()))?;
                return Ok(Box::new(Tcp { address: address.to_owned(), stream, clock }));
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

    /// What is there, after at most `wait`. The operating system has no timeout of zero, and rounds short ones up to its
    /// scheduler's tick, several milliseconds; hence the other mode for no wait.
    fn read_for(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, DeviceError> {
        let read = if wait.is_zero() {
            self.stream.set_nonblocking(true).and_then(|()| {
                let read = self.stream.read(buffer);
                self.stream.set_nonblocking(false).and(read)
            })
        } else {
            self.stream.set_read_timeout(Some(wait)).and_then(|()| self.stream.read(buffer))
        };
        match read {
            Ok(0) if !buffer.is_empty() => Err(self.lost("read", &"the peer closed the connection")),
            Ok(length) => Ok(length),
            Err(error)
                if matches!(
                    error.kind(),
                    ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted
                ) =>
            {
                Ok(0)
            }
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
        let wait = deadline.since(self.clock.now());
        self.read_for(buffer, wait)
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        let (mut scrap, mut drained) = ([0; 4096], 0);
        while drained < MOST_DRAINED {
            match self.read_for(&mut scrap, Duration::ZERO)? {
                0 => break,
                length => drained += length,
            }
        }
        Ok(())
    }
}

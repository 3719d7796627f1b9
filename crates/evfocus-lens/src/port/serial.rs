//! A serial port of the operating system.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::HostMicros;
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Transport};
use serialport::{ClearBuffer, SerialPort, TTYPort};

use super::watch::Watch;

/// How long the line may refuse to take bytes.
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);

struct Serial {
    path: String,
    port: TTYPort,
    watch: Watch,
    clock: Arc<dyn Clock>,
}

/// Opens the port and takes it for this program alone.
pub(crate) fn open(path: &str, baud: u32, clock: Arc<dyn Clock>) -> Result<Box<dyn Transport>, DeviceError> {
    // DTR is left alone: pseudo-terminals have none, and Arduinos reset when it changes.
    let port = serialport::new(path, baud)
        .timeout(WRITE_TIMEOUT)
        .open_native()
        .map_err(|error| explain_open(path, &error))?;
    let watch = Watch::new(port.as_raw_fd()).map_err(|error| {
        DeviceError::new(DeviceErrorKind::Fault, path, format!("cannot be waited for: {error}"))
    })?;
    Ok(Box::new(Serial { path: path.to_owned(), port, watch, clock }))
}

fn explain_open(path: &str, error: &serialport::Error) -> DeviceError {
    // The library has no kind of its own for most of these; the device file tells what its words do not.
    let is_there = std::path::Path::new(path).exists();
    let text = error.to_string();
    let (kind, what) = if !is_there {
        (DeviceErrorKind::Disconnected, format!("there is no such port; {}", ports_that_exist()))
    } else if text.contains("lock") || text.contains("busy") {
        (DeviceErrorKind::Busy, "close the other program; only one can hold a serial port".to_owned())
    } else if text.contains("ermission") {
        let remedy = "let the user that evfocusd runs as into the group that owns the port (dialout on Debian): \
                      usermod --append --groups dialout USER";
        (DeviceErrorKind::PermissionDenied, remedy.to_owned())
    } else {
        (DeviceErrorKind::Disconnected, format!("cannot be opened as a serial port: {text}"))
    };
    DeviceError::new(kind, path, what)
}

fn ports_that_exist() -> String {
    let ports = serialport::available_ports().unwrap_or_default();
    if ports.is_empty() {
        return "this machine has no serial ports; is the lens plugged in?".to_owned();
    }
    let names: Vec<_> = ports.into_iter().map(|port| port.port_name).collect();
    format!("the serial ports of this machine are {}", names.join(", "))
}

impl Serial {
    fn lost(&self, doing: &str, error: &impl std::fmt::Display) -> DeviceError {
        let what = format!("cannot {doing}: {error}; is the cable plugged in?");
        DeviceError::new(DeviceErrorKind::Disconnected, &self.path, what)
    }

    /// What is there.
    fn take(&mut self, buffer: &mut [u8]) -> Result<usize, DeviceError> {
        self.port.set_timeout(Duration::ZERO).map_err(|error| self.lost("read", &error))?;
        match self.port.read(buffer) {
            Ok(0) if !buffer.is_empty() => Err(self.lost("read", &"the port is at its end")),
            Ok(length) => Ok(length),
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => Ok(0),
            Err(error) => Err(self.lost("read", &error)),
        }
    }
}

impl Transport for Serial {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.port.set_timeout(WRITE_TIMEOUT).map_err(|error| self.lost("write", &error))?;
        match self.port.write_all(bytes).and_then(|()| self.port.flush()) {
            Ok(()) => Ok(()),
            Err(error) if error.kind() == ErrorKind::TimedOut => {
                let what = format!("the line took no bytes for {WRITE_TIMEOUT:?}; is flow control on?");
                Err(DeviceError::new(DeviceErrorKind::TimedOut, &self.path, what))
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
            tracing::error!(port = self.path, %error, "orders will wait for the answers to questions");
        }
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        self.port.clear(ClearBuffer::Input).map_err(|error| self.lost("clear the input", &error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_keeps_a_port_from_being_opened_has_its_remedy() {
        let error = |kind, text: &str| explain_open("/dev/null", &serialport::Error::new(kind, text));
        let denied = error(serialport::ErrorKind::Io(ErrorKind::PermissionDenied), "Permission denied");
        assert_eq!(denied.kind, DeviceErrorKind::PermissionDenied);
        assert!(denied.what.contains("dialout") && denied.device == "/dev/null", "{denied}");
        let busy = error(serialport::ErrorKind::NoDevice, "Unable to acquire exclusive lock on serial port");
        assert_eq!(busy.kind, DeviceErrorKind::Busy);
        let other = error(serialport::ErrorKind::Io(ErrorKind::Other), "Not a typewriter");
        assert_eq!(other.kind, DeviceErrorKind::Disconnected);
        let missing = explain_open(
            "/dev/ttyNOBODY",
            &serialport::Error::new(serialport::ErrorKind::NoDevice, "No such file"),
        );
        assert!(missing.what.contains("no such port"), "{missing}");
    }
}

//! A controller's port, within the process.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use evfocus_core::HostMicros;
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Transport};

use super::line::Line;
use super::{Motor, Protocol, WireFault};
use crate::LensConfig;
use crate::lens::LensState;
use crate::random::Stream;

/// A lens controller's port. Clones are handles to the same controller.
#[derive(Clone)]
pub struct WirePort {
    line: Arc<Mutex<Line>>,
    clock: Arc<dyn Clock>,
    name: String,
}

impl std::fmt::Debug for WirePort {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WirePort").field("name", &self.name).finish_non_exhaustive()
    }
}

impl WirePort {
    pub(crate) fn new(protocol: Protocol, motor: Motor, clock: Arc<dyn Clock>) -> Self {
        let line = Arc::new(Mutex::new(Line::new(protocol, motor)));
        Self { line, clock, name: format!("simulated {protocol}") }
    }

    /// A controller with a motor, and no rig around it: nobody looks through its lens.
    pub fn with_a_motor(protocol: Protocol, lens: LensConfig, clock: Arc<dyn Clock>) -> Self {
        let state = LensState::new(lens, &[], Stream::LensReadOut.generator(0));
        let motor = Motor::new(Arc::new(Mutex::new(state)), clock.now());
        Self::new(protocol, motor, clock)
    }

    /// Connects. Bytes take the time that they would take on the real line: the caller waits on the rig's clock.
    ///
    /// # Errors
    /// [`DeviceErrorKind::Disconnected`] while the cable is out.
    pub fn open(&self) -> Result<Box<dyn Transport>, DeviceError> {
        let plug = self.line().plug(self.clock.now()).ok_or_else(|| self.unplugged())?;
        Ok(Box::new(Connection { port: self.clone(), plug, bell: Bell::default() }))
    }

    /// Lets `fault` strike now; it takes the place of one that lasts.
    pub fn strike(&self, fault: WireFault) {
        self.line().strike(fault, self.clock.now());
    }

    /// Ends the fault that lasts.
    pub fn repair(&self) {
        self.line().repair();
    }

    pub(super) fn now(&self) -> HostMicros {
        self.clock.now()
    }

    /// The line; a panic elsewhere leaves it usable, since every operation on it is whole.
    pub(super) fn line(&self) -> MutexGuard<'_, Line> {
        self.line.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn unplugged(&self) -> DeviceError {
        DeviceError::new(DeviceErrorKind::Disconnected, &self.name, "the lens is unplugged")
    }
}

/// An open connection.
struct Connection {
    port: WirePort,
    plug: u32,
    bell: Bell,
}

impl Connection {
    /// The line, if the cable has not been pulled since the connection was opened.
    fn line(&self) -> Result<MutexGuard<'_, Line>, DeviceError> {
        let line = self.port.line();
        if line.plug(self.port.now()) == Some(self.plug) { Ok(line) } else { Err(self.port.unplugged()) }
    }
}

impl Transport for Connection {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        let transfer = self.line()?.transfer(bytes.len());
        self.port.clock.sleep_until(self.port.now() + transfer);
        let now = self.port.now();
        self.line()?.receive(bytes, now);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        loop {
            let now = self.port.now();
            let mut line = self.line()?;
            let length = line.take(buffer, now);
            if length > 0 || now >= deadline || self.bell.rings() {
                return Ok(length);
            }
            let wake = line.next().map_or(deadline, |next| next.min(deadline));
            drop(line);
            self.port.clock.sleep_until(wake);
        }
    }

    fn listen(&mut self, bell: &Bell) {
        self.bell = bell.clone();
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        let (now, mut scrap) = (self.port.now(), [0; 256]);
        let mut line = self.line()?;
        while line.take(&mut scrap, now) > 0 {}
        Ok(())
    }
}

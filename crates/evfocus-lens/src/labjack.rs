//! LabJack T4, T7 and T8 as data acquisition boards, over Modbus TCP: DAC0 is how fast, DAC1 which way, an analog input reads
//! the potentiometer, and the host closes the loop.
//!
//! Each sample is one reading, dated by its question and its answer, and one step of the loop. A lens that is not asked for
//! 20 ms is steered badly. The outputs keep their voltage if the host dies; the motor is stopped when the driver is dropped;
//! against worse, set up the device's own watchdog, or put end switches into the motor's stage.
//!
//! A stop is written before the answer to a reading under way has come; answers carry their question's number. Whether every
//! firmware takes a second question then is not known, so it is written once more after the answer.

pub mod protocol;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensInfo};

use crate::Port;
use crate::drive::DriveConfig;
use crate::line::{Patience, Timed};
use crate::rate_drive::RateDrive;

/// TCP port.
pub const PORT: u16 = 502;

/// An exchange takes 1 ms on Ethernet, 7 ms over WiFi. All attempts together are how long a motor runs on unwatched.
const USUAL: Patience = Patience { timeout: Duration::from_millis(30), attempts: 3 };

/// Steps of a T4's converter, 12 bits; the others have 16 and more.
const FULL_READING: f64 = 4095.0;

/// What the protocol does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabJackConfig {
    /// The analog input of the potentiometer's wiper, 0 to 13.
    pub channel: u8,
    /// The voltage over the potentiometer: that of a full reading.
    pub reference_volts: f64,
    /// The voltage on DAC0 at full drive, up to 5.
    pub full_drive_volts: f64,
    /// The voltage on DAC1 for the positive direction; zero is the other.
    pub direction_volts: f64,
    /// Motor and potentiometer.
    pub drive: DriveConfig,
}

/// A lens behind a LabJack.
#[derive(Debug)]
pub struct LabJack {
    rate: RateDrive,
    config: LabJackConfig,
    serial: String,
    transaction: u16,
    /// What is on the outputs.
    output: [f32; 2],
}

impl LabJack {
    /// Connects, makes sure that it is a LabJack, and stops the motor.
    ///
    /// # Errors
    /// What keeps it from connecting, or that something else answers.
    pub fn open(port: Port, config: LabJackConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut lens = Self {
            rate: RateDrive::new("LabJack", port, config.drive, clock),
            config,
            serial: String::new(),
            transaction: 0,
            output: [0.0; 2],
        };
        lens.ready()?;
        Ok(lens)
    }

    fn ready(&mut self) -> Result<(), DeviceError> {
        if !self.rate.open()? {
            return Ok(());
        }
        let greeted = self.greet();
        self.rate.line.greeted(greeted)
    }

    fn greet(&mut self) -> Result<(), DeviceError> {
        let test = u32::from_be_bytes(self.read(protocol::TEST)?.value);
        if test != protocol::TEST_VALUE {
            let what = format!(
                "its test register reads {test:#010x}, not {:#010x}: this is no LabJack of the T series",
                protocol::TEST_VALUE
            );
            return Err(self.rate.line.error(DeviceErrorKind::Protocol, what));
        }
        self.write([0.0, self.output[1]])?;
        let product = f32::from_be_bytes(self.read(protocol::PRODUCT)?.value);
        self.serial = u32::from_be_bytes(self.read(protocol::SERIAL)?.value).to_string();
        let sample = self.reading()?;
        self.rate.begin_at(&sample, FULL_READING);
        tracing::info!(
            address = self.rate.line.place(), product, serial = self.serial, position = %sample.position, "LabJack"
        );
        Ok(())
    }

    fn next_transaction(&mut self) -> u16 {
        self.transaction = self.transaction.wrapping_add(1);
        self.transaction
    }

    fn read(&mut self, register: u16) -> Result<Timed<[u8; 4]>, DeviceError> {
        let transaction = self.next_transaction();
        let question = protocol::read(transaction, register);
        self.rate.line.ask(&question, USUAL, move |bytes| protocol::value(transaction, bytes))
    }

    fn write(&mut self, volts: [f32; 2]) -> Result<(), DeviceError> {
        let transaction = self.next_transaction();
        let question = protocol::write(transaction, protocol::OUTPUTS, &volts);
        // Even if the answer is missed.
        self.output = volts;
        self.rate.line.hurry(&question)?;
        self.rate.line.ask(&question, USUAL, move |bytes| protocol::written(transaction, bytes))?;
        Ok(())
    }

    fn reading(&mut self) -> Result<LensSample, DeviceError> {
        let Timed { requested, replied, value } = self.read(protocol::input(self.config.channel))?;
        let volts = f64::from(f32::from_be_bytes(value));
        if !volts.is_finite() {
            let what = format!("AIN{} reads {volts} V; is its range set?", self.config.channel);
            return Err(self.rate.line.error(DeviceErrorKind::Fault, what));
        }
        let position = self.config.drive.position(volts / self.config.reference_volts);
        Ok(LensSample { requested, replied, position, moving: false })
    }

    /// Puts `drive`, -1 to 1, on the outputs, if it is another than before.
    fn put_out(&mut self, drive: f64) -> Result<(), DeviceError> {
        let speed = (drive.abs() * self.config.full_drive_volts) as f32;
        let direction = if speed == 0.0 {
            self.output[1]
        } else if drive > 0.0 {
            self.config.direction_volts as f32
        } else {
            0.0
        };
        let volts = [speed, direction];
        if self.output.map(f32::to_bits) == volts.map(f32::to_bits) { Ok(()) } else { self.write(volts) }
    }

    /// Cuts the motor off, whatever was put out before.
    fn cut(&mut self) -> Result<(), DeviceError> {
        self.rate.cut();
        self.write([0.0, self.output[1]])
    }

    fn steer(&mut self) -> Result<LensSample, DeviceError> {
        let sample = self.reading()?;
        let drive = self.rate.step(&sample)?;
        self.put_out(drive)?;
        Ok(LensSample { moving: self.rate.is_moving(), ..sample })
    }
}

impl Lens for LabJack {
    fn info(&self) -> LensInfo {
        self.rate.info(&self.serial)
    }

    fn listen(&mut self, bell: &Bell) {
        self.rate.line.listen(bell);
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        self.rate.check_target(target)?;
        self.ready()?;
        self.rate.aim(target, speed);
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.ready()?;
        self.cut()
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        self.ready()?;
        self.steer().inspect_err(|fault| {
            if !fault.is_interruption()
                && let Err(error) = self.cut()
            {
                tracing::error!(%error, "the motor could not be cut off");
            }
        })
    }
}

impl Drop for LabJack {
    fn drop(&mut self) {
        if self.rate.line.is_open()
            && let Err(error) = self.cut()
        {
            tracing::warn!(%error, "the lens could not be stopped");
        }
    }
}

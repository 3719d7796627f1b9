//! An Arduino with StandardFirmata as a data acquisition board: a PWM and a direction pin drive the lens's motor through an
//! H-bridge, its potentiometer is read by an analog pin, and the host closes the loop.
//!
//! The board streams readings without a time, so each is dated by its arrival less its time on the line. The loop takes a step
//! with each sample that the caller asks for; a lens that is not asked for 20 ms is steered badly, and the board has no
//! watchdog: if the host dies while the motor runs, the PWM stays as it is. The motor is stopped when the driver is dropped;
//! against worse, put end switches or a retriggerable one-shot into the H-bridge's enable line.

pub mod protocol;

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensSample, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, LensInfo};

use crate::Port;
use crate::drive::DriveConfig;
use crate::rate_drive::RateDrive;
use protocol::{Command, Decoder, Message, PinMode};

/// Baud rate of StandardFirmata.
pub const BAUD: u32 = 57_600;

/// Opening the port resets an Arduino, which is deaf for up to 2 s.
const BOOTING: Duration = Duration::from_secs(1);
const ATTEMPTS: u32 = 3;
/// Without a reading for this long the motor is stopped.
const SILENCE: Duration = Duration::from_millis(80);
/// The fastest stream that the firmware makes.
const INTERVAL_MS: u16 = 1;
/// Three bytes on the line.
const TRANSFER: Duration = Duration::from_micros(520);

/// What the protocol does not tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirmataConfig {
    /// The pin of the H-bridge's enable input; it must be able to do PWM.
    pub pwm_pin: u8,
    /// The pin of its direction input.
    pub direction_pin: u8,
    /// The analog channel of the potentiometer's wiper, 0 to 15.
    pub channel: u8,
    /// Motor and potentiometer.
    pub drive: DriveConfig,
}

/// What the board said of itself.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Board {
    full_reading: f64,
    full_duty: f64,
}

/// A lens behind an Arduino with StandardFirmata.
#[derive(Debug)]
pub struct Firmata {
    rate: RateDrive,
    decoder: Decoder,
    config: FirmataConfig,
    board: Board,
    /// What the pins were told last: duty and direction.
    output: (u16, bool),
}

impl Firmata {
    /// Opens the port, makes sure that the board answers and has the pins, stops the motor and starts the readings.
    ///
    /// # Errors
    /// What keeps the port from being opened; that nothing, or something else, answers; that a pin cannot do its work.
    pub fn open(port: Port, config: FirmataConfig, clock: Arc<dyn Clock>) -> Result<Self, DeviceError> {
        let mut lens = Self {
            rate: RateDrive::new("Firmata board", port, config.drive, clock),
            decoder: Decoder::default(),
            config,
            board: Board { full_reading: 1023.0, full_duty: 255.0 },
            output: (0, false),
        };
        lens.ready()?;
        Ok(lens)
    }

    fn ready(&mut self) -> Result<(), DeviceError> {
        if !self.rate.open()? {
            return Ok(());
        }
        self.decoder = Decoder::default();
        let greeted = self.greet();
        self.rate.line.greeted(greeted)
    }

    fn greet(&mut self) -> Result<(), DeviceError> {
        let FirmataConfig { pwm_pin, direction_pin, channel, .. } = self.config;
        let version = self.query(Command::Version, |message| {
            if let Message::Version(major, minor) = message { Some((major, minor)) } else { None }
        })?;
        // Whatever ran before, the motor stands while the rest is found out.
        self.rate.line.send(&Command::Mode(pwm_pin, PinMode::Pwm).encode())?;
        self.set_output(0, false)?;
        let capabilities = self.query(Command::Capabilities, |message| {
            if let Message::Capabilities(pins) = message { Some(pins) } else { None }
        })?;
        let channels = self.query(Command::AnalogMap, |message| {
            if let Message::AnalogMap(channels) = message { Some(channels) } else { None }
        })?;
        let analog_pin =
            channels.iter().position(|&of| of == Some(channel)).and_then(|pin| u8::try_from(pin).ok());
        let full = |bits: u8| f64::from((1_u32 << bits.min(14)) - 1);
        let lacks = |pin: &str, what: &str| {
            self.rate
                .line
                .error(DeviceErrorKind::Fault, format!("{pin} cannot {what} on this board; choose another"))
        };
        let analog_pin = analog_pin.ok_or_else(|| lacks(&format!("channel A{channel}"), "be found"))?;
        let bits = |pin, mode| protocol::resolution(&capabilities, pin, mode);
        let reading_bits = bits(analog_pin, PinMode::Analog)
            .ok_or_else(|| lacks(&format!("channel A{channel}"), "be read"))?;
        let duty_bits =
            bits(pwm_pin, PinMode::Pwm).ok_or_else(|| lacks(&format!("pin {pwm_pin}"), "do PWM"))?;
        bits(direction_pin, PinMode::Output)
            .ok_or_else(|| lacks(&format!("pin {direction_pin}"), "be an output"))?;
        self.board = Board { full_reading: full(reading_bits), full_duty: full(duty_bits) };
        for command in [
            Command::Mode(direction_pin, PinMode::Output),
            Command::Mode(analog_pin, PinMode::Analog),
            Command::SamplingInterval(INTERVAL_MS),
            Command::Report(channel, true),
        ] {
            self.rate.line.send(&command.encode())?;
        }
        let sample = self.reading()?;
        self.rate.begin_at(&sample, self.board.full_reading);
        tracing::info!(
            port = self.rate.line.place(), version = ?version, reading_bits, duty_bits, position = %sample.position, "Firmata board"
        );
        Ok(())
    }

    /// Sends `question` until `pick` finds the answer among the messages.
    fn query<T>(&mut self, question: Command, pick: impl Fn(Message) -> Option<T>) -> Result<T, DeviceError> {
        for _ in 0..ATTEMPTS {
            self.rate.line.drain()?;
            self.rate.line.send(&question.encode())?;
            let deadline = self.rate.line.now() + BOOTING;
            while let Some((message, _)) = self.next(deadline)? {
                if let Some(answer) = pick(message) {
                    return Ok(answer);
                }
                // A stream of readings must not hold this up for ever.
                if self.rate.line.now() >= deadline {
                    break;
                }
            }
        }
        let what = format!(
            "no answer to {question:?} within {BOOTING:?}, asked {ATTEMPTS} times; check the cable, and that the board runs \
             StandardFirmata at {BAUD} baud"
        );
        Err(self.rate.line.error(DeviceErrorKind::TimedOut, what))
    }

    /// The next message and its arrival, or nothing by `deadline`.
    fn next(&mut self, deadline: HostMicros) -> Result<Option<(Message, HostMicros)>, DeviceError> {
        while let Some(byte) = self.rate.line.next_byte(deadline)? {
            if let Some(message) = self.decoder.push(byte) {
                return Ok(Some((message, self.rate.line.now())));
            }
        }
        Ok(None)
    }

    /// The first reading that arrives from now on: those that wait already are old, nobody knows how old.
    fn reading(&mut self) -> Result<LensSample, DeviceError> {
        let called = self.rate.line.now();
        while self.next(called)?.is_some() && self.rate.line.now() < called + SILENCE {}
        let deadline = called + SILENCE;
        while let Some((message, replied)) = self.next(deadline)? {
            if let Message::Analog { channel, value } = message
                && channel == self.config.channel
            {
                // Read in the middle of these two.
                let requested = (replied - 2 * TRANSFER).max(called);
                let position = self.config.drive.position(f64::from(value) / self.board.full_reading);
                return Ok(LensSample { requested, replied, position, moving: false });
            }
            if replied >= deadline {
                break;
            }
        }
        let what = format!(
            "no reading of channel A{} within {SILENCE:?}; the motor is cut off. Was the board reset?",
            self.config.channel
        );
        Err(self.rate.line.error(DeviceErrorKind::TimedOut, what))
    }

    /// Sets the pins; direction first, so that a drive never begins the wrong way.
    fn set_output(&mut self, duty: u16, positive: bool) -> Result<(), DeviceError> {
        let FirmataConfig { pwm_pin, direction_pin, .. } = self.config;
        let mut bytes = Vec::with_capacity(12);
        if positive != self.output.1 {
            bytes.extend(Command::Digital(direction_pin, positive).encode());
        }
        bytes.extend(Command::Pwm(pwm_pin, duty).encode());
        self.rate.line.send(&bytes)?;
        self.output = (duty, positive);
        Ok(())
    }

    /// Sends `drive`, -1 to 1, if it is another than before.
    fn put_out(&mut self, drive: f64) -> Result<(), DeviceError> {
        let duty = (drive.abs() * self.board.full_duty).round() as u16;
        let positive = if duty == 0 { self.output.1 } else { drive > 0.0 };
        if self.output == (duty, positive) { Ok(()) } else { self.set_output(duty, positive) }
    }

    /// Cuts the motor off, whatever was sent before.
    fn cut(&mut self) -> Result<(), DeviceError> {
        self.rate.cut();
        self.set_output(0, self.output.1)
    }

    /// Reads, checks, and takes a step of the loop.
    fn steer(&mut self) -> Result<LensSample, DeviceError> {
        let sample = self.reading()?;
        let drive = self.rate.step(&sample)?;
        self.put_out(drive)?;
        Ok(LensSample { moving: self.rate.is_moving(), ..sample })
    }
}

impl Lens for Firmata {
    fn info(&self) -> LensInfo {
        self.rate.info(self.rate.line.place())
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
        let steered = self.steer();
        if let Err(fault) = &steered
            && !fault.is_interruption()
        {
            if let Err(error) = self.cut() {
                tracing::error!(%error, "the motor could not be cut off");
            }
            if fault.kind == DeviceErrorKind::TimedOut {
                // A board that was reset streams nothing until it is set up again.
                self.rate.line.close();
            }
        }
        steered
    }
}

impl Drop for Firmata {
    fn drop(&mut self) {
        if self.rate.line.is_open()
            && let Err(error) = self.cut()
        {
            tracing::warn!(%error, "the lens could not be stopped");
        }
    }
}

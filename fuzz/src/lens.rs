//! A lens behind a line that spoils what comes over it: the model of its device answers, and the data decide what becomes of that.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensRange, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, Transport, VirtualClock};
use evfocus_lens::Port;
use evfocus_lens::drive::DriveConfig;
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, WirePort};

/// No call of a driver may take longer, opening included: every wait and every number of retries is bounded.
const LONGEST_CALL: Duration = Duration::from_secs(30);
/// Calls of one input.
const CALLS: usize = 64;

type Data = Arc<Mutex<VecDeque<u8>>>;

/// The line.
struct Spoilt {
    inner: Box<dyn Transport>,
    data: Data,
    bell: Bell,
}

fn take(data: &Data) -> Option<u8> {
    data.lock().unwrap().pop_front()
}

fn gone() -> DeviceError {
    DeviceError::new(DeviceErrorKind::Disconnected, "the line", "the data say so")
}

impl Transport for Spoilt {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        self.inner.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        let length = self.inner.read(buffer, deadline)?;
        match take(&self.data) {
            None | Some(0..=127) => Ok(length),
            // Something else comes instead,
            Some(128..=199) => {
                let count = usize::from(take(&self.data).unwrap_or(0)).min(buffer.len());
                let mut came = 0;
                for (place, byte) in
                    buffer.iter_mut().take(count).zip(std::iter::from_fn(|| take(&self.data)))
                {
                    *place = byte;
                    came += 1;
                }
                Ok(came)
            }
            // or a part of it,
            Some(200..=219) => Ok(length.min(usize::from(take(&self.data).unwrap_or(0)))),
            // or a part of it is wrong,
            Some(220..=251) => {
                let (place, change) = (take(&self.data).unwrap_or(0), take(&self.data).unwrap_or(0));
                if let Some(byte) = buffer[..length].get_mut(usize::from(place) % length.max(1)) {
                    *byte ^= change;
                }
                Ok(length)
            }
            // or an order comes before it,
            Some(252..=253) => {
                self.bell.ring();
                Ok(0)
            }
            // or nothing ever again.
            Some(254..) => Err(gone()),
        }
    }

    fn listen(&mut self, bell: &Bell) {
        self.inner.listen(bell);
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        self.inner.drain()
    }
}

/// Opens a lens with `open` behind a spoilt line and calls it as `data` says.
pub fn fuzz<L: Lens>(
    protocol: Protocol,
    data: &[u8],
    open: impl FnOnce(Port, Arc<dyn Clock>) -> Result<L, DeviceError>,
) {
    let clock = Arc::new(VirtualClock::new());
    let shared: Arc<dyn Clock> = clock.clone();
    let wire = WirePort::with_a_motor(protocol, LensConfig::default(), Arc::clone(&shared));
    let data: Data = Arc::new(Mutex::new(data.iter().copied().collect()));
    let (line, bell) = (Arc::clone(&data), Bell::default());
    let rope = bell.clone();
    let connect = move || -> Result<Box<dyn Transport>, DeviceError> {
        Ok(Box::new(Spoilt { inner: wire.open()?, data: Arc::clone(&line), bell: rope.clone() }))
    };
    let began = clock.now();
    let lens = open(Port::new("spoilt", Box::new(connect)), Arc::clone(&shared));
    check_time(began, clock.now(), "opening");
    let Ok(mut lens) = lens else { return };
    lens.listen(&bell);
    for _ in 0..CALLS {
        let Some(call) = take(&data) else { return };
        let began = clock.now();
        bell.hush();
        match call % 8 {
            0..=3 => {
                if let Ok(sample) = lens.sample() {
                    assert!(sample.requested <= sample.replied && sample.replied <= clock.now());
                    assert!(sample.position.0.is_finite(), "{sample:?}");
                }
            }
            4 => {
                let target = 16.0 * f64::from(take(&data).unwrap_or(0));
                let speed = 1.0 + 8.0 * f64::from(take(&data).unwrap_or(0));
                let range = lens.info().range;
                let moved = lens.move_to(LensPosition(target), LensSpeed::new(speed).unwrap());
                assert!(
                    moved.is_err() || range.contains(LensPosition(target)),
                    "{target} outside of {range}"
                );
            }
            5 => drop(lens.stop()),
            6 => drop(lens.home()),
            _ => clock.sleep_until(clock.now() + Duration::from_millis(u64::from(call))),
        }
        check_time(began, clock.now(), "a call");
    }
    drop(lens);
}

fn check_time(began: HostMicros, ended: HostMicros, what: &str) {
    assert!(ended.since(began) < LONGEST_CALL, "{what} took {:?}", ended.since(began));
}

/// Positions of the model's lens.
pub fn range() -> LensRange {
    LensConfig::default().range
}

/// Its full speed.
pub fn speed() -> LensSpeed {
    LensConfig::default().max_speed
}

/// How to steer the model's motor.
pub fn drive() -> DriveConfig {
    DriveConfig {
        range: range(),
        max_speed: speed(),
        acceleration: 4000.0,
        dead_band: 0.12,
        tolerance: 2.0,
        at_zero: 0.0,
        at_full: 4095.0,
        reversed: false,
    }
}

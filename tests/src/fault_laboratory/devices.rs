//! A camera and a lens that fail as their script says, and a witness of what passes through them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;

use evfocus_core::{
    CameraMicros, Event, EventBatch, HostMicros, LARGEST_ADDRESS, LensPosition, LensRange, LensSample,
    LensSpeed, Polarity,
};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind, Lens, LensInfo};
use hil_sim::{SimCamera, SimLens};

/// A fault, and from when to when it lasts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Spell<Kind> {
    /// What.
    pub kind: Kind,
    /// From when.
    pub from: HostMicros,
    /// Until when.
    pub until: HostMicros,
}

pub(super) fn current<Kind: Copy>(script: &[Spell<Kind>], now: HostMicros) -> Option<Kind> {
    script.iter().find(|spell| spell.from <= now && now < spell.until).map(|spell| spell.kind)
}

/// What a camera may do wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum CameraFault {
    /// Every call fails as disconnected, until it is plugged in again.
    Unplugged,
    /// Nothing comes, not even time.
    Silent,
    /// Calls fail, starts succeed: it comes and goes.
    Hiccup,
    /// As many events as fit, at one instant.
    Flood,
    /// Events outside of the sensor.
    Lies,
    /// Its clock runs a tenth too fast.
    ClockRuns,
    /// Its clock is a hundred hours ahead.
    ClockLeaps,
}

/// A hundred hours, microseconds: more than the events of one list may lie apart.
const LEAP_US: i64 = 360_000_000_000;

fn shift_time(batch: &mut EventBatch, shifted: impl Fn(i64) -> i64) {
    let shift = |event: Event| Event { t: CameraMicros(shifted(event.t.0)), ..event };
    replace(batch, |events| events.into_iter().map(shift).collect());
    batch.reached = batch.reached.map(|reached| CameraMicros(shifted(reached.0)));
}

/// What a lens may do wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LensFault {
    /// Every call fails as disconnected.
    Unplugged,
    /// Every call times out; orders do not arrive.
    Silent,
    /// Positions that are none.
    Garbage,
    /// It answers, and does not do what it is told.
    Deaf,
    /// It always says the same position.
    Frozen,
}

impl LensFault {
    /// Whether an order reaches the motor.
    fn obeys(self) -> bool {
        matches!(self, Self::Garbage | Self::Frozen)
    }
}

/// What passed through the devices.
#[derive(Debug)]
pub(super) struct Witness {
    range: LensRange,
    /// Events handed over, and events said to be lost.
    events: AtomicU64,
    lost: AtomicU64,
    /// The lens was told to go where it must not.
    out_of_range: AtomicBool,
    /// An order has not reached the motor since the last one that has.
    unheard: AtomicBool,
}

impl Witness {
    pub(super) fn new(range: LensRange) -> Self {
        Self {
            range,
            events: AtomicU64::new(0),
            lost: AtomicU64::new(0),
            out_of_range: AtomicBool::new(false),
            unheard: AtomicBool::new(false),
        }
    }

    pub(super) fn events_and_lost(&self) -> (u64, u64) {
        (self.events.load(Ordering::Relaxed), self.lost.load(Ordering::Relaxed))
    }

    pub(super) fn was_out_of_range(&self) -> bool {
        self.out_of_range.load(Ordering::Relaxed)
    }

    pub(super) fn has_unheard_order(&self) -> bool {
        self.unheard.load(Ordering::Relaxed)
    }
}

/// The camera.
pub(super) struct FaultyCamera {
    inner: SimCamera,
    script: Vec<Spell<CameraFault>>,
    clock: Arc<dyn Clock>,
    witness: Arc<Witness>,
    /// Camera time so far: events must not go back, whatever the fault.
    reached: CameraMicros,
    /// The flood comes once for each look.
    flooded: HostMicros,
}

impl FaultyCamera {
    pub(super) fn new(
        inner: SimCamera,
        script: Vec<Spell<CameraFault>>,
        clock: Arc<dyn Clock>,
        witness: Arc<Witness>,
    ) -> Self {
        let (reached, flooded) = (CameraMicros(0), HostMicros(i64::MIN));
        Self { inner, script, clock, witness, reached, flooded }
    }

    fn error(kind: DeviceErrorKind) -> DeviceError {
        DeviceError::new(kind, "laboratory camera", "as the script says")
    }

    fn distort(&mut self, fault: CameraFault, now: HostMicros, batch: &mut EventBatch) {
        match fault {
            CameraFault::Flood if self.flooded != now => {
                self.flooded = now;
                let t = batch.events.last().map_or(self.reached, |event| event.t);
                let room = batch.events.room();
                let event = |index: usize| Event {
                    t,
                    x: (index % 48) as u16,
                    y: (index / 48 % 36) as u16,
                    polarity: Polarity::On,
                };
                batch.lost += batch.events.append((0..room.min(20_000)).map(event));
            }
            CameraFault::Lies => {
                let lies = |(index, event): (usize, Event)| Event {
                    x: event.x.wrapping_mul(1 + index as u16) & LARGEST_ADDRESS,
                    y: LARGEST_ADDRESS - event.y,
                    ..event
                };
                replace(batch, |events| events.into_iter().enumerate().map(lies).collect());
            }
            CameraFault::ClockRuns => shift_time(batch, |t| t + t / 10),
            CameraFault::ClockLeaps => shift_time(batch, |t| t + LEAP_US),
            CameraFault::Flood | CameraFault::Unplugged | CameraFault::Silent | CameraFault::Hiccup => {}
        }
    }
}

/// Puts others in the place of a batch's events.
fn replace(batch: &mut EventBatch, others: impl FnOnce(Vec<Event>) -> Vec<Event>) {
    let events = batch.events.to_vec();
    batch.events.clear();
    batch.lost += batch.events.append(others(events));
}

impl Camera for FaultyCamera {
    fn info(&self) -> CameraInfo {
        self.inner.info()
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        match current(&self.script, self.clock.now()) {
            Some(CameraFault::Unplugged) => Err(Self::error(DeviceErrorKind::Disconnected)),
            Some(
                CameraFault::Silent
                | CameraFault::Hiccup
                | CameraFault::Flood
                | CameraFault::Lies
                | CameraFault::ClockRuns
                | CameraFault::ClockLeaps,
            )
            | None => self.inner.start(),
        }
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.inner.stop()
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        let now = self.clock.now();
        let fault = current(&self.script, now);
        match fault {
            Some(CameraFault::Unplugged) => return Err(Self::error(DeviceErrorKind::Disconnected)),
            Some(CameraFault::Hiccup) => return Err(Self::error(DeviceErrorKind::Fault)),
            Some(
                CameraFault::Silent
                | CameraFault::Flood
                | CameraFault::Lies
                | CameraFault::ClockRuns
                | CameraFault::ClockLeaps,
            )
            | None => {}
        }
        self.inner.read(batch, timeout)?;
        if fault == Some(CameraFault::Silent) {
            batch.clear();
            batch.arrival = now;
            return Ok(());
        }
        if let Some(fault) = fault {
            self.distort(fault, now, batch);
        }
        if let Some(event) = batch.events.last() {
            self.reached = event.t;
        }
        self.witness.events.fetch_add(batch.events.len() as u64, Ordering::Relaxed);
        self.witness.lost.fetch_add(batch.lost, Ordering::Relaxed);
        Ok(())
    }
}

/// The lens.
pub(super) struct FaultyLens {
    inner: SimLens,
    script: Vec<Spell<LensFault>>,
    clock: Arc<dyn Clock>,
    witness: Arc<Witness>,
    /// What it said when it froze.
    frozen: Option<LensPosition>,
}

impl FaultyLens {
    pub(super) fn new(
        inner: SimLens,
        script: Vec<Spell<LensFault>>,
        clock: Arc<dyn Clock>,
        witness: Arc<Witness>,
    ) -> Self {
        Self { inner, script, clock, witness, frozen: None }
    }

    /// Passes an order on, or says why not.
    fn order(
        &mut self,
        order: impl FnOnce(&mut SimLens) -> Result<(), DeviceError>,
    ) -> Result<(), DeviceError> {
        let fault = current(&self.script, self.clock.now());
        self.witness.unheard.store(fault.is_some_and(|fault| !fault.obeys()), Ordering::Relaxed);
        match fault {
            Some(LensFault::Unplugged) => Err(Self::error(DeviceErrorKind::Disconnected)),
            Some(LensFault::Silent) => Err(Self::error(DeviceErrorKind::TimedOut)),
            Some(LensFault::Deaf) => Ok(()),
            Some(LensFault::Garbage | LensFault::Frozen) | None => order(&mut self.inner),
        }
    }

    fn error(kind: DeviceErrorKind) -> DeviceError {
        DeviceError::new(kind, "laboratory lens", "as the script says")
    }
}

impl Lens for FaultyLens {
    fn info(&self) -> LensInfo {
        self.inner.info()
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        self.order(SimLens::home)
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        if !self.witness.range.contains(target) {
            self.witness.out_of_range.store(true, Ordering::Relaxed);
        }
        self.order(|lens| lens.move_to(target, speed))
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.order(SimLens::stop)
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        let fault = current(&self.script, self.clock.now());
        match fault {
            Some(LensFault::Unplugged) => return Err(Self::error(DeviceErrorKind::Disconnected)),
            Some(LensFault::Silent) => return Err(Self::error(DeviceErrorKind::TimedOut)),
            Some(LensFault::Garbage | LensFault::Deaf | LensFault::Frozen) | None => {}
        }
        let mut sample = self.inner.sample()?;
        match fault {
            Some(LensFault::Garbage) => {
                const NONE: [f64; 5] = [f64::NAN, f64::INFINITY, -1e12, 0.0, 65_535.0];
                let choice = sample.replied.0.unsigned_abs() as usize / 1000 % NONE.len();
                sample.position = LensPosition(NONE[choice]);
            }
            Some(LensFault::Frozen) => sample.position = *self.frozen.get_or_insert(sample.position),
            Some(LensFault::Unplugged | LensFault::Silent | LensFault::Deaf) | None => self.frozen = None,
        }
        Ok(sample)
    }
}

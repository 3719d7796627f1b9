//! Orders do not wait for the answer to a question, and no answer is taken for another's.

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensSpeed};
use evfocus_hal::{Bell, Clock, DeviceError, DeviceErrorKind, Lens, Transport};
use evfocus_lens::optotune::Quantity;
use evfocus_lens::{Firmata, Grbl, Indi, LabJack, MoonLite, Optotune, Port};
use hil_sim::LensConfig;
use hil_sim::wire::Protocol;

use crate::bench::{Bench, stands};
use crate::{firmata, grbl, indi, labjack, moonlite, optotune};

const PROTOCOLS: [Protocol; 6] = [
    Protocol::MoonLite,
    Protocol::Optotune,
    Protocol::Grbl,
    Protocol::Firmata,
    Protocol::LabJack,
    Protocol::Indi,
];
/// Faster than each of them goes; they do what they can.
const FAST: f64 = 2000.0;

/// What goes over a line, and what is to happen on it.
#[derive(Default)]
struct Log {
    bell: Bell,
    /// When the bell is to be rung.
    alarm: Option<HostMicros>,
    written: Vec<(HostMicros, Vec<u8>)>,
    /// Whether the device does not hear while it speaks, and whether it does since the bell rang.
    is_deaf: bool,
    speaks: bool,
}

/// A line that is listened in to.
struct Tapped {
    line: Box<dyn Transport>,
    log: Arc<Mutex<Log>>,
    clock: Arc<dyn Clock>,
}

impl Tapped {
    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap()
    }
}

impl Transport for Tapped {
    fn write(&mut self, bytes: &[u8]) -> Result<(), DeviceError> {
        let now = self.clock.now();
        self.log().written.push((now, bytes.to_vec()));
        let is_heard = !(self.log().is_deaf && self.log().speaks);
        if is_heard { self.line.write(bytes) } else { Ok(()) }
    }

    fn read(&mut self, buffer: &mut [u8], deadline: HostMicros) -> Result<usize, DeviceError> {
        let alarm = self.log().alarm.filter(|alarm| *alarm <= deadline);
        let length = self.line.read(buffer, alarm.unwrap_or(deadline))?;
        let mut log = self.log();
        if length > 0 {
            log.speaks = false;
        } else if alarm.is_some_and(|alarm| self.clock.now() >= alarm) {
            (log.alarm, log.speaks) = (None, true);
            log.bell.ring();
        }
        Ok(length)
    }

    fn listen(&mut self, bell: &Bell) {
        self.line.listen(bell);
    }

    fn drain(&mut self) -> Result<(), DeviceError> {
        self.line.drain()
    }
}

/// A lens behind a line that is listened in to.
struct Watched {
    bench: Bench,
    log: Arc<Mutex<Log>>,
    lens: Box<dyn Lens>,
}

fn motor(protocol: Protocol) -> LensConfig {
    match protocol {
        Protocol::MoonLite => moonlite::motor(),
        Protocol::Optotune => LensConfig::default(),
        Protocol::Grbl => grbl::motor(false),
        Protocol::Firmata => LensConfig { read_noise: 0.0, ..firmata::motor() },
        Protocol::LabJack => LensConfig { read_noise: 0.0, ..labjack::motor() },
        Protocol::Indi => indi::motor(),
    }
}

fn open(protocol: Protocol, port: Port, clock: Arc<dyn Clock>) -> Box<dyn Lens> {
    match protocol {
        Protocol::MoonLite => Box::new(MoonLite::open(port, moonlite::config(), clock).unwrap()),
        Protocol::Optotune => {
            Box::new(Optotune::open(port, optotune::config(Quantity::Current), clock).unwrap())
        }
        Protocol::Grbl => Box::new(Grbl::open(port, grbl::config(false), clock).unwrap()),
        Protocol::Firmata => Box::new(Firmata::open(port, firmata::config(), clock).unwrap()),
        Protocol::LabJack => Box::new(LabJack::open(port, labjack::config(), clock).unwrap()),
        Protocol::Indi => Box::new(Indi::open(port, indi::config(), clock).unwrap()),
    }
}

impl Watched {
    fn new(protocol: Protocol) -> Self {
        let bench = Bench::new(protocol, motor(protocol));
        let log = Arc::new(Mutex::new(Log::default()));
        let (tapped, clock) = (Arc::clone(&log), Arc::clone(&bench.clock));
        let port = bench.port().through(move |line| {
            Box::new(Tapped { line, log: Arc::clone(&tapped), clock: Arc::clone(&clock) })
        });
        let mut lens = open(protocol, port, Arc::clone(&bench.clock));
        lens.listen(&log.lock().unwrap().bell);
        Self { bench, log, lens }
    }

    fn log(&self) -> MutexGuard<'_, Log> {
        self.log.lock().unwrap()
    }

    /// Sends the lens off, and lets it go for a while.
    fn set_out(&mut self, target: f64) {
        self.lens.move_to(LensPosition(target), LensSpeed::new(FAST).unwrap()).unwrap();
        self.go_on();
    }

    /// Asks where the lens is for 300 ms.
    fn go_on(&mut self) {
        let until = self.bench.now() + Duration::from_millis(300);
        while self.bench.now() < until {
            self.lens.sample().unwrap();
            self.bench.wait(Duration::from_millis(2));
        }
    }

    /// Asks the lens where it is until the bell rings, at the first moment after `delay` at which an answer is waited for.
    fn ring_after(&mut self, delay: Duration) {
        let alarm = self.bench.now() + delay;
        self.log().alarm = Some(alarm);
        let interrupted = (0..100).find_map(|_| {
            let error = self.lens.sample().err();
            if error.is_none() {
                self.bench.wait(Duration::from_micros(200));
            }
            error
        });
        assert_eq!(interrupted.unwrap().kind, DeviceErrorKind::Interrupted);
        assert!(self.bench.now().since(alarm) < Duration::from_millis(12));
        self.log().written.clear();
        self.log().bell.hush();
    }

    /// When the first byte since was written.
    fn first_written(&self) -> Option<HostMicros> {
        self.log().written.first().map(|(time, _)| *time)
    }
}

#[test]
fn a_stop_is_written_at_once_while_an_answer_is_waited_for() {
    for protocol in PROTOCOLS {
        let mut watched = Watched::new(protocol);
        watched.set_out(3000.0);
        for delay_us in [300, 2_500, 6_000, 7_700] {
            watched.ring_after(Duration::from_micros(delay_us));
            let rang = watched.bench.now();
            watched.lens.stop().unwrap();
            // A set-point that stays as it is needs no word.
            if protocol != Protocol::Optotune {
                assert_eq!(watched.first_written(), Some(rang), "{protocol} after {delay_us} us");
            }
            watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(2));
            stands(&watched.bench);
            watched.set_out(3700.0 - 0.1 * delay_us as f64);
        }
    }
}

#[test]
fn a_goto_is_written_at_once_while_an_answer_is_waited_for() {
    for protocol in [Protocol::MoonLite, Protocol::Grbl, Protocol::Indi] {
        let mut watched = Watched::new(protocol);
        watched.set_out(3000.0);
        for (delay_us, target) in [(300, 800.0), (2_500, 1500.0), (6_000, 700.0), (7_700, 2500.0)] {
            watched.ring_after(Duration::from_micros(delay_us));
            let rang = watched.bench.now();
            watched.lens.move_to(LensPosition(target), LensSpeed::new(FAST).unwrap()).unwrap();
            assert_eq!(watched.first_written(), Some(rang), "{protocol} after {delay_us} us");
            watched.go_on();
        }
        let rest = watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(10));
        assert!(rest.position.distance(LensPosition(2500.0)) < 1.0, "{protocol}: {}", rest.position);
        assert!(watched.bench.glass().distance(LensPosition(2500.0)) < 1.0, "{protocol}");
    }
}

#[test]
fn answers_belong_to_their_questions_however_often_they_are_left_open() {
    for protocol in PROTOCOLS {
        let mut watched = Watched::new(protocol);
        watched.lens.move_to(LensPosition(3700.0), LensSpeed::new(FAST).unwrap()).unwrap();
        let (mut interruptions, mut worst, mut longest) = (0, 0.0_f64, Duration::ZERO);
        for round in 0..300_u64 {
            let alarm = watched.bench.now() + Duration::from_micros(100 + (round * 7919) % 13_000);
            if round % 3 == 0 {
                watched.log().alarm = Some(alarm);
            }
            match watched.lens.sample() {
                Ok(sample) => {
                    let [asked, came] =
                        [sample.requested, sample.replied].map(|time| watched.bench.rig.glass(time).0);
                    let meant = sample.position.0.clamp(asked.min(came), asked.max(came));
                    worst = worst.max((sample.position.0 - meant).abs());
                    longest = longest.max(sample.replied.since(sample.requested));
                }
                Err(error) => {
                    assert_eq!(error.kind, DeviceErrorKind::Interrupted, "{protocol}: {error}");
                    interruptions += 1;
                    watched.log().bell.hush();
                }
            }
            watched.bench.wait(Duration::from_millis(1));
        }
        println!("{protocol}: {interruptions} interruptions, {worst:.2} counts off at most, {longest:?}");
        assert!(interruptions > 10, "{protocol}");
        // Each lies between where the glass was at the question and at the answer, but for whole counts and the readings of a potentiometer.
        assert!(worst < 2.0 && longest < Duration::from_millis(12), "{protocol}: {worst}, {longest:?}");
    }
}

#[test]
fn a_controller_that_is_deaf_while_it_speaks_is_told_again() {
    let mut watched = Watched::new(Protocol::MoonLite);
    watched.log().is_deaf = true;
    watched.set_out(3000.0);
    watched.ring_after(Duration::from_millis(6));
    watched.lens.stop().unwrap();
    let before = watched.bench.glass();
    let rest = watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(1));
    assert!(watched.bench.glass().distance(before) < 100.0, "from {before} to {}", rest.position);
    stands(&watched.bench);
    watched.set_out(1000.0);
    watched.ring_after(Duration::from_millis(6));
    watched.lens.move_to(LensPosition(2000.0), LensSpeed::new(FAST).unwrap()).unwrap();
    watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(5));
    assert!(watched.bench.glass().distance(LensPosition(2000.0)) < 1.0);
}

#[test]
fn a_lens_that_is_dropped_while_its_controller_is_deaf_is_stopped() {
    let mut watched = Watched::new(Protocol::MoonLite);
    watched.log().is_deaf = true;
    watched.set_out(3000.0);
    watched.ring_after(Duration::from_millis(6));
    let Watched { bench, lens, .. } = watched;
    drop(lens);
    stands(&bench);
    assert!(bench.glass().0 < 1000.0);
}

#[test]
fn a_stop_cuts_a_goto_short() {
    let mut watched = Watched::new(Protocol::MoonLite);
    watched.lens.sample().unwrap();
    let stood = watched.bench.glass();
    // The target is set, and being read back.
    let alarm = watched.bench.now() + Duration::from_millis(21);
    watched.log().alarm = Some(alarm);
    let error = watched.lens.move_to(LensPosition(2000.0), LensSpeed::new(FAST).unwrap()).unwrap_err();
    assert_eq!(error.kind, DeviceErrorKind::Interrupted);
    watched.log().bell.hush();
    watched.lens.stop().unwrap();
    watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(1));
    stands(&watched.bench);
    assert!(watched.bench.glass().distance(stood) < 1.0);
    watched.set_out(1500.0);
    watched.bench.rest(watched.lens.as_mut(), Duration::from_secs(5));
    assert!(watched.bench.glass().distance(LensPosition(1500.0)) < 1.0);
}

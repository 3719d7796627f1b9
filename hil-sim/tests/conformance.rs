//! The simulated devices pass the suites that real ones must pass, and the suites find what is broken.

use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{CameraMicros, Event, EventBatch, HostMicros, LensPosition, LensSample, LensSpeed};
use evfocus_hal::{
    Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind, Lens, LensInfo, VirtualClock, conformance,
};
use hil_sim::{LensConfig, LensKind, Light, MotionConfig, Rig, RigConfig, SimCamera, SimLens};

use crate::sweep::section_three;

fn open(config: &RigConfig) -> (SimCamera, SimLens, Arc<dyn Clock>) {
    let clock: Arc<dyn Clock> = Arc::new(VirtualClock::new());
    let (camera, lens) = Rig::new(config.clone(), Arc::clone(&clock)).unwrap().devices();
    (camera, lens, clock)
}

fn shaken() -> RigConfig {
    RigConfig { motion: MotionConfig::hand_held(), ..section_three(Light::Light) }
}

#[test]
fn simulated_cameras_conform() {
    for light in [Light::Light, Light::Dark] {
        let config = RigConfig { motion: MotionConfig::hand_held(), ..section_three(light) };
        conformance::camera(|| {
            let (camera, _, clock) = open(&config);
            (Box::new(camera), clock)
        })
        .unwrap();
    }
}

#[test]
fn simulated_lenses_conform() {
    let slow_line =
        LensConfig { round_trip: Duration::from_millis(4), needs_homing: true, ..LensConfig::worn() };
    let sticky = LensConfig { stick_slip: 0.5, speed_ripple: 0.0, ..LensConfig::worn() };
    for lens in LensKind::ALL.iter().map(|&kind| kind.into()).chain([slow_line, sticky]) {
        let config = RigConfig { lens, ..section_three(Light::Light) };
        conformance::lens(|| {
            let (_, lens, clock) = open(&config);
            (Box::new(lens), clock)
        })
        .unwrap();
    }
}

/// What is wrong with a camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CameraVice {
    NoSerial,
    ReadsWithoutStart,
    StopsOnce,
    KeepsTheBatch,
    OverstaysTheTimeout,
    TimesGoBack,
    PixelOffTheSensor,
    GrowsTheBatch,
    ArrivesTomorrow,
    ReachedTooFar,
}

struct BadCamera {
    inner: SimCamera,
    clock: Arc<dyn Clock>,
    vice: CameraVice,
    started: bool,
}

impl Camera for BadCamera {
    fn info(&self) -> CameraInfo {
        let mut info = self.inner.info();
        if self.vice == CameraVice::NoSerial {
            info.serial.clear();
        }
        info
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        self.started = true;
        self.inner.start()
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        if self.vice == CameraVice::StopsOnce && !self.started {
            return Err(DeviceError::new(DeviceErrorKind::NotStarted, "bad camera", "stopped twice"));
        }
        self.started = false;
        self.inner.stop()
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        if self.vice == CameraVice::ReadsWithoutStart && !self.started {
            batch.clear();
            return Ok(());
        }
        let before = batch.events.clone();
        self.inner.read(batch, timeout)?;
        match self.vice {
            CameraVice::KeepsTheBatch => {
                let read = batch.events.to_vec();
                batch.events.clear();
                batch.events.append(before.iter().chain(read));
            }
            CameraVice::OverstaysTheTimeout => {
                self.clock.sleep_until(self.clock.now() + Duration::from_secs(1));
            }
            CameraVice::TimesGoBack => {
                let read = batch.events.to_vec();
                batch.events.clear();
                batch.events.append(read.into_iter().rev());
            }
            CameraVice::PixelOffTheSensor => {
                if let Some(event) = batch.events.last() {
                    batch.events.truncate(batch.events.len() - 1);
                    batch.events.append([Event { x: 160, ..event }]);
                }
            }
            CameraVice::GrowsTheBatch => batch.events.reserve(100_000),
            CameraVice::ArrivesTomorrow => batch.arrival = HostMicros(86_400_000_000),
            CameraVice::ReachedTooFar => {
                batch.reached = batch.reached.map(|reached| CameraMicros(reached.0 + 2000));
            }
            CameraVice::NoSerial | CameraVice::ReadsWithoutStart | CameraVice::StopsOnce => {}
        }
        Ok(())
    }
}

#[test]
fn the_camera_suite_finds_what_is_broken() {
    for (vice, check) in [
        (CameraVice::NoSerial, "camera info is sane"),
        (CameraVice::ReadsWithoutStart, "read before start is refused"),
        (CameraVice::StopsOnce, "start and stop are idempotent"),
        (CameraVice::KeepsTheBatch, "read clears the batch"),
        (CameraVice::OverstaysTheTimeout, "read returns in time"),
        (CameraVice::TimesGoBack, "event times never decrease"),
        (CameraVice::PixelOffTheSensor, "events lie on the sensor"),
        (CameraVice::GrowsTheBatch, "the batch never grows"),
        (CameraVice::ArrivesTomorrow, "arrivals are in order"),
        (CameraVice::ReachedTooFar, "reached is true"),
    ] {
        let failure = conformance::camera(|| {
            let (inner, _, clock) = open(&shaken());
            (Box::new(BadCamera { inner, clock: Arc::clone(&clock), vice, started: false }), clock)
        });
        assert_eq!(failure.unwrap_err().check, check, "{vice:?}");
    }
}

/// What is wrong with a lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LensVice {
    NoModel,
    MovesOutOfRange,
    NeverArrives,
    RacesAlways,
    WaitsForTheMotion,
    AnswersBeforeTheQuestion,
    IgnoresStop,
    RefusesStopAtRest,
    FinishesTheOldMove,
}

struct BadLens {
    inner: SimLens,
    clock: Arc<dyn Clock>,
    vice: LensVice,
}

impl Lens for BadLens {
    fn info(&self) -> LensInfo {
        let mut info = self.inner.info();
        if self.vice == LensVice::NoModel {
            info.model.clear();
        }
        info
    }

    fn home(&mut self) -> Result<(), DeviceError> {
        self.inner.home()
    }

    fn move_to(&mut self, target: LensPosition, speed: LensSpeed) -> Result<(), DeviceError> {
        let info = self.inner.info();
        match self.vice {
            LensVice::MovesOutOfRange if !info.range.contains(target) => {
                self.inner.move_to(info.range.max(), speed)?;
                return Err(DeviceError::new(DeviceErrorKind::OutOfRange, "bad lens", "moves all the same"));
            }
            LensVice::NeverArrives if info.range.contains(target) => {
                let short = LensPosition(target.0 * 0.9 + info.range.min().0 * 0.1);
                return self.inner.move_to(short, speed);
            }
            LensVice::RacesAlways => return self.inner.move_to(target, info.max_speed),
            LensVice::FinishesTheOldMove if self.inner.sample()?.moving => return Ok(()),
            _ => {}
        }
        self.inner.move_to(target, speed)?;
        if self.vice == LensVice::WaitsForTheMotion {
            while self.inner.sample()?.moving {
                self.clock.sleep_until(self.clock.now() + Duration::from_millis(5));
            }
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        match self.vice {
            LensVice::IgnoresStop => Ok(()),
            LensVice::RefusesStopAtRest if !self.inner.sample()?.moving => {
                Err(DeviceError::new(DeviceErrorKind::Fault, "bad lens", "is at rest"))
            }
            _ => self.inner.stop(),
        }
    }

    fn sample(&mut self) -> Result<LensSample, DeviceError> {
        let mut sample = self.inner.sample()?;
        if self.vice == LensVice::AnswersBeforeTheQuestion {
            sample.replied = HostMicros(sample.requested.0 - 1);
        }
        Ok(sample)
    }
}

#[test]
fn the_lens_suite_finds_what_is_broken() {
    for (vice, check) in [
        (LensVice::NoModel, "lens info is sane"),
        (LensVice::MovesOutOfRange, "a target out of range is refused"),
        (LensVice::NeverArrives, "a target out of range is refused"),
        (LensVice::RacesAlways, "a move is no faster than asked"),
        (LensVice::WaitsForTheMotion, "a move does not block"),
        (LensVice::AnswersBeforeTheQuestion, "samples are in order"),
        (LensVice::IgnoresStop, "stop stops"),
        (LensVice::RefusesStopAtRest, "stop at rest is harmless"),
        (LensVice::FinishesTheOldMove, "a new move replaces the old one"),
    ] {
        let failure = conformance::lens(|| {
            let (_, inner, clock) = open(&shaken());
            (Box::new(BadLens { inner, clock: Arc::clone(&clock), vice }), clock)
        });
        assert_eq!(failure.unwrap_err().check, check, "{vice:?}");
    }
}

//! The simulated rig: camera, lens and scene that belong together, and what only the simulator knows.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use evfocus_core::{HostMicros, LensPosition};
use evfocus_hal::Clock;

use crate::camera::SimCamera;
use crate::config::{ConfigError, RigConfig};
use crate::lens::{LensState, SimLens, lock};
use crate::picture::{Picture, Scratch};
use crate::random::Stream;
use crate::scene::Scene;
use crate::wire::{Motor, Protocol, WirePort};

/// A simulated rig. Clones are handles to the same rig.
#[derive(Clone)]
pub struct Rig {
    picture: Arc<Picture>,
    lens: Arc<Mutex<LensState>>,
    clock: Arc<dyn Clock>,
    epoch: HostMicros,
    capped: Arc<AtomicU64>,
}

impl std::fmt::Debug for Rig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Rig").field("config", self.config()).finish_non_exhaustive()
    }
}

impl Rig {
    /// Builds the rig on `clock`; its own time begins now.
    ///
    /// # Errors
    /// [`ConfigError`] for a value out of its range.
    pub fn new(config: RigConfig, clock: Arc<dyn Clock>) -> Result<Self, ConfigError> {
        config.validate()?;
        let epoch = clock.now();
        let lens = LensState::new(config.lens, &config.faults, Stream::LensReadOut.generator(config.seed));
        let (picture, lens) = (Arc::new(Picture::new(config)), Arc::new(Mutex::new(lens)));
        Ok(Self { picture, lens, clock, epoch, capped: Arc::default() })
    }

    /// Opens the camera and the lens. Opening them again, after a fault and [`repair`](Self::repair), gives handles to the
    /// same hardware; each device is meant to be held by one owner at a time.
    pub fn devices(&self) -> (SimCamera, SimLens) {
        let (lens, clock) = (Arc::clone(&self.lens), Arc::clone(&self.clock));
        let serial = format!("SIM{:05}", self.config().seed);
        let camera = SimCamera::new(
            Arc::clone(&self.picture),
            Arc::clone(&self.lens),
            Arc::clone(&self.clock),
            self.epoch,
            serial.clone(),
            Arc::clone(&self.capped),
        );
        (camera, SimLens::new(lens, clock, self.epoch, serial))
    }

    /// Puts a controller between the host and the lens, which the camera goes on to look through. It moves the same motor as
    /// the lens of [`devices`](Self::devices); use one of the two.
    pub fn wire(&self, protocol: Protocol) -> WirePort {
        WirePort::new(protocol, Motor::new(Arc::clone(&self.lens), self.epoch), Arc::clone(&self.clock))
    }

    /// How the rig was configured.
    pub fn config(&self) -> &RigConfig {
        self.picture.config()
    }

    /// The glass positions at which the scene is sharp: one, or two for a scene with two depths. With backlash the lens
    /// reports these numbers when it comes from below. On a tilted sensor they are those of the picture's middle.
    pub fn truth(&self) -> Vec<LensPosition> {
        let config = self.config();
        match config.scene {
            Scene::TwoDepths => vec![config.focus, config.second_focus],
            Scene::Text
            | Scene::SiemensStar
            | Scene::DeadLeaves
            | Scene::PinkNoise
            | Scene::StarField
            | Scene::Checker
            | Scene::Foliage
            | Scene::Buildings
            | Scene::LowTexture
            | Scene::BlankWall => vec![config.focus],
        }
    }

    /// Where the glass really is, or was, at `time`.
    pub fn glass(&self, time: HostMicros) -> LensPosition {
        LensPosition(lock(&self.lens).at(self.seconds(time)).optics)
    }

    /// Events that the rate cap has dropped since the rig was made. A real device does not tell.
    pub fn dropped_by_rate_cap(&self) -> u64 {
        self.capped.load(Ordering::Relaxed)
    }

    /// Takes away all faults that have struck by now. Handles that noticed an unplugging stay dead; open new ones.
    pub fn repair(&self) {
        let now = self.seconds(self.clock.now());
        lock(&self.lens).repair(now);
    }

    /// The light on the sensor at `time` with the glass at `position`: linear intensity, DN (0 to 255, beyond in lamps and
    /// stars), row by row.
    pub fn intensity_frame(&self, time: HostMicros, position: LensPosition) -> Vec<f32> {
        let mut image = vec![0.0; self.picture.pixels()];
        let view = self.picture.view(position.0, self.seconds(time));
        self.picture.render(&view, &mut Scratch::default(), &mut image);
        image
    }

    /// The clock that the rig lives by.
    pub(crate) fn clock(&self) -> Arc<dyn Clock> {
        Arc::clone(&self.clock)
    }

    fn seconds(&self, time: HostMicros) -> f64 {
        time.micros_since(self.epoch) as f64 / 1e6
    }
}

//! A simulated rig with a camera on the wire.

use std::sync::Arc;
use std::time::Duration;

use evfocus_camera::davis346::Davis346;
use evfocus_camera::evk4::Evk4;
use evfocus_camera::{Driver, davis346, evk4};
use evfocus_core::{Event, EventBatch, Geometry};
use evfocus_hal::{Camera, Clock, DeviceError, VirtualClock};
use hil_sim::{
    CameraModel, LensConfig, Light, MotionConfig, Rig, RigConfig, Scene, SensorConfig, UsbFaults, UsbModel,
    UsbPort,
};

/// A small sensor before a scene that is sharp, in a shaken hand.
pub(crate) fn config(driver: Driver) -> RigConfig {
    let model = match driver {
        Driver::Davis346 => CameraModel::Davis346,
        Driver::Evk4 => CameraModel::Imx636,
    };
    let geometry = Geometry { width: 160, height: 120 };
    let lens = LensConfig { start: RigConfig::default().focus, ..LensConfig::default() };
    RigConfig {
        lens,
        sensor: SensorConfig { geometry, ..SensorConfig::preset(model, Light::Light) },
        scene: Scene::DeadLeaves,
        motion: MotionConfig::hand_held(),
        ..RigConfig::default()
    }
}

/// A rig, the port that its camera is plugged into, and the driver that fits.
#[derive(Debug)]
pub(crate) struct Bench {
    pub(crate) driver: Driver,
    pub(crate) rig: Rig,
    pub(crate) port: UsbPort,
    pub(crate) clock: Arc<VirtualClock>,
}

impl Bench {
    pub(crate) fn new(driver: Driver) -> Self {
        Self::with(driver, config(driver))
    }

    pub(crate) fn with(driver: Driver, config: RigConfig) -> Self {
        let clock = Arc::new(VirtualClock::new());
        let rig = Rig::new(config, clock.clone()).unwrap();
        let model = match driver {
            Driver::Davis346 => UsbModel::Davis346,
            Driver::Evk4 => UsbModel::Evk4,
        };
        let port = rig.plug(model);
        Self { driver, rig, port, clock }
    }

    /// Opens the camera with default settings.
    pub(crate) fn open(&self) -> Result<Box<dyn Camera>, DeviceError> {
        match self.driver {
            Driver::Davis346 => self.open_davis346(&davis346::Settings::default()),
            Driver::Evk4 => self.open_evk4(&evk4::Settings::default()),
        }
    }

    pub(crate) fn open_davis346(
        &self,
        settings: &davis346::Settings,
    ) -> Result<Box<dyn Camera>, DeviceError> {
        let transport = self.port.open().unwrap();
        Ok(Box::new(Davis346::open(transport, settings, self.clock.clone())?))
    }

    pub(crate) fn open_evk4(&self, settings: &evk4::Settings) -> Result<Box<dyn Camera>, DeviceError> {
        let transport = self.port.open().unwrap();
        Ok(Box::new(Evk4::open(transport, settings, self.clock.clone())?))
    }

    pub(crate) fn set_faults(&self, faults: UsbFaults) {
        self.port.set_faults(faults);
    }

    /// What a started camera sends in `duration`: the events and how many were lost.
    pub(crate) fn watch(
        &self,
        camera: &mut dyn Camera,
        duration: Duration,
    ) -> Result<(Vec<Event>, u64), DeviceError> {
        let mut batch = EventBatch::with_capacity(65_536);
        let (mut events, mut lost) = (Vec::new(), 0);
        let end = self.clock.now() + duration;
        while self.clock.now() < end {
            camera.read(&mut batch, Duration::from_millis(5))?;
            events.extend(batch.events.iter());
            lost += batch.lost;
        }
        Ok((events, lost))
    }
}

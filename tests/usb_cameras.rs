//! The whole focus loop with the real camera drivers on emulated devices, in virtual time.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use evfocus_camera::davis346::{self, Davis346};
use evfocus_camera::evk4::{self, Evk4};
use evfocus_core::controller::FocusRequest;
use evfocus_core::{Geometry, LensPosition, Outcome, RunReport};
use evfocus_hal::{DeviceError, DeviceErrorKind};
use evfocusd::{Config, VirtualRig};
use hil_sim::{Fault, FaultKind, FaultTrigger, UsbModel};

/// A run with the driver of `model`; the error of its answer, if it has one.
fn run(config: &Config, model: UsbModel) -> Result<(RunReport, Option<f64>)> {
    let mut rig = VirtualRig::with_camera(config, |rig, clock| {
        let transport = rig.plug(model).open().map_err(|error| {
            DeviceError::new(DeviceErrorKind::Disconnected, "emulated port", error.to_string())
        })?;
        let clock = Arc::clone(&clock);
        Ok(match model {
            UsbModel::Davis346 => Box::new(Davis346::open(transport, &davis346::Settings::default(), clock)?),
            UsbModel::Evk4 => Box::new(Evk4::open(transport, &evk4::Settings::default(), clock)?),
        })
    })?;
    let report = rig.focus(FocusRequest::default(), |_, _, _| {})?;
    let truth = *rig.truth().first().context("a truth")?;
    let error = match report.outcome {
        Outcome::Focused { position } => Some(position.counts_from(truth)),
        Outcome::Failed(_) | Outcome::Aborted => None,
    };
    Ok((report, error))
}

fn config(model: UsbModel) -> Result<Config> {
    let mut config = Config::parse("[simulation]\nvibration_px_rms = 0.08", Path::new("(in the test)"))?;
    if model == UsbModel::Evk4 {
        // All its pixels would take several times as long as real time.
        config.rig.sensor.geometry = Geometry { width: 320, height: 240 };
    }
    Ok(config)
}

#[test]
fn both_cameras_focus() -> Result<()> {
    for model in [UsbModel::Davis346, UsbModel::Evk4] {
        let (report, error) = run(&config(model)?, model)?;
        let error = error.with_context(|| format!("{model:?}: {:?}", report.outcome))?;
        println!("{model:?}: error {error:+.1}");
        // A blur of one pixel is 50 counts here.
        assert!(error.abs() < 10.0, "{model:?}: {error}");
    }
    Ok(())
}

#[test]
fn a_camera_unplugged_in_mid_sweep_is_named() -> Result<()> {
    for model in [UsbModel::Davis346, UsbModel::Evk4] {
        for (kind, name) in
            [(FaultKind::CameraUnplugged, "camera-lost"), (FaultKind::CameraTimeReset, "clock-unusable")]
        {
            let mut config = config(model)?;
            let trigger = FaultTrigger::AtPosition(LensPosition(1500.0));
            config.rig.faults = vec![Fault { kind, trigger }];
            let (report, _) = run(&config, model)?;
            let Outcome::Failed(failure) = report.outcome else {
                anyhow::bail!("{model:?}, {kind:?}: {:?}", report.outcome)
            };
            assert_eq!(failure.name(), name, "{model:?}");
        }
    }
    Ok(())
}

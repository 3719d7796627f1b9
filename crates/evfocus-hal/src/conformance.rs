//! Test suites that every implementation of the traits must pass: the simulator, each driver against its emulator, and the
//! real device on the bench.
//!
//! Each check gets a device of its own, freshly opened, and the clock that the device lives by. The suites wait on that
//! clock and know no other, so they run in virtual time as well as in real time.

mod camera;
mod lens;

use std::sync::Arc;

use crate::{Camera, Clock, Lens};

/// A check that an implementation did not pass.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("conformance check {check}: {what}")]
pub struct ConformanceError {
    /// The check's name.
    pub check: &'static str,
    /// What was expected and what was found.
    pub what: String,
}

/// Puts cameras from `make` through all camera checks; the scene should make some events.
///
/// # Errors
/// The first check that was not passed.
pub fn camera(mut make: impl FnMut() -> (Box<dyn Camera>, Arc<dyn Clock>)) -> Result<(), ConformanceError> {
    for &(check, run) in camera::CHECKS {
        let (mut device, clock) = make();
        run(device.as_mut(), clock.as_ref()).map_err(|what| ConformanceError { check, what })?;
    }
    Ok(())
}

/// Puts lenses from `make` through all lens checks. The lenses move over their whole range.
///
/// # Errors
/// The first check that was not passed.
pub fn lens(mut make: impl FnMut() -> (Box<dyn Lens>, Arc<dyn Clock>)) -> Result<(), ConformanceError> {
    for &(check, run) in lens::CHECKS {
        let (mut device, clock) = make();
        lens::prepare(device.as_mut(), clock.as_ref())
            .and_then(|()| run(device.as_mut(), clock.as_ref()))
            .map_err(|what| ConformanceError { check, what })?;
    }
    Ok(())
}

/// `Err` with `what()` unless `condition` holds.
fn ensure(condition: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if condition { Ok(()) } else { Err(what()) }
}

/// The value of an operation that should have worked.
fn works<T>(operation: &str, result: Result<T, crate::DeviceError>) -> Result<T, String> {
    result.map_err(|error| format!("{operation} failed: {error}"))
}

/// `Ok` if the operation failed with `kind`.
fn fails<T>(
    operation: &str,
    kind: crate::DeviceErrorKind,
    result: Result<T, crate::DeviceError>,
) -> Result<(), String> {
    match result {
        Ok(_) => Err(format!("{operation} worked; it must fail as \"{kind}\"")),
        Err(error) => {
            ensure(error.kind == kind, || format!("{operation} failed as \"{error}\", not as \"{kind}\""))
        }
    }
}

//! What was measured of the lens, kept over a restart.

use std::fs;
use std::io;
use std::path::PathBuf;

use evfocus_ipc::{CALIBRATION_FORMAT, Calibration, Error};

use crate::storage::StateDirectory;

/// The file in the state directory.
#[derive(Debug, Clone)]
pub struct CalibrationFile {
    state: StateDirectory,
    path: PathBuf,
    lens: String,
}

impl CalibrationFile {
    /// The file in `state` for `lens`, model and serial.
    pub fn new(state: &StateDirectory, lens: &str) -> Self {
        Self { state: state.clone(), path: state.path("lens-calibration.json"), lens: lens.to_owned() }
    }

    /// What was measured of this lens. A file that cannot be used costs no more than a lens that is not calibrated.
    pub fn read(&self) -> Option<Calibration> {
        let path = self.path.display();
        let text = match fs::read(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => {
                tracing::warn!(%path, %error, "the lens's calibration cannot be read; calibrate it anew");
                return None;
            }
        };
        match parse(&text) {
            Ok(known) if known.lens == self.lens => Some(known),
            Ok(known) => {
                tracing::info!(
                    calibrated = known.lens,
                    lens = self.lens,
                    "the calibration is another lens's and does not count"
                );
                None
            }
            Err(error) => {
                tracing::warn!(%path, error, "the lens's calibration cannot be read; calibrate it anew");
                None
            }
        }
    }

    /// Keeps `calibration`.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub fn write(&self, calibration: &Calibration) -> Result<(), Error> {
        self.state.write_json(&self.path, calibration)
    }
}

/// What `text` says, if it can have been written here.
fn parse(text: &[u8]) -> Result<Calibration, String> {
    let known: Calibration = serde_json::from_slice(text).map_err(|error| error.to_string())?;
    if known.format != CALIBRATION_FORMAT {
        return Err(format!("its format is {}, this version reads {CALIBRATION_FORMAT}", known.format));
    }
    for (name, value) in [
        ("speed_counts_per_s", known.speed_counts_per_s),
        ("read_back_hz", known.read_back_hz),
        ("range", known.range.max - known.range.min),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(format!("its {name} is {value}, which no lens has"));
        }
    }
    if known.backlash.is_some_and(|counts| !(0.0..=1e6).contains(&counts)) {
        return Err(format!("its backlash is {:?}", known.backlash));
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use evfocus_ipc::LensRange;

    use super::*;

    fn measured() -> Calibration {
        Calibration {
            format: CALIBRATION_FORMAT,
            lens: "lens 1".to_owned(),
            measured_unix_s: 1.0,
            range: LensRange { min: 0.0, max: 100.0 },
            speed_counts_per_s: 50.0,
            read_back_hz: 100.0,
            read_back_us: 10_000.0,
            read_noise: 0.0,
            command_latency_us: 5000.0,
            stop_us: 20_000.0,
            stop_counts: 1.0,
            backlash: Some(2.0),
            backlash_error_bar: Some(0.5),
            lag_us: Some(6000.0),
            notes: vec![],
        }
    }

    #[test]
    fn it_is_there_again_for_the_same_lens_only() {
        let folder = tempfile::tempdir().unwrap();
        let file = CalibrationFile::new(&StateDirectory::new(folder.path()), "lens 1");
        assert_eq!(file.read(), None);
        file.write(&measured()).unwrap();
        assert_eq!(file.read(), Some(measured()));
        assert_eq!(CalibrationFile::new(&StateDirectory::new(folder.path()), "lens 2").read(), None);
    }

    #[test]
    fn a_damaged_file_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let file = CalibrationFile::new(&StateDirectory::new(folder.path()), "lens 1");
        file.write(&measured()).unwrap();
        let path = folder.path().join("lens-calibration.json");
        let good = fs::read_to_string(&path).unwrap();
        for bad in [
            "",
            "null",
            &good[..good.len() / 2],
            &good.replace("\"format\": 1", "\"format\": 2"),
            &good.replace("\"max\": 100.0", "\"max\": -1.0"),
            &good.replace("\"backlash\": 2.0", "\"backlash\": -2.0"),
            &good.replace("\"read_back_hz\": 100.0", "\"read_back_hz\": 0.0"),
        ] {
            assert_ne!(bad, good);
            fs::write(&path, bad).unwrap();
            assert_eq!(file.read(), None, "{bad}");
        }
    }
}

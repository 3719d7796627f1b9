//! What the runs have taught of the pixels' delay, kept over a restart.

use std::fs;
use std::io;
use std::path::PathBuf;

use evfocus_core::DelayModel;
use evfocus_ipc::Error;
use serde::{Deserialize, Serialize};

use crate::storage::StateDirectory;

/// The value of [`Learnt::format`] that this version writes and reads.
const FORMAT: u64 = 1;
const MICROS: f64 = 1e6;

/// The file in the state directory.
#[derive(Debug, Clone)]
pub struct RigDelayFile {
    state: StateDirectory,
    path: PathBuf,
    camera: String,
    lens: String,
}

/// What is in it.
#[derive(Debug, Serialize, Deserialize)]
struct Learnt {
    format: u64,
    /// Model and serial.
    camera: String,
    /// Model and serial.
    lens: String,
    base_us: f64,
    us_per_hz: f64,
    /// Variance of `base_us`, covariance, variance of `us_per_hz`; the microseconds squared.
    covariance: [f64; 3],
    measurements: u32,
}

impl RigDelayFile {
    /// The file in `state` for the rig of this camera and lens, model and serial each.
    pub fn new(state: &StateDirectory, camera: &str, lens: &str) -> Self {
        let (camera, lens) = (camera.to_owned(), lens.to_owned());
        Self { state: state.clone(), path: state.path("rig-delay.json"), camera, lens }
    }

    /// What was learnt with the same camera and lens. A file that cannot be used costs no more than learning anew.
    pub fn read(&self) -> Option<DelayModel> {
        let text = match fs::read(&self.path) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return None,
            Err(error) => {
                self.warn(&error.to_string());
                return None;
            }
        };
        match parse(&text) {
            Ok(learnt) if (&learnt.camera, &learnt.lens) == (&self.camera, &self.lens) => {
                Some(model(&learnt))
            }
            Ok(learnt) => {
                let (camera, lens) = (learnt.camera, learnt.lens);
                tracing::info!(
                    camera,
                    lens,
                    "the pixels' delay was learnt with another rig; it is learnt anew"
                );
                None
            }
            Err(error) => {
                self.warn(&error);
                None
            }
        }
    }

    fn warn(&self, error: &str) {
        let path = self.path.display();
        tracing::warn!(%path, error, "the learnt delay of the pixels cannot be read; it is learnt anew");
    }

    /// Keeps `delays`.
    ///
    /// # Errors
    /// [`Error::StorageFailed`], naming the file; what was there before stays.
    pub fn write(&self, delays: &DelayModel) -> Result<(), Error> {
        self.state.write_json(
            &self.path,
            &Learnt {
                format: FORMAT,
                camera: self.camera.clone(),
                lens: self.lens.clone(),
                base_us: delays.base_s * MICROS,
                us_per_hz: delays.per_hz_s * MICROS,
                covariance: delays.covariance.map(|value| value * MICROS * MICROS),
                measurements: delays.measurements,
            },
        )
    }
}

/// What `text` says, if it can have been written here.
fn parse(text: &[u8]) -> Result<Learnt, String> {
    let learnt: Learnt = serde_json::from_slice(text).map_err(|error| error.to_string())?;
    if learnt.format != FORMAT {
        return Err(format!("its format is {}, this version reads {FORMAT}", learnt.format));
    }
    let [base, both, slope] = learnt.covariance;
    // Rounding may leave a hair's breadth beyond the limit.
    if base < 0.0 || slope < 0.0 || both * both > base * slope * 1.000_001 {
        return Err(format!("no covariance: {:?}", learnt.covariance));
    }
    Ok(learnt)
}

fn model(learnt: &Learnt) -> DelayModel {
    DelayModel {
        base_s: learnt.base_us / MICROS,
        per_hz_s: learnt.us_per_hz / MICROS,
        covariance: learnt.covariance.map(|value| value / MICROS / MICROS),
        measurements: learnt.measurements,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learnt() -> DelayModel {
        let mut delays = DelayModel::default();
        for _ in 0..3 {
            delays.learn(0.5, 0.02, 0.001);
        }
        delays
    }

    #[test]
    fn what_was_learnt_is_there_again_for_the_same_rig_only() {
        let folder = tempfile::tempdir().unwrap();
        let file = RigDelayFile::new(&StateDirectory::new(folder.path()), "camera 1", "lens 1");
        assert_eq!(file.read(), None);
        file.write(&learnt()).unwrap();
        let (kept, expected) = (file.read().unwrap(), learnt());
        assert_eq!(kept.measurements, 3);
        for noise_hz in [0.0, 0.5, 2.0] {
            let (kept, expected) = (kept.at(noise_hz), expected.at(noise_hz));
            assert!((kept.seconds - expected.seconds).abs() < 1e-12);
            assert!((kept.uncertainty_s - expected.uncertainty_s).abs() < 1e-12);
        }
        assert_eq!(RigDelayFile::new(&StateDirectory::new(folder.path()), "camera 2", "lens 1").read(), None);
        assert_eq!(RigDelayFile::new(&StateDirectory::new(folder.path()), "camera 1", "lens 2").read(), None);
    }

    #[test]
    fn a_damaged_file_is_learnt_anew_and_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let file = RigDelayFile::new(&StateDirectory::new(folder.path()), "camera 1", "lens 1");
        file.write(&learnt()).unwrap();
        let path = folder.path().join("rig-delay.json");
        let good = fs::read_to_string(&path).unwrap();
        for bad in [
            "",
            "null",
            &good[..good.len() / 2],
            &good.replace("\"format\": 1", "\"format\": 2"),
            &good.replace("\"measurements\": 3", "\"measurements\": -3"),
            &good.replace("\"covariance\": [", "\"covariance\": [\n-1e9,").replacen(
                "-1e9,",
                "-1e9, 0, 1],\n\"x\": [",
                1,
            ),
            &good.replace("\"base_us\": ", "\"base_us\": 1e999, \"x\": "),
        ] {
            fs::write(&path, bad).unwrap();
            assert_eq!(file.read(), None, "{bad}");
        }
        file.write(&learnt()).unwrap();
        assert!(file.read().is_some());
    }
}

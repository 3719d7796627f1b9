//! `[real_time]`: what is asked of the operating system, so that the threads run when they must.

use serde::Deserialize;

use super::BadValue;

/// `[real_time]`. All of it is off unless asked for.
#[derive(Debug, Clone, PartialEq, Eq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RealTimeSection {
    /// Priority of the camera's thread under `SCHED_FIFO`, 1 to 99.
    pub camera_priority: Option<u8>,
    /// The same of the control thread; above the camera's, if at all.
    pub control_priority: Option<u8>,
    /// The processors that the camera's thread may use, counted from 0.
    pub camera_cpus: Option<Vec<u16>>,
    /// The same for the control thread.
    pub control_cpus: Option<Vec<u16>>,
    /// Whether memory stays in memory once it has been touched.
    pub lock_memory: bool,
}

impl RealTimeSection {
    pub(super) fn check(self) -> Result<Self, BadValue> {
        for (key, priority) in [
            ("real_time.camera_priority", self.camera_priority),
            ("real_time.control_priority", self.control_priority),
        ] {
            if let Some(priority) = priority {
                BadValue::check(key, f64::from(priority), 1.0, 99.0)?;
            }
        }
        for (key, cpus) in
            [("real_time.camera_cpus", &self.camera_cpus), ("real_time.control_cpus", &self.control_cpus)]
        {
            if let Some(cpus) = cpus {
                let highest = cpus.iter().max().ok_or_else(|| {
                    BadValue::new(key, "empty", "name processors, or leave the key out for all of them")
                })?;
                BadValue::check(key, f64::from(*highest), 0.0, 1023.0)?;
            }
        }
        Ok(self)
    }
}

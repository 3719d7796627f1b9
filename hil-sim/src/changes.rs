//! What happens in front of the camera while the rig lives: the subject goes elsewhere, hurries, or is lit otherwise.

use std::time::Duration;

/// Something that changes at once and lasts until the next change of its kind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ChangeKind {
    /// The scene, with all its depths, is sharp this much further up the lens range than configured, counts. A lens that was knocked
    /// without noticing it looks the same.
    Focus {
        /// Counts from the focus configured.
        by: f64,
    },
    /// The motion of the picture runs this many times as fast as configured; 0 stands still.
    Pace {
        /// Factor of the speed, 0 to 100.
        times: f64,
    },
    /// The light is this many times as bright as configured.
    Light {
        /// Factor of the brightness, 0.001 to 1000.
        times: f64,
    },
}

/// A scheduled change of the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Change {
    /// When, after the rig was made.
    pub after: Duration,
    /// What.
    pub kind: ChangeKind,
}

/// The state of the scene at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scenery {
    /// How much further up the scene is sharp, counts.
    pub(crate) focus: f64,
    /// Seconds on the clock of the picture's motion.
    pub(crate) motion_seconds: f64,
    /// Factor of the brightness.
    pub(crate) light: f64,
}

impl Scenery {
    /// What `changes` (in any order) have made of the scene `seconds` after the rig was made.
    pub(crate) fn at(changes: &[Change], seconds: f64) -> Self {
        let mut scenery = Self { focus: 0.0, motion_seconds: seconds, light: 1.0 };
        let mut latest = [f64::NEG_INFINITY; 2];
        let mut pace = 1.0;
        for change in changes {
            let after = change.after.as_secs_f64();
            if after > seconds {
                continue;
            }
            match change.kind {
                ChangeKind::Focus { by } if after >= latest[0] => (scenery.focus, latest[0]) = (by, after),
                ChangeKind::Light { times } if after >= latest[1] => {
                    (scenery.light, latest[1]) = (times, after);
                }
                ChangeKind::Pace { times } => {
                    // From here on another speed; the changes of pace are in order of time.
                    scenery.motion_seconds += (times - pace) * (seconds - after);
                    pace = times;
                }
                ChangeKind::Focus { .. } | ChangeKind::Light { .. } => {}
            }
        }
        scenery
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(seconds: u64, kind: ChangeKind) -> Change {
        Change { after: Duration::from_secs(seconds), kind }
    }

    #[test]
    fn each_change_lasts_until_the_next_of_its_kind() {
        let changes = [
            change(2, ChangeKind::Pace { times: 3.0 }),
            change(3, ChangeKind::Focus { by: 200.0 }),
            change(4, ChangeKind::Pace { times: 0.0 }),
            change(5, ChangeKind::Light { times: 2.0 }),
            change(6, ChangeKind::Focus { by: 0.0 }),
        ];
        for (seconds, focus, motion_seconds, light) in
            [(1.0, 0.0, 1.0, 1.0), (3.0, 200.0, 5.0, 1.0), (5.5, 200.0, 8.0, 2.0), (7.0, 0.0, 8.0, 2.0)]
        {
            assert_eq!(Scenery::at(&changes, seconds), Scenery { focus, motion_seconds, light });
        }
    }
}

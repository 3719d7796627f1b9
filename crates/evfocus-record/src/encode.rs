//! Pure encoders: events in, bytes out.

mod evt3;

pub use evt3::Evt3Encoder;

use evfocus_core::{Event, Geometry};

/// An event that a format cannot express.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum EncodeError {
    /// The event lies outside of the sensor that the file is for.
    #[error("an event at column {}, row {} lies outside of the {}x{} sensor", event.x, event.y, geometry.width, geometry.height)]
    OutsideSensor {
        /// The event.
        event: Event,
        /// The sensor.
        geometry: Geometry,
    },
    /// The format cannot address so large a sensor.
    #[error("{}x{} pixels are more than the format can address, {}x{}", geometry.width, geometry.height, max.width, max.height)]
    SensorTooLarge {
        /// The sensor.
        geometry: Geometry,
        /// What the format can address.
        max: Geometry,
    },
    /// The format's time only goes forward.
    #[error(
        "an event at {time} us comes after one at {last} us, and the format's time cannot go back; write CSV or AEDAT4"
    )]
    TimeReversal {
        /// Time of the event, microseconds.
        time: i64,
        /// Time of the event before, microseconds.
        last: i64,
    },
    /// The format tells time in small steps, and so long a silence would take too many of them.
    #[error(
        "{gap_us} us without an event are too long for the format; write CSV or AEDAT4, or cut the recording there"
    )]
    GapTooLong {
        /// Length of the silence, microseconds.
        gap_us: i64,
    },
    /// The format's times do not reach so far from the first one.
    #[error("an event at {time} us is out of the reach of the format's times")]
    TimeOutOfReach {
        /// Time of the event, microseconds.
        time: i64,
    },
}

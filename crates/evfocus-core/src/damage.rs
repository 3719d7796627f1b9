//! What was found wrong with a stream of events.

/// Counters of everything that a decoder or reader found amiss; all zero for a sound recording.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Damage {
    /// Events before the first word that tells the time; a recording cut from the middle of a stream begins with some.
    pub events_before_time: u64,
    /// Events before the first row, column or vector base that they need.
    pub events_before_address: u64,
    /// Events with a coordinate that the sensor does not have.
    pub outside_sensor: u64,
    /// Events too far in time from the first of their batch to be kept with it; no sound stream has any.
    pub too_far_in_time: u64,
    /// Events that the camera says it dropped because there were too many.
    pub dropped_by_camera: u64,
    /// Steps of the camera's time that are neither 0 nor 1 of its coarse unit: data was lost there.
    pub time_jumps: u64,
    /// Events that are earlier than the event before them.
    pub time_reversals: u64,
    /// Resets of the camera's clock in mid-stream; time starts again from zero.
    pub timestamp_resets: u64,
    /// Words of a kind that the format does not define.
    pub unknown_words: u64,
    /// Packets whose content could not be decoded and was skipped.
    pub bad_packets: u64,
    /// Bytes of an incomplete word or packet at the end.
    pub trailing_bytes: u64,
}

impl Damage {
    /// All counters with their names, in the order of the fields.
    pub fn counters(&self) -> [(&'static str, u64); 11] {
        [
            ("events_before_time", self.events_before_time),
            ("events_before_address", self.events_before_address),
            ("outside_sensor", self.outside_sensor),
            ("too_far_in_time", self.too_far_in_time),
            ("dropped_by_camera", self.dropped_by_camera),
            ("time_jumps", self.time_jumps),
            ("time_reversals", self.time_reversals),
            ("timestamp_resets", self.timestamp_resets),
            ("unknown_words", self.unknown_words),
            ("bad_packets", self.bad_packets),
            ("trailing_bytes", self.trailing_bytes),
        ]
    }

    /// Whether nothing was found wrong.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

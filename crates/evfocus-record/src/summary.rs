//! What a recording holds, counted in one pass.

use std::path::Path;

use evfocus_core::{Damage, Event, EventBatch, EventRate, Geometry};

use crate::{Format, MAX_EVENTS_PER_READ, RecordError, Recording};

/// A silence longer than this is a gap, in microseconds.
pub const GAP_US: i64 = 100_000;
/// The peak rate is that of the busiest window of this length, in microseconds; windows lie end to end from the first event.
pub const PEAK_WINDOW_US: i64 = 10_000;

/// Counts over a whole recording.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Summary {
    /// What the file is.
    pub format: Format,
    /// The sensor's size; `None` for a file that neither tells it nor has events.
    pub geometry: Option<Geometry>,
    /// Whether the size is only that of the rectangle from (0, 0) that holds all events.
    pub geometry_inferred: bool,
    /// Number of events.
    pub events: u64,
    /// Events that are ON.
    pub on: u64,
    /// Events that are OFF.
    pub off: u64,
    /// Time of the first event in the file, microseconds.
    pub first_t_us: Option<i64>,
    /// Time of the last event in the file, microseconds.
    pub last_t_us: Option<i64>,
    /// Events over the time from first to last; `None` if that is not above zero.
    pub mean_rate: Option<EventRate>,
    /// The rate in the busiest window of [`PEAK_WINDOW_US`].
    pub peak_rate: Option<EventRate>,
    /// Silences longer than [`GAP_US`].
    pub gaps: u64,
    /// The longest silence between two events, gap or not, microseconds.
    pub longest_silence_us: i64,
    /// Sum of all columns.
    pub sum_x: u64,
    /// Sum of all rows.
    pub sum_y: u64,
    /// Sum of all times, microseconds.
    pub sum_t_us: i128,
    /// Edges at the camera's external inputs; `None` if the format does not tell.
    pub triggers: Option<u64>,
    /// What was found wrong.
    pub damage: Damage,
}

impl Summary {
    /// Counts over the file at `path`; see [`Recording::open`].
    ///
    /// # Errors
    /// Those of [`Recording::open`] and [`Recording::read`].
    pub fn of_file(path: impl AsRef<Path>, format: Option<Format>) -> Result<Self, RecordError> {
        Self::of(&mut Recording::open(path, format)?)
    }

    /// Counts over what has not yet been read of `recording`.
    ///
    /// # Errors
    /// Those of [`Recording::read`].
    pub fn of(recording: &mut Recording) -> Result<Self, RecordError> {
        let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
        let mut tally = Tally::default();
        while recording.read(&mut batch)? {
            batch.events.iter().for_each(|event| tally.add(&event));
        }
        Ok(tally.summary(recording))
    }
}

#[derive(Debug, Default)]
struct Tally {
    events: u64,
    on: u64,
    first: Option<i64>,
    last: i64,
    max_x: u16,
    max_y: u16,
    sum_x: u64,
    sum_y: u64,
    sum_t: i128,
    gaps: u64,
    longest_silence: i64,
    window_start: i64,
    window_events: u64,
    peak_events: u64,
}

impl Tally {
    fn add(&mut self, event: &Event) {
        let t = event.t.0;
        if self.first.is_none() {
            self.first = Some(t);
            self.window_start = t;
            self.last = t;
        }
        let silence = t.saturating_sub(self.last);
        self.gaps += u64::from(silence > GAP_US);
        self.longest_silence = self.longest_silence.max(silence);
        self.last = t;
        self.events += 1;
        self.on += u64::from(event.polarity.is_on());
        self.max_x = self.max_x.max(event.x);
        self.max_y = self.max_y.max(event.y);
        self.sum_x += u64::from(event.x);
        self.sum_y += u64::from(event.y);
        self.sum_t += i128::from(t);
        self.window(t);
    }

    /// Counts the event in its window. One that is a little late counts in the window under way; after a step back by more
    /// than a window (a reset of the clock) windows begin anew.
    fn window(&mut self, t: i64) {
        let windows = t.saturating_sub(self.window_start) / PEAK_WINDOW_US;
        if windows != 0 {
            self.window_start = self.window_start.saturating_add(windows.saturating_mul(PEAK_WINDOW_US));
            self.window_events = 0;
        }
        self.window_events += 1;
        self.peak_events = self.peak_events.max(self.window_events);
    }

    fn summary(&self, recording: &Recording) -> Summary {
        let rate = |events: u64, micros: i64| EventRate(events as f64 * 1e6 / micros as f64);
        let duration = self.first.map(|first| self.last.saturating_sub(first));
        let any = self.first.is_some();
        // Columns go up to 65535, and a width of 65536 does not fit: it is off by one there, where no sensor is.
        let inferred = Geometry { width: self.max_x.saturating_add(1), height: self.max_y.saturating_add(1) };
        Summary {
            format: recording.format(),
            geometry: recording.geometry().or(any.then_some(inferred)),
            geometry_inferred: any && recording.geometry().is_none(),
            events: self.events,
            on: self.on,
            off: self.events - self.on,
            first_t_us: self.first,
            last_t_us: any.then_some(self.last),
            mean_rate: duration.filter(|&micros| micros > 0).map(|micros| rate(self.events, micros)),
            peak_rate: any.then(|| rate(self.peak_events, PEAK_WINDOW_US)),
            gaps: self.gaps,
            longest_silence_us: self.longest_silence,
            sum_x: self.sum_x,
            sum_y: self.sum_y,
            sum_t_us: self.sum_t,
            triggers: recording.triggers(),
            damage: recording.damage(),
        }
    }
}

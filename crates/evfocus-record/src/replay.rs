//! A recording as a camera.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use evfocus_core::{CameraMicros, EventBatch, EventList, Events, Geometry, HostMicros};
use evfocus_hal::{Camera, CameraInfo, Clock, DeviceError, DeviceErrorKind};

use crate::{MAX_EVENTS_PER_READ, RecordError, Recording, Summary};

/// A camera sends what it has about this often; so does the replay, rather than event by event.
const PACKET: Duration = Duration::from_millis(1);
/// Times in a recording that fall by no more than this are out of order; by more, the camera's clock has started anew.
const DISORDER_US: i64 = 10_000;

/// How fast a recording is played.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReplayPace {
    /// As it was recorded.
    #[default]
    RealTime,
    /// As fast as it is read. Camera time then runs faster than the host's, so nothing can be related to the lens's positions.
    AsFastAsPossible,
}

/// What comes after the last event.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ReplayEnd {
    /// The first one again, a microsecond later: a camera that never ends.
    #[default]
    Repeat,
    /// The camera is gone, until it is started again.
    Disconnect,
}

/// Plays a recording, whatever its format.
///
/// Times are those of the recording. Where they fall, which a camera's never do, they stand still if the events are only out of
/// order, and go on from the newest if the camera's clock had started anew.
pub struct ReplayCamera {
    path: PathBuf,
    geometry: Geometry,
    pace: ReplayPace,
    end: ReplayEnd,
    clock: Arc<dyn Clock>,
    playing: Option<Playing>,
}

impl std::fmt::Debug for ReplayCamera {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ReplayCamera").field("path", &self.path).finish_non_exhaustive()
    }
}

impl ReplayCamera {
    /// A camera that plays the recording at `path`. A file that does not tell the size of its sensor is read once for it.
    ///
    /// # Errors
    /// Those of [`Recording::open`] and [`Recording::read`]; a recording without events.
    pub fn open(
        path: impl AsRef<Path>,
        pace: ReplayPace,
        end: ReplayEnd,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, RecordError> {
        let path = path.as_ref().to_owned();
        let empty = || RecordError::Unrecognised {
            path: path.clone(),
            found: "it holds no events".to_owned(),
            remedy: "replay one that does".to_owned(),
        };
        let mut recording = Recording::open(&path, None)?;
        let geometry = match recording.geometry() {
            Some(geometry) => {
                let mut batch = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
                recording.read(&mut batch)?.then_some(geometry)
            }
            None => Summary::of(&mut recording)?.geometry,
        };
        let geometry = geometry.ok_or_else(empty)?;
        Ok(Self { path, geometry, pace, end, clock, playing: None })
    }
}

fn error(kind: DeviceErrorKind, what: impl Into<String>) -> DeviceError {
    DeviceError::new(kind, "replay", what)
}

fn fault(cause: &RecordError) -> DeviceError {
    error(DeviceErrorKind::Fault, format!("playing the recording: {cause}"))
}

impl Camera for ReplayCamera {
    fn info(&self) -> CameraInfo {
        let serial = self.path.file_name().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned();
        CameraInfo { model: "replay".to_owned(), serial, geometry: self.geometry, rate_ceiling: None }
    }

    fn start(&mut self) -> Result<(), DeviceError> {
        if self.playing.is_none() {
            let recording = Recording::open(&self.path, None).map_err(|cause| fault(&cause))?;
            self.playing = Some(Playing::new(recording, self.clock.now()));
        }
        Ok(())
    }

    fn stop(&mut self) -> Result<(), DeviceError> {
        self.playing = None;
        Ok(())
    }

    fn read(&mut self, batch: &mut EventBatch, timeout: Duration) -> Result<(), DeviceError> {
        batch.clear();
        let Some(mut playing) = self.playing.take() else {
            let what = "read before start; start the camera first";
            return Err(error(DeviceErrorKind::NotStarted, what));
        };
        let deadline = self.clock.now() + timeout;
        loop {
            if playing.pending().is_empty() && !playing.fetch(self.end).map_err(|cause| fault(&cause))? {
                let what = format!("{}: the recording has ended", self.path.display());
                return Err(error(DeviceErrorKind::Disconnected, what));
            }
            let now = self.clock.now();
            let until = match self.pace {
                ReplayPace::RealTime => playing.camera_time(now),
                ReplayPace::AsFastAsPossible => i64::MAX,
            };
            playing.deliver(until, batch);
            batch.arrival = now;
            if !batch.events.is_empty() || now >= deadline {
                self.playing = Some(playing);
                return Ok(());
            }
            let next = playing.pending().first().map_or(now, |event| playing.host_time(event.t));
            self.clock.sleep_until(next.max(now + PACKET).min(deadline));
        }
    }
}

/// A recording being played.
struct Playing {
    recording: Recording,
    /// What was read.
    fetched: EventBatch,
    /// Those, with times that never fall.
    timed: EventList,
    /// Events that could not be kept, and nobody has been told of.
    lost: u64,
    /// How many of those have been delivered.
    delivered: usize,
    /// Camera time and host time that belong together.
    origin: Option<(CameraMicros, HostMicros)>,
    started: HostMicros,
    /// Added to the recording's times.
    shift_us: i64,
    /// Newest time as recorded, and as delivered.
    newest: Option<(i64, i64)>,
}

impl Playing {
    fn new(recording: Recording, started: HostMicros) -> Self {
        let fetched = EventBatch::with_capacity(MAX_EVENTS_PER_READ);
        Self {
            recording,
            fetched,
            timed: EventList::with_capacity(MAX_EVENTS_PER_READ),
            lost: 0,
            delivered: 0,
            origin: None,
            started,
            shift_us: 0,
            newest: None,
        }
    }

    fn pending(&self) -> Events<'_> {
        self.timed.as_slice().from(self.delivered)
    }

    /// Reads on; `false` at the end of a recording that is not repeated.
    fn fetch(&mut self, end: ReplayEnd) -> Result<bool, RecordError> {
        self.delivered = 0;
        if !self.recording.read(&mut self.fetched)? {
            if end == ReplayEnd::Disconnect {
                return Ok(false);
            }
            self.recording = Recording::open(self.recording.path(), None)?;
            if !self.recording.read(&mut self.fetched)? {
                // It had events when it was opened.
                return Ok(false);
            }
            if let (Some((_, newest)), Some(first)) = (self.newest, self.fetched.events.first()) {
                self.shift_us = newest.saturating_add(1).saturating_sub(first.t.0);
                self.newest = None;
            }
        }
        let mut newest = self.newest;
        self.timed.clear();
        for mut event in self.fetched.events.iter() {
            let recorded = event.t.0;
            if let Some((last, delivered)) = newest
                && recorded < last.saturating_sub(DISORDER_US)
            {
                self.shift_us = delivered.saturating_sub(recorded);
            }
            let time = recorded.saturating_add(self.shift_us);
            let time = newest.map_or(time, |(_, delivered)| time.max(delivered));
            newest = Some((recorded, time));
            event.t = CameraMicros(time);
            self.lost += u64::from(self.timed.push(event).is_err());
        }
        self.newest = newest;
        if self.origin.is_none() {
            self.origin = self.timed.first().map(|event| (event.t, self.started));
        }
        Ok(true)
    }

    /// The camera time, microseconds, that `now` is in real time.
    fn camera_time(&self, now: HostMicros) -> i64 {
        self.origin.map_or(i64::MIN, |(camera, host)| camera.0.saturating_add(now.micros_since(host)))
    }

    fn host_time(&self, time: CameraMicros) -> HostMicros {
        self.origin.map_or(self.started, |(camera, host)| {
            HostMicros(host.0.saturating_add(time.micros_since(camera)))
        })
    }

    /// Moves the events up to `until` into `batch`, as far as there is room.
    fn deliver(&mut self, until: i64, batch: &mut EventBatch) {
        let pending = self.pending();
        let due = pending.first_at_or_after(CameraMicros(until.saturating_add(1)));
        let count = due.min(batch.events.room());
        let delivered = pending.range(0..count);
        let is_complete = count == due && count < pending.len() && until < i64::MAX;
        let newest = delivered.last().map(|event| event.t);
        batch.lost += batch.events.append(delivered.iter()) + self.lost;
        self.lost = 0;
        self.delivered += count;
        batch.reached = if is_complete { Some(CameraMicros(until)) } else { newest.or(batch.reached) };
    }
}

//! Camera time to host time, from arrival times alone.
//!
//! A transfer never arrives before its last event happened, so `arrival - camera time` is the clocks' offset plus a delay
//! that is never negative. The lower envelope of these points, a supporting line under all of them, is the offset plus the
//! smallest delay; its slope is the drift (Moon, Skelly, Towsley: "Estimation and removal of clock skew from network delay
//! measurements", INFOCOM 1999).

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::time::Duration;

use crate::units::{CameraMicros, HostMicros};

/// Host time that one point of the envelope stands for.
const BUCKET: Duration = Duration::from_millis(100);
/// Envelope points kept: 12.8 s, over which 10 ppm of drift are 128 us.
const BUCKETS: usize = 128;
/// Camera time that the envelope must span before its slope is believed.
const SHORTEST_BASELINE_US: i64 = 1_000_000;
/// Crystals stay within 100 ppm; a steeper slope comes from delays, not from a clock.
const STEEPEST_DRIFT: f64 = 500e-6;
/// Camera time may step back this far within ordinary disorder, microseconds.
const DISORDER_US: i64 = 10_000;
/// A transfer that arrives this much earlier than the smallest delay seen so far allows comes from a new time base; smaller steps
/// only mean that every transfer before was late. Microseconds.
const LEAP_US: f64 = 1_000_000.0;

/// What an observation told about the camera's clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ClockEvent {
    /// Time went on.
    Steady,
    /// The camera's counter wrapped; the map goes on.
    Wrapped,
    /// The camera's clock started anew: earlier camera times can no longer be converted.
    Reset,
}

/// How good the map is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ClockMapQuality {
    /// Observations since the last reset.
    pub observations: u64,
    /// Clock resets seen since the map was made.
    pub resets: u32,
    /// Host time minus camera time at the newest observation, microseconds.
    pub offset_us: f64,
    /// How much faster host time runs, parts per million.
    pub drift_ppm: f64,
    /// Mean arrival delay above the envelope, microseconds.
    pub mean_delay_us: f64,
    /// Root mean square distance of the envelope's points from the line, microseconds: what the conversion may err by.
    pub residual_us: f64,
}

/// The map.
#[derive(Debug, Clone)]
pub struct ClockMap {
    wrap_period_us: Option<i64>,
    wraps: i64,
    last: Option<(CameraMicros, HostMicros)>,
    /// The lowest point of each bucket: unwrapped camera time and arrival minus camera time, microseconds.
    envelope: VecDeque<(i64, i64)>,
    bucket_end: HostMicros,
    hull: Vec<(i64, i64)>,
    line: Line,
    observations: u64,
    resets: u32,
    delay_sum_us: f64,
}

/// offset(camera) = offset_us + slope * (camera - camera_us)
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    camera_us: i64,
    offset_us: f64,
    slope: f64,
}

impl Line {
    fn offset_at(&self, camera_us: i64) -> f64 {
        self.offset_us + self.slope * camera_us.saturating_sub(self.camera_us) as f64
    }
}

/// From point `a` to point `b`, without overflow.
fn difference(a: (i64, i64), b: (i64, i64)) -> (i128, i128) {
    (i128::from(b.0) - i128::from(a.0), i128::from(b.1) - i128::from(a.1))
}

/// No camera time has been seen yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("camera and host time cannot be related: the camera has not sent any time yet")]
pub struct NoClockYet;

impl ClockMap {
    /// An empty map. `wrap_period`: after how long the camera's counter starts anew at zero, if the driver does not unwrap it.
    pub fn new(wrap_period: Option<Duration>) -> Self {
        Self {
            wrap_period_us: wrap_period
                .and_then(|period| i64::try_from(period.as_micros()).ok())
                .filter(|&period| period > 0),
            wraps: 0,
            last: None,
            envelope: VecDeque::with_capacity(BUCKETS + 1),
            bucket_end: HostMicros(i64::MIN),
            hull: Vec::with_capacity(BUCKETS + 1),
            line: Line::default(),
            observations: 0,
            resets: 0,
            delay_sum_us: 0.0,
        }
    }

    /// `raw` as a time that does not wrap, taken to lie within half a wrap period of the newest observation.
    pub fn unwrap_time(&self, raw: CameraMicros) -> CameraMicros {
        self.last.map_or(raw, |(last, _)| self.unwrap_near(raw, last).0)
    }

    /// `raw` with as many wrap periods added as bring it nearest to `expected`, and how many those are.
    fn unwrap_near(&self, raw: CameraMicros, expected: CameraMicros) -> (CameraMicros, i64) {
        let Some(period) = self.wrap_period_us else { return (raw, 0) };
        let wraps = expected.micros_since(raw).saturating_add(period / 2).div_euclid(period);
        (CameraMicros(raw.0.saturating_add(wraps.saturating_mul(period))), wraps)
    }

    /// Takes note that a transfer complete up to `raw` camera time arrived at `arrival`. Constant time, no allocation.
    pub fn observe(&mut self, raw: CameraMicros, arrival: HostMicros) -> ClockEvent {
        let mut camera = raw;
        let mut event = ClockEvent::Steady;
        if let Some((last, last_arrival)) = self.last {
            // Host time tells how often the counter has wrapped while nothing arrived.
            let waited = arrival.since(last_arrival);
            let (unwrapped, wraps) = self.unwrap_near(raw, last + waited);
            let early_us = self.line.offset_at(unwrapped.0) - arrival.0.saturating_sub(unwrapped.0) as f64;
            if unwrapped.micros_since(last) < -DISORDER_US || early_us > LEAP_US {
                self.restart();
                event = ClockEvent::Reset;
            } else {
                camera = unwrapped;
                if wraps > self.wraps {
                    self.wraps = wraps;
                    event = ClockEvent::Wrapped;
                }
            }
        }
        self.last = Some((camera, arrival));
        self.add(camera, arrival);
        event
    }

    fn restart(&mut self) {
        self.resets += 1;
        self.wraps = 0;
        self.last = None;
        self.envelope.clear();
        self.bucket_end = HostMicros(i64::MIN);
        self.observations = 0;
        self.delay_sum_us = 0.0;
    }

    fn add(&mut self, camera: CameraMicros, arrival: HostMicros) {
        let point = (camera.0, arrival.0.saturating_sub(camera.0));
        self.observations += 1;
        if arrival >= self.bucket_end {
            self.refit();
            if self.envelope.len() == BUCKETS {
                self.envelope.pop_front();
            }
            self.envelope.push_back(point);
            self.bucket_end = arrival + BUCKET;
        } else if let Some(lowest) = self.envelope.back_mut() {
            // Lowest with the drift taken out: within a bucket, 100 ppm are 10 us.
            let line = self.line;
            let height = |(camera, offset): (i64, i64)| offset as f64 - line.offset_at(camera);
            if height(point) < height(*lowest) {
                *lowest = point;
            }
        }
        let above = point.1 as f64 - self.line.offset_at(point.0);
        if self.observations == 1 || above < 0.0 {
            // The envelope lies under every point: take the line down to this one at once.
            let slope = if self.observations == 1 { 0.0 } else { self.line.slope };
            self.line = Line { camera_us: point.0, offset_us: point.1 as f64, slope };
        } else {
            self.delay_sum_us += above;
        }
    }

    /// The line through the edge of the lower convex hull that lies under the middle of the points: of all lines below
    /// every point, the one with the least mean distance to them.
    fn refit(&mut self) {
        let (Some(&(first, _)), Some(&(last, _))) = (self.envelope.front(), self.envelope.back()) else {
            return;
        };
        if last.saturating_sub(first) < SHORTEST_BASELINE_US {
            return;
        }
        self.hull.clear();
        for &point in &self.envelope {
            while let [.., a, b] = self.hull.as_slice() {
                // 128 bits: microseconds since 1970 squared do not fit 64 bits.
                let (ab_camera, ab_offset) = difference(*a, *b);
                let (ap_camera, ap_offset) = difference(*a, point);
                if ab_camera.saturating_mul(ap_offset) > ap_camera.saturating_mul(ab_offset) {
                    break;
                }
                self.hull.pop();
            }
            // Equal camera times (no new time words) leave the lower point.
            match self.hull.last_mut() {
                Some(b) if b.0 >= point.0 => b.1 = b.1.min(point.1),
                _ => self.hull.push(point),
            }
        }
        let since_first = |camera: i64| camera.saturating_sub(first) as f64;
        let count = self.envelope.len() as f64;
        let mean = self.envelope.iter().map(|&(camera, _)| since_first(camera)).sum::<f64>() / count;
        let edge = self.hull.windows(2).find(|edge| matches!(edge, [_, b] if since_first(b.0) >= mean));
        if let Some(&[a, b]) = edge {
            let (camera, offset) = difference(a, b);
            let slope = (offset as f64 / camera as f64).clamp(-STEEPEST_DRIFT, STEEPEST_DRIFT);
            self.line = Line { camera_us: a.0, offset_us: a.1 as f64, slope };
            let lowest = self
                .envelope
                .iter()
                .map(|&(camera, offset)| offset as f64 - self.line.offset_at(camera))
                .fold(0.0, f64::min);
            self.line.offset_us += lowest;
        }
    }

    /// The host time at `camera` (unwrapped, of the present time base).
    ///
    /// # Errors
    /// [`NoClockYet`] before the first observation.
    pub fn to_host(&self, camera: CameraMicros) -> Result<HostMicros, NoClockYet> {
        self.last.ok_or(NoClockYet)?;
        Ok(HostMicros(camera.0.saturating_add(libm::round(self.line.offset_at(camera.0)) as i64)))
    }

    /// The camera time at `host`.
    ///
    /// # Errors
    /// [`NoClockYet`] before the first observation.
    pub fn to_camera(&self, host: HostMicros) -> Result<CameraMicros, NoClockYet> {
        self.last.ok_or(NoClockYet)?;
        let line = &self.line;
        let since = host.0.saturating_sub(line.camera_us) as f64 - line.offset_us;
        Ok(CameraMicros(line.camera_us.saturating_add(libm::round(since / (1.0 + line.slope)) as i64)))
    }

    /// The newest unwrapped camera time seen.
    pub fn newest(&self) -> Option<CameraMicros> {
        self.last.map(|(camera, _)| camera)
    }

    /// How good the map is.
    pub fn quality(&self) -> ClockMapQuality {
        let Some((newest, _)) = self.last else {
            return ClockMapQuality { resets: self.resets, ..ClockMapQuality::default() };
        };
        let squares: f64 = self
            .envelope
            .iter()
            .map(|&(camera, offset)| {
                let above = offset as f64 - self.line.offset_at(camera);
                above * above
            })
            .sum();
        ClockMapQuality {
            observations: self.observations,
            resets: self.resets,
            offset_us: self.line.offset_at(newest.0),
            drift_ppm: self.line.slope * 1e6,
            mean_delay_us: self.delay_sum_us / self.observations.max(1) as f64,
            residual_us: libm::sqrt(squares / self.envelope.len().max(1) as f64),
        }
    }
}

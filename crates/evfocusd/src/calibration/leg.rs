//! One motion that is measured: is it over, and what do its positions say?

use std::time::Duration;

use evfocus_core::{HostMicros, LensPosition, LensSample};

/// A lens that does not change its position for this long, and is not where it was sent, has come to an end of its way.
const STANDSTILL: Duration = Duration::from_secs(2);
/// A lens that reports a fault after it has not changed its position for this long has been blocked.
const BLOCKED: Duration = Duration::from_millis(50);
/// A lens that was stopped, says that it rests, and has kept its position for this long, does rest.
const SETTLED: Duration = Duration::from_millis(300);
/// The slowest lens needs less for its range.
const LONGEST: Duration = Duration::from_secs(300);

/// What has become of a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Progress {
    UnderWay,
    /// At rest where it was sent, or where it was stopped.
    Rested,
    /// At rest before.
    Short,
    /// It goes the other way.
    WrongWay,
    Overdue,
}

/// A motion and its positions.
#[derive(Debug, Clone)]
pub(super) struct Leg {
    pub(super) from: LensPosition,
    pub(super) target: LensPosition,
    ordered: HostMicros,
    stopped: Option<HostMicros>,
    /// Whether the lens itself has given up.
    blocked: bool,
    changed: (HostMicros, LensPosition),
    /// How near to its target a lens at rest has arrived, counts; less is no motion.
    tolerance: f64,
    pub(super) samples: Vec<LensSample>,
}

impl Leg {
    pub(super) fn new(from: LensPosition, target: LensPosition, ordered: HostMicros, tolerance: f64) -> Self {
        Self {
            from,
            target,
            ordered,
            stopped: None,
            blocked: false,
            changed: (ordered, from),
            tolerance,
            samples: Vec::new(),
        }
    }

    /// The lens was told to stop.
    pub(super) fn stop(&mut self, now: HostMicros) {
        self.stopped = Some(now);
    }

    /// The lens reported a fault. Whether it stood still then, as one does that has come to an end of its way; the leg ends with
    /// its next position.
    pub(super) fn block(&mut self) -> bool {
        let stood = self.samples.last().map(|last| last.time().since(self.changed.0));
        self.blocked = stood.is_some_and(|stood| stood >= BLOCKED);
        self.blocked
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stopped.is_some()
    }

    /// How much of its way the lens has made, 0 to 1.
    pub(super) fn share(&self) -> f64 {
        let way = self.target.counts_from(self.from);
        self.samples.last().map_or(0.0, |last| last.position.counts_from(self.from) / way)
    }

    pub(super) fn observe(&mut self, sample: LensSample) -> Progress {
        let (now, tolerance) = (sample.time(), self.tolerance);
        // What was asked before the order says nothing of it.
        if sample.requested <= self.ordered {
            return Progress::UnderWay;
        }
        self.samples.push(sample);
        if self.blocked {
            return Progress::Short;
        }
        if sample.position.distance(self.changed.1) > tolerance / 2.0 {
            self.changed = (now, sample.position);
        }
        let direction = self.target.counts_from(self.from).signum();
        if let Some(stopped) = self.stopped {
            // Some say that they rest as soon as they are told to, and run on.
            let has_settled = now.since(self.changed.0.max(stopped)) >= SETTLED;
            if sample.requested > stopped && !sample.moving && has_settled {
                return Progress::Rested;
            }
        } else if sample.position.distance(self.target) <= tolerance && !sample.moving {
            return Progress::Rested;
        } else if sample.position.counts_from(self.from) * direction < -5.0 * tolerance {
            return Progress::WrongWay;
        } else if now.since(self.changed.0) >= STANDSTILL {
            return Progress::Short;
        }
        if now.since(self.ordered) >= LONGEST { Progress::Overdue } else { Progress::UnderWay }
    }

    /// Where the lens came to rest.
    pub(super) fn rest(&self) -> LensPosition {
        self.samples.last().map_or(self.from, |last| last.position)
    }

    /// Counts per second over the middle half of the way: a straight line by least squares. Nothing if that has no three positions.
    pub(super) fn speed(&self) -> Option<f64> {
        let (from, way) = (self.from, self.rest().counts_from(self.from));
        let middle = self.samples.iter().filter(|sample| {
            let share = sample.position.counts_from(from) / way;
            (0.25..=0.75).contains(&share)
        });
        let points: Vec<(f64, f64)> =
            middle.map(|sample| (self.seconds(sample.time()), sample.position.0)).collect();
        let count = points.len() as f64;
        let mean = |value: fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / count;
        let (time, position) = (mean(|point| point.0), mean(|point| point.1));
        let spread: f64 = points.iter().map(|point| (point.0 - time).powi(2)).sum();
        let together: f64 = points.iter().map(|point| (point.0 - time) * (point.1 - position)).sum();
        (points.len() >= 3 && spread > 0.0).then(|| (together / spread).abs())
    }

    fn seconds(&self, time: HostMicros) -> f64 {
        time.micros_since(self.ordered) as f64 / 1e6
    }

    /// Positions per second: times that differ, from the first to the last.
    pub(super) fn read_back_hz(&self) -> f64 {
        let mut times: Vec<_> = self.samples.iter().map(LensSample::time).collect();
        times.dedup();
        match (times.first(), times.last()) {
            (Some(first), Some(last)) if last > first => {
                (times.len() - 1) as f64 / last.since(*first).as_secs_f64()
            }
            _ => 0.0,
        }
    }

    /// From question to answer, microseconds, the median.
    pub(super) fn read_back_us(&self) -> f64 {
        let mut trips: Vec<_> =
            self.samples.iter().map(|sample| sample.replied.micros_since(sample.requested)).collect();
        trips.sort_unstable();
        trips.get(trips.len() / 2).copied().unwrap_or(0) as f64
    }

    /// From the order to the first motion by more than `noticeable`, microseconds: the middle between the last position without
    /// and the first one with it.
    pub(super) fn latency_us(&self, noticeable: f64) -> Option<f64> {
        let moved =
            self.samples.iter().position(|sample| sample.position.distance(self.from) > noticeable)?;
        let after = self.seconds(self.samples.get(moved)?.time());
        let before = moved.checked_sub(1).and_then(|index| self.samples.get(index));
        let before = before.map_or(0.0, |sample| self.seconds(sample.time()));
        Some(f64::midpoint(before, after) * 1e6)
    }

    /// From the order to stop until the lens stood, microseconds, and how far it went on, counts.
    pub(super) fn stopping(&self, noticeable: f64) -> Option<(f64, f64)> {
        let stopped = self.stopped?;
        let rest = self.samples.last()?.position;
        let at = self.samples.iter().rev().find(|sample| sample.time() <= stopped)?;
        let next = self.samples.iter().find(|sample| sample.time() > stopped)?;
        let share =
            stopped.micros_since(at.time()) as f64 / next.time().micros_since(at.time()).max(1) as f64;
        let at_order = at.position.0 + share * next.position.counts_from(at.position);
        let last_moving =
            self.samples.iter().rposition(|sample| sample.position.distance(rest) > noticeable)?;
        let [before, after] = [last_moving, last_moving + 1]
            .map(|index| self.samples.get(index).map(|sample| self.seconds(sample.time())));
        let stood = f64::midpoint(before?, after?);
        Some(((stood - self.seconds(stopped)).max(0.0) * 1e6, (rest.0 - at_order).abs()))
    }
}

/// Root mean square about the mean.
pub(super) fn noise(positions: &[f64]) -> f64 {
    let count = positions.len().max(1) as f64;
    let mean = positions.iter().sum::<f64>() / count;
    (positions.iter().map(|position| (position - mean).powi(2)).sum::<f64>() / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions every 10 ms of a lens that waits for 35 ms and then goes 1000 counts a second to 500, where it is said to rest.
    fn leg(wait_ms: i64) -> (Leg, Progress) {
        let mut leg = Leg::new(LensPosition(100.0), LensPosition(500.0), HostMicros(0), 2.0);
        let mut progress = Progress::UnderWay;
        for time_ms in (0..1000).step_by(10).skip(1) {
            let position = 100.0 + (time_ms - wait_ms).clamp(0, 400) as f64;
            let time = HostMicros(time_ms * 1000);
            let (position, moving) = (LensPosition(position), position < 500.0);
            progress = leg.observe(LensSample { requested: time, replied: time, position, moving });
            if progress != Progress::UnderWay {
                break;
            }
        }
        (leg, progress)
    }

    #[test]
    fn a_motion_is_measured() {
        let (leg, progress) = leg(35);
        assert_eq!((progress, leg.rest()), (Progress::Rested, LensPosition(500.0)));
        assert!((leg.speed().unwrap() - 1000.0).abs() < 1e-6);
        assert!((leg.read_back_hz() - 100.0).abs() < 1e-6);
        assert!((leg.latency_us(1.0).unwrap() - 35_000.0).abs() <= 5000.0);
    }

    #[test]
    fn what_is_no_arrival_is_told_apart() {
        let go = |position: fn(i64) -> f64, until_ms: i64| {
            let mut leg = Leg::new(LensPosition(100.0), LensPosition(500.0), HostMicros(0), 2.0);
            let ended = (10..until_ms).step_by(10).find_map(|time_ms| {
                let time = HostMicros(time_ms * 1000);
                let position = LensPosition(position(time_ms));
                let sample = LensSample { requested: time, replied: time, position, moving: true };
                Some(leg.observe(sample)).filter(|progress| *progress != Progress::UnderWay)
            });
            ended.unwrap()
        };
        assert_eq!(go(|ms| 100.0 + ms.min(200) as f64, 3000), Progress::Short);
        assert_eq!(go(|ms| 100.0 - ms as f64, 3000), Progress::WrongWay);
        assert_eq!(go(|ms| 100.0 + ms as f64 * 0.001, 400_000), Progress::Overdue);
    }

    #[test]
    fn a_stop_is_measured() {
        let mut leg = Leg::new(LensPosition(0.0), LensPosition(500.0), HostMicros(0), 2.0);
        for time_ms in (0..600).step_by(5).skip(1) {
            let time = HostMicros(time_ms * 1000);
            if time_ms == 205 {
                leg.stop(time);
            }
            // Told to stop at 205, it goes on until 240.
            let position = LensPosition(time_ms.min(240) as f64);
            let moving = time_ms < 260;
            leg.observe(LensSample { requested: time, replied: time, position, moving });
        }
        let (stop_us, counts) = leg.stopping(0.5).unwrap();
        assert!((stop_us - 35_000.0).abs() <= 5000.0 && (counts - 35.0).abs() < 1e-6, "{stop_us} {counts}");
    }
}

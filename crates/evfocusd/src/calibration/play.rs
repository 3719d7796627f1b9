//! Play between what a lens says and its glass, by what the camera sees: the two ways of a sweep differ by the play, whatever the
//! speed, and by what pixels and positions are late by, in proportion to it. Sweeps at two speeds tell one from the other.

use evfocus_core::RunReport;

/// How far the way up lies beyond the way down, of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Difference {
    /// Counts per second.
    pub(super) speed: f64,
    /// Counts.
    pub(super) counts: f64,
    /// One standard deviation, counts.
    scatter: f64,
    /// Where the peak is, and its width at half its height, counts.
    pub(super) position: f64,
    pub(super) width: f64,
}

/// What two runs say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Play {
    pub(super) counts: f64,
    /// One standard deviation, counts.
    pub(super) error_bar: f64,
    pub(super) lag_s: f64,
}

impl Difference {
    /// Of a run, whether or not it was content with its answer.
    ///
    /// # Errors
    /// Why there is none, in words.
    pub(super) fn of(run: &RunReport) -> Result<Self, String> {
        let mut answers = run.sweeps().map(|sweep| sweep.structure);
        let mut next = || match answers.next().flatten() {
            Some(Ok(answer)) => {
                answer.significant().map_err(|error| format!("a sweep showed no clear peak: {error}"))
            }
            Some(Err(error)) => Err(format!("a sweep showed no peak: {error}")),
            None => Err(format!("the focus run ended as {:?}", run.outcome)),
        };
        let (up, down) = (next()?, next()?);
        Ok(Self {
            speed: f64::midpoint(up.velocity.abs(), down.velocity.abs()),
            counts: up.position.counts_from(down.position),
            scatter: up.scatter.hypot(down.scatter),
            position: f64::midpoint(up.position.0, down.position.0),
            width: up.width.max(down.width),
        })
    }
}

impl Play {
    /// From runs at two speeds: difference = play + 2 x speed x lag. Nothing if the speeds are too much alike.
    pub(super) fn of(one: Difference, other: Difference) -> Option<Self> {
        let apart = other.speed - one.speed;
        if apart.abs() < 0.2 * one.speed.max(other.speed) {
            return None;
        }
        Some(Self {
            counts: (one.counts * other.speed - other.counts * one.speed) / apart,
            error_bar: ((one.scatter * other.speed).hypot(other.scatter * one.speed) / apart).abs(),
            lag_s: (other.counts - one.counts) / apart / 2.0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn peak() -> Difference {
        Difference { speed: 0.0, counts: 0.0, scatter: 1.0, position: 500.0, width: 100.0 }
    }

    #[test]
    fn play_and_lag_are_told_apart() {
        let run = |speed: f64| Difference { speed, counts: 15.0 + 2.0 * speed * 0.006, ..peak() };
        let play = Play::of(run(900.0), run(450.0)).unwrap();
        assert!((play.counts - 15.0).abs() < 1e-9 && (play.lag_s - 0.006).abs() < 1e-12, "{play:?}");
        // sqrt(900^2 + 450^2) / 450
        assert!((play.error_bar - 5.0_f64.sqrt()).abs() < 1e-9, "{play:?}");
        assert_eq!(Play::of(run(900.0), run(850.0)), None);
    }
}

//! Two sweeps in opposite directions, taken together.

use super::chosen::Chosen;
use super::{Answer, Prefer, Rules, by_structure};
use crate::delay::Delay;
use crate::report::{Failure, LegReport, Suspicion};
use crate::search::Method;
use crate::units::LensPosition;

/// Two answers that are too weak to be believed alone are believed together if they say the same and their significances, added as
/// squares, come to this: chance makes hardly ever one such peak, and does not make the second one at the same place.
const LEAST_TOGETHER: f64 = 11.0;
/// What both ways err by alike, as a part of the peak's width: blur that is not the same on both sides of focus, a picture that
/// grows as the lens goes. It does not average out.
const COMMON: f64 = 0.015;

/// What two sweeps say. One that says nothing leaves the answer of the other, with a flag.
pub(super) fn by_structure_both_ways(
    first: &LegReport,
    second: &LegReport,
    rules: &Rules,
) -> Result<Answer, Failure> {
    let there = Chosen::of(first, rules);
    // The way back is asked for the same thing.
    let window = there.ok().and_then(|there| there.window);
    let same = Rules { prefer: window.map_or(rules.prefer, Prefer::Window), ..*rules };
    let back = Chosen::of(second, &same).map(|back| back.with_backlash(rules));
    let alone = [there, back].map(|way| way.and_then(|way| way.alone(rules)));
    if let (Ok(there), Ok(back)) = (there, back) {
        let together = libm::hypot(there.structure.significance, back.structure.significance);
        let is_clear = !there.structure.is_unsure && !back.structure.is_unsure;
        // A faint peak elsewhere is still a contradiction.
        if is_clear && together >= LEAST_TOGETHER {
            return combine(&there, &back, rules);
        }
    }
    let [there, back] = alone;
    let (believed, failure) = match (there, back) {
        (Err(failure), Ok(back)) => (back, failure),
        (there, Err(failure)) => (there?, failure),
        (Ok(there), Ok(back)) => return combine(&there, &back, rules),
    };
    // What lies beyond the range for one way lies beyond it for the other too.
    if let Failure::PeakAtEdge { position } = failure {
        let believed = believed.position;
        let (forward, backward) = if there.is_ok() { (believed, position) } else { (position, believed) };
        return Err(Failure::DirectionMismatch { forward, backward, suspicion: Suspicion::DifferentPeaks });
    }
    let flag = failure.doubt().ok_or(failure)?;
    let mut answer = by_structure(&believed, rules);
    answer.flags.set(flag, true);
    Ok(answer)
}

/// Both answers together, each weighted by how sure it is of itself, and what is known of the delay beforehand. Of two that are
/// equally sure it is the mean, from which the delay drops out.
fn combine(there: &Chosen, back: &Chosen, rules: &Rules) -> Result<Answer, Failure> {
    let mut back = *back;
    // Which of two depths is the stronger may differ from one way to the other.
    if let Some(other) = back.second_depth
        && other.distance(there.position) < back.position.distance(there.position)
    {
        back.second_depth = Some(core::mem::replace(&mut back.position, other));
    }
    let speed = f64::midpoint(libm::fabs(there.structure.velocity), libm::fabs(back.structure.velocity));
    let towards = there.towards();
    let noise_hz = f64::midpoint(there.structure.noise_hz, back.structure.noise_hz);
    let expected = rules.delays.at(noise_hz);
    let half_difference = there.position.counts_from(back.position) / 2.0;
    let scatter = libm::hypot(there.structure.scatter, back.structure.scatter) / 2.0;
    let excess = half_difference * towards - speed * expected.seconds;
    let uncertainty = libm::hypot(scatter, speed * expected.uncertainty_s);
    // Where the answers themselves agree, a delay other than expected is no fault: the expectation was wrong.
    let agree = libm::fabs(half_difference) <= rules.tolerance / 2.0;
    if !agree && libm::fabs(excess) > (3.0 * uncertainty).max(rules.tolerance / 2.0) {
        return Err(Failure::DirectionMismatch {
            forward: there.position,
            backward: back.position,
            suspicion: suspicion(excess, there.structure.width, rules),
        });
    }
    let lag = Lag { counts: towards * speed * expected.seconds, uncertainty: speed * expected.uncertainty_s };
    let fused = Fused::of(there, &back, lag);
    // What exceeds chance may be backlash, half of which stays in the mean.
    let beyond = (excess * excess - uncertainty * uncertainty).max(0.0) / 4.0;
    let second_depth = match (there.second_depth, back.second_depth) {
        (Some(one), Some(other)) => Some(LensPosition(f64::midpoint(one.0, other.0))),
        (Some(one), None) => Some(there.without_delay(one, rules)),
        (None, Some(other)) => Some(back.without_delay(other, rules)),
        (None, None) => None,
    };
    let measured = (speed > 0.0).then(|| {
        let delay = Delay { seconds: half_difference * towards / speed, uncertainty_s: scatter / speed };
        (noise_hz, delay)
    });
    let flags = there.flags.or(back.flags);
    let answer = Answer {
        second_depth,
        window: there.window,
        half_difference: Some(half_difference),
        width: Some(there.structure.width),
        measured,
        ..Answer::bare(fused.position, Method::Structure, flags)
    };
    let common = COMMON * there.structure.width;
    let error_bar = libm::sqrt(fused.error_bar * fused.error_bar + common * common + beyond);
    Ok(answer.sure_to(error_bar, rules))
}

/// How far the delay of the pixels puts the first answer beyond focus, counts, signed; as expected.
#[derive(Debug, Clone, Copy)]
struct Lag {
    counts: f64,
    uncertainty: f64,
}

#[derive(Debug, Clone, Copy)]
struct Fused {
    position: LensPosition,
    error_bar: f64,
}

impl Fused {
    /// Least squares for focus and lag from three equations: the first answer is focus plus the lag, the second focus less the lag, the
    /// lag is as expected; each weighted by the inverse of its variance.
    fn of(there: &Chosen, back: &Chosen, expected: Lag) -> Self {
        let weight = |sigma: f64| 1.0 / (sigma * sigma).max(f64::MIN_POSITIVE);
        let (first, second) = (weight(there.structure.scatter), weight(back.structure.scatter));
        let prior = weight(expected.uncertainty.max(f64::EPSILON));
        // Counted from the first answer, so that nothing is lost to rounding.
        let second_at = back.position.counts_from(there.position);
        let (focus_focus, focus_lag, lag_lag) = (first + second, first - second, first + second + prior);
        let (focus_side, lag_side) = (second * second_at, prior * expected.counts - second * second_at);
        let determinant = focus_focus * lag_lag - focus_lag * focus_lag;
        let focus = (focus_side * lag_lag - focus_lag * lag_side) / determinant;
        Self {
            position: LensPosition(there.position.0 + focus),
            error_bar: libm::sqrt(lag_lag / determinant),
        }
    }
}

fn suspicion(excess: f64, width: f64, rules: &Rules) -> Suspicion {
    if libm::fabs(excess) > width / 2.0 {
        Suspicion::DifferentPeaks
    } else if excess > 0.0 {
        Suspicion::Backlash { counts: rules.backlash + 2.0 * excess }
    } else {
        Suspicion::LatePositions
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::structure_answer;
    use super::*;
    use crate::flags::Flags;

    fn way(position: f64, scatter: f64, velocity: f64) -> Chosen {
        let structure = structure_answer(position, scatter, velocity);
        Chosen {
            structure,
            position: structure.position,
            second_depth: None,
            window: None,
            flags: Flags::default(),
        }
    }

    const LAG: Lag = Lag { counts: 10.0, uncertainty: 5.0 };

    #[test]
    fn of_two_equally_sure_ways_it_is_the_mean_whatever_lag_is_expected() {
        for counts in [-20.0, 0.0, 35.0] {
            let fused = Fused::of(&way(110.0, 8.0, 1000.0), &way(80.0, 8.0, -1000.0), Lag { counts, ..LAG });
            assert!((fused.position.0 - 95.0).abs() < 1e-9, "{fused:?}");
        }
    }

    #[test]
    fn a_way_that_knows_nothing_leaves_the_other_less_the_lag() {
        let fused = Fused::of(&way(110.0, 6.0, 1000.0), &way(700.0, 1e6, -1000.0), LAG);
        assert!((fused.position.0 - 100.0).abs() < 0.1, "{fused:?}");
        assert!((fused.error_bar - libm::hypot(6.0, 5.0)).abs() < 0.1, "{fused:?}");
    }

    #[test]
    fn play_that_is_known_is_taken_off_the_way_back() {
        let rules = Rules {
            backlash: 50.0,
            ..Rules::for_range(crate::LensRange::new(LensPosition(0.0), LensPosition(3500.0)).unwrap())
        };
        let back = way(940.0, 6.0, -1000.0).with_backlash(&rules);
        let there = way(1006.0, 6.0, 1000.0);
        let answer = combine(&there, &back, &rules).unwrap();
        assert!((answer.position.0 - 998.0).abs() < 1e-9, "{answer:?}");
        let unknown = Rules { backlash: 0.0, ..rules };
        let refused = combine(&way(1030.0, 3.0, 1000.0), &way(940.0, 3.0, -1000.0), &unknown);
        let Err(Failure::DirectionMismatch { suspicion: Suspicion::Backlash { counts }, .. }) = refused
        else {
            panic!("{refused:?}")
        };
        // Half the difference less the 6 ms that pixels are late, and that twice.
        assert!((counts - 78.0).abs() < 1.0, "{counts}");
    }
}

//! How late the pixels are, by how noisy they are; learnt from sweeps made both ways.
//!
//! A photoreceptor follows the light the later the darker it is, and the darker it is the more it fires by chance: the noise tells the
//! delay of a rig whose delay has not been measured, and how it changes with the light on one whose delay has.

/// Longest delay that is believed, seconds.
const LONGEST_S: f64 = 0.08;
/// What the model does not explain, seconds: no measurement makes it surer than this.
const UNEXPLAINED_S: f64 = 0.001;

/// The delay at one level of noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Delay {
    /// Seconds.
    pub seconds: f64,
    /// One standard deviation, seconds.
    pub uncertainty_s: f64,
}

/// A straight line through delay against noise, with its uncertainty: the mean and covariance of a normal distribution over both
/// coefficients, updated by each measurement (a Kalman filter without motion).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayModel {
    /// Delay of pixels without noise, seconds.
    pub base_s: f64,
    /// More of it for each Hz of noise, seconds.
    pub per_hz_s: f64,
    /// Variance of `base_s`, covariance, variance of `per_hz_s`.
    pub covariance: [f64; 3],
    /// Measurements learnt.
    pub measurements: u32,
}

impl Default for DelayModel {
    /// What the pixel models of two public simulators have in common: 6 ms in light and 14 ms for each Hz of noise, give or take 4 ms
    /// and, ours being less late in the dark than they are, 9 ms/Hz.
    fn default() -> Self {
        Self {
            base_s: 0.006,
            per_hz_s: 0.014,
            covariance: [0.004 * 0.004, 0.0, 0.009 * 0.009],
            measurements: 0,
        }
    }
}

impl DelayModel {
    /// The delay of pixels that make `noise_hz` noise events a second.
    pub fn at(&self, noise_hz: f64) -> Delay {
        let [base, both, slope] = self.covariance;
        let variance = base + 2.0 * noise_hz * both + noise_hz * noise_hz * slope;
        Delay {
            seconds: (self.base_s + noise_hz * self.per_hz_s).clamp(0.0, LONGEST_S),
            uncertainty_s: libm::sqrt(variance.max(0.0) + UNEXPLAINED_S * UNEXPLAINED_S),
        }
    }

    /// Takes a measured delay, which is uncertain by one standard deviation of `uncertainty_s`. Numbers that are none are left out.
    pub fn learn(&mut self, noise_hz: f64, delay_s: f64, uncertainty_s: f64) {
        if !(noise_hz.is_finite() && delay_s.is_finite() && uncertainty_s.is_finite()) {
            return;
        }
        let [base, both, slope] = self.covariance;
        // What the measurement shares with each coefficient.
        let (with_base, with_slope) = (base + noise_hz * both, both + noise_hz * slope);
        let measured = uncertainty_s * uncertainty_s + UNEXPLAINED_S * UNEXPLAINED_S;
        let variance = with_base + noise_hz * with_slope + measured;
        let surprise = delay_s - (self.base_s + noise_hz * self.per_hz_s);
        self.base_s += with_base / variance * surprise;
        self.per_hz_s += with_slope / variance * surprise;
        self.covariance = [
            base - with_base * with_base / variance,
            both - with_base * with_slope / variance,
            slope - with_slope * with_slope / variance,
        ];
        self.measurements = self.measurements.saturating_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rig_unlike_the_others_is_learnt() {
        let mut model = DelayModel::default();
        let before = model.at(0.5);
        for noise_hz in [0.0, 0.5, 1.0, 0.2, 0.8, 0.0, 0.4] {
            model.learn(noise_hz, 0.012 + 0.02 * noise_hz, 0.001);
        }
        let after = model.at(0.5);
        assert!((after.seconds - 0.022).abs() < 0.001, "{after:?}");
        assert!(after.uncertainty_s < before.uncertainty_s / 2.0, "{after:?}");
        assert_eq!(model.measurements, 7);
    }

    #[test]
    fn one_light_level_says_little_of_another() {
        let mut model = DelayModel::default();
        for _ in 0..100 {
            model.learn(0.0, 0.004, 0.0005);
        }
        let (light, dark) = (model.at(0.0), model.at(2.0));
        assert!((light.seconds - 0.004).abs() < 0.0005 && light.uncertainty_s < 0.0015, "{light:?}");
        assert!(dark.uncertainty_s > 0.008, "{dark:?}");
    }

    #[test]
    fn numbers_that_are_none_change_nothing() {
        let mut model = DelayModel::default();
        model.learn(f64::NAN, 0.01, 0.001);
        model.learn(0.0, f64::INFINITY, 0.001);
        assert_eq!(model, DelayModel::default());
        assert!((0.0..=LONGEST_S).contains(&model.at(1e9).seconds));
    }
}

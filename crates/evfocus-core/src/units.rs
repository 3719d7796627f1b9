//! Quantities that must not be mixed: lens counts, camera time, host time, event rates.
//!
//! The two clocks are different types and only [`ClockMap`](crate::ClockMap) converts between them.

use core::fmt;
use core::ops::{Add, AddAssign, Sub};
use core::time::Duration;

/// A point in time, in microseconds of one particular clock.
pub trait Timestamp: Copy + PartialOrd + fmt::Debug {
    /// A point `micros` microseconds after the clock's origin.
    fn from_micros(micros: i64) -> Self;
    /// Microseconds since the clock's origin.
    fn micros(self) -> i64;
}

macro_rules! timestamp {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
        pub struct $name(pub i64);

        impl Timestamp for $name {
            fn from_micros(micros: i64) -> Self {
                Self(micros)
            }
            fn micros(self) -> i64 {
                self.0
            }
        }

        impl $name {
            /// Microseconds from `earlier` to `self`; negative if `self` comes first.
            pub fn micros_since(self, earlier: Self) -> i64 {
                self.0.saturating_sub(earlier.0)
            }

            /// The time from `earlier` to `self`, zero if `self` comes first.
            pub fn since(self, earlier: Self) -> Duration {
                Duration::from_micros(u64::try_from(self.micros_since(earlier)).unwrap_or(0))
            }
        }

        impl Add<Duration> for $name {
            type Output = Self;
            fn add(self, duration: Duration) -> Self {
                Self(self.0.saturating_add(i64::try_from(duration.as_micros()).unwrap_or(i64::MAX)))
            }
        }

        impl AddAssign<Duration> for $name {
            fn add_assign(&mut self, duration: Duration) {
                *self = *self + duration;
            }
        }

        impl Sub<Duration> for $name {
            type Output = Self;
            fn sub(self, duration: Duration) -> Self {
                Self(self.0.saturating_sub(i64::try_from(duration.as_micros()).unwrap_or(i64::MAX)))
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{} us", self.0)
            }
        }
    };
}

timestamp! {
    /// Time of the camera's own clock, in microseconds; unwrapped by the driver or by [`ClockMap`](crate::ClockMap).
    CameraMicros
}
timestamp! {
    /// Time of the host's monotonic clock, in microseconds since an origin of the program's choice.
    HostMicros
}

/// A lens position in the lens's own counts (the paper's rig: 220 to 3750).
///
/// Fractions are meaningful: an estimate lies between counts, and a simulated or analogue position is not an integer.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct LensPosition(pub f64);

impl LensPosition {
    /// Counts from `other` to `self`, signed.
    pub fn counts_from(self, other: Self) -> f64 {
        self.0 - other.0
    }

    /// Distance to `other` in counts, never negative.
    pub fn distance(self, other: Self) -> f64 {
        libm::fabs(self.0 - other.0)
    }
}

impl fmt::Display for LensPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1}", self.0)
    }
}

/// A lens speed in counts per second, positive and finite.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub struct LensSpeed(f64);

impl LensSpeed {
    /// `counts_per_second` as a speed.
    ///
    /// # Errors
    /// [`UnitError::Speed`] unless the value is finite and above zero.
    pub fn new(counts_per_second: f64) -> Result<Self, UnitError> {
        if counts_per_second.is_finite() && counts_per_second > 0.0 {
            Ok(Self(counts_per_second))
        } else {
            Err(UnitError::Speed { value: counts_per_second })
        }
    }

    /// Counts per second.
    pub fn counts_per_second(self) -> f64 {
        self.0
    }
}

/// A closed interval of lens positions of non-zero length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LensRange {
    min: f64,
    max: f64,
}

impl LensRange {
    /// The positions from `min` to `max`.
    ///
    /// # Errors
    /// [`UnitError::Range`] unless both ends are finite and `min` lies below `max`.
    pub fn new(min: LensPosition, max: LensPosition) -> Result<Self, UnitError> {
        if min.0.is_finite() && max.0.is_finite() && min.0 < max.0 {
            Ok(Self { min: min.0, max: max.0 })
        } else {
            Err(UnitError::Range { min: min.0, max: max.0 })
        }
    }

    /// The low end.
    pub fn min(self) -> LensPosition {
        LensPosition(self.min)
    }

    /// The high end.
    pub fn max(self) -> LensPosition {
        LensPosition(self.max)
    }

    /// The length in counts, above zero.
    pub fn length(self) -> f64 {
        self.max - self.min
    }

    /// Whether `position` lies within the range, ends included.
    pub fn contains(self, position: LensPosition) -> bool {
        position.0 >= self.min && position.0 <= self.max
    }

    /// Whether `other` lies wholly within `self`.
    pub fn encloses(self, other: Self) -> bool {
        other.min >= self.min && other.max <= self.max
    }

    /// The position in the range that is nearest to `position`.
    pub fn clamp(self, position: LensPosition) -> LensPosition {
        LensPosition(position.0.clamp(self.min, self.max))
    }
}

impl fmt::Display for LensRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.1} to {:.1}", self.min, self.max)
    }
}

/// Events per second.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
pub struct EventRate(pub f64);

impl fmt::Display for EventRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.0} events/s", self.0)
    }
}

/// A number that is not a quantity of its kind.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// A lens speed that is not a positive finite number.
    #[error("a lens speed must be finite and above zero, not {value} counts/s")]
    Speed {
        /// The value given, counts per second.
        value: f64,
    },
    /// A lens range whose ends are not finite and in order.
    #[error("a lens range needs finite ends with the low one first, not {min} to {max}")]
    Range {
        /// The low end given.
        min: f64,
        /// The high end given.
        max: f64,
    },
}

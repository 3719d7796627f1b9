//! What is odd about an answer.

use core::fmt;

/// One thing that is odd.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Flag {
    /// The rate was capped by the read-out or the link.
    Saturated,
    /// A good part of the picture is sharp elsewhere.
    TwoDepths,
    /// The peak is hardly higher than chance makes one.
    Weak,
    /// The readings of the same events differ by a good part of the peak's width.
    Unsure,
    /// The peak is cut off by an end of the sweep.
    Edge,
    /// The peak, or the event rate, hardly depends on the lens position.
    Flat,
    /// A good part of the events follows the mains.
    Flicker,
    /// Some events were lost.
    EventsLost,
    /// The fine structure was too weak; the answer is from coarser structure.
    Coarse,
}

impl Flag {
    /// Every flag.
    pub const ALL: [Self; 9] = [
        Self::Saturated,
        Self::TwoDepths,
        Self::Weak,
        Self::Unsure,
        Self::Edge,
        Self::Flat,
        Self::Flicker,
        Self::EventsLost,
        Self::Coarse,
    ];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Saturated => "saturated",
            Self::TwoDepths => "two-depths",
            Self::Weak => "weak",
            Self::Unsure => "unsure",
            Self::Edge => "edge",
            Self::Flat => "flat",
            Self::Flicker => "flicker",
            Self::EventsLost => "events-lost",
            Self::Coarse => "coarse",
        }
    }
}

/// A set of flags.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Flags(u16);

impl Flags {
    /// Adds `flag` if `raised`.
    pub fn set(&mut self, flag: Flag, raised: bool) {
        self.0 |= u16::from(raised) << flag as u16;
    }

    /// Whether `flag` is in it.
    pub fn contains(self, flag: Flag) -> bool {
        self.0 >> flag as u16 & 1 == 1
    }

    /// What is in either.
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// What is in it.
    pub fn iter(self) -> impl Iterator<Item = Flag> {
        Flag::ALL.into_iter().filter(move |flag| self.contains(*flag))
    }
}

impl fmt::Display for Flags {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, flag) in self.iter().enumerate() {
            let separator = if index == 0 { "" } else { ", " };
            write!(f, "{separator}{}", flag.name())?;
        }
        Ok(())
    }
}

//! The formats of recordings and their names.

use std::fmt;
use std::str::FromStr;

/// A format that evfocus reads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Prophesee RAW with EVT 3.0 words.
    Evt3,
    /// Prophesee RAW with EVT 2.0 words.
    Evt2,
    /// iniVation AEDAT 4.
    Aedat4,
    /// Text with one event a line.
    Csv,
    /// The 16-bit words that a DAVIS346 sends over USB, without a header.
    DavisWords,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 5] = [Self::Evt3, Self::Evt2, Self::Aedat4, Self::Csv, Self::DavisWords];

    /// The name by which a user asks for the format.
    pub fn name(self) -> &'static str {
        match self {
            Self::Evt3 => "evt3",
            Self::Evt2 => "evt2",
            Self::Aedat4 => "aedat4",
            Self::Csv => "csv",
            Self::DavisWords => "davis346-words",
        }
    }

    /// The supported formats in words, for messages.
    pub(crate) fn supported() -> &'static str {
        "evfocus reads Prophesee RAW (EVT3, EVT2), AEDAT4, CSV and DAVIS346 USB words"
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = UnknownFormat;

    fn from_str(name: &str) -> Result<Self, UnknownFormat> {
        let lower = name.to_ascii_lowercase();
        let found = Self::ALL.into_iter().find(|format| format.name() == lower);
        found.ok_or_else(|| UnknownFormat { name: name.to_owned() })
    }
}

/// A name that no format has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no format {name:?}; name one of evt3, evt2, aedat4, csv, davis346-words")]
pub struct UnknownFormat {
    /// The name given.
    pub name: String,
}

//! The sensor's biases: offsets to what the factory has set, within what OpenEB allows.

/// A bias that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Bias {
    pub(super) name: &'static str,
    pub(super) address: u32,
    /// Offsets to the factory's value.
    min: i32,
    max: i32,
}

/// All of them.
const BIASES: [Bias; 6] = [
    Bias { name: "bias_fo", address: 0x1004, min: -150, max: 200 },
    Bias { name: "bias_hpf", address: 0x100C, min: 0, max: 255 },
    Bias { name: "bias_diff_on", address: 0x1010, min: -150, max: 200 },
    Bias { name: "bias_diff", address: 0x1014, min: -150, max: 200 },
    Bias { name: "bias_diff_off", address: 0x1018, min: -150, max: 200 },
    Bias { name: "bias_refr", address: 0x1020, min: -50, max: 255 },
];

/// A bias setting that the sensor does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BiasError {
    /// No bias of this name can be set.
    #[error("the IMX636 has no bias {name} to set; it has {}", names().collect::<Vec<_>>().join(", "))]
    Unknown {
        /// The name given.
        name: String,
    },
    /// The offset is beyond its range.
    #[error("{name} is an offset to the factory's value from {min} to {max}, not {offset}")]
    OutOfRange {
        /// The bias.
        name: String,
        /// The offset given.
        offset: i32,
        /// Lowest offset.
        min: i32,
        /// Highest offset.
        max: i32,
    },
}

/// Names of the biases that can be set.
pub fn names() -> impl Iterator<Item = &'static str> {
    BIASES.iter().map(|bias| bias.name)
}

/// Checks one setting.
///
/// # Errors
/// [`BiasError`].
pub fn check(name: &str, offset: i32) -> Result<(), BiasError> {
    let Some(bias) = find(name) else {
        return Err(BiasError::Unknown { name: name.to_owned() });
    };
    let Bias { min, max, .. } = bias;
    if offset < min || offset > max {
        return Err(BiasError::OutOfRange { name: name.to_owned(), offset, min, max });
    }
    Ok(())
}

/// The bias of this name.
pub(super) fn find(name: &str) -> Option<Bias> {
    BIASES.into_iter().find(|bias| bias.name == name)
}

/// The value `offset` away from the factory's, within the register's eight bits.
pub(super) fn value(factory: u32, offset: i32) -> u32 {
    (factory & 0xFF).saturating_add_signed(offset).min(0xFF)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_stay_within_their_range_and_the_register() {
        assert_eq!(check("bias_fo", -150), Ok(()));
        assert!(check("bias_fo", -151).unwrap_err().to_string().contains("from -150 to 200, not -151"));
        assert!(check("bias_pr", 0).unwrap_err().to_string().contains("bias_diff_on"));
        assert_eq!([value(0x11A1_5066, 20), value(0x66, -150), value(0x66, 200)], [0x7A, 0, 0xFF]);
    }
}

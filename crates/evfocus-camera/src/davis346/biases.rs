//! The chip's biases: which there are, what they are set to, and how a setting becomes a register word.
//!
//! Defaults are those of libcaer for the DAVIS346, which neuromorphic-drivers shares.

/// Transistor of a coarse-fine bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Transistor {
    P,
    N,
    /// N, switched off.
    NOff,
}

/// What a bias is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Circuit {
    /// A current: coarse 0 to 7, fine 0 to 255.
    CoarseFine(Transistor, u8, u8),
    /// A voltage 0 to 63 and a current 0 to 7.
    Voltage(u8, u8),
    /// A shifted source: reference 0 to 63 and regulator 0 to 63.
    ShiftedSource(u8, u8),
}

impl Circuit {
    fn word(self) -> u16 {
        match self {
            Self::CoarseFine(transistor, coarse, fine) => {
                let kind = match transistor {
                    Transistor::P => 0xD,
                    Transistor::N => 0xF,
                    Transistor::NOff => 0xE,
                };
                u16::from(coarse) << 12 | u16::from(fine) << 4 | kind
            }
            Self::Voltage(voltage, current) => u16::from(current) << 6 | u16::from(voltage),
            Self::ShiftedSource(reference, regulator) => {
                u16::from(regulator) << 10 | u16::from(reference) << 4
            }
        }
    }
}

/// Address in the chip's module, name as in the maker's software, default.
const BIASES: [(u8, &str, Circuit); 28] = {
    use Circuit::{CoarseFine, ShiftedSource, Voltage};
    use Transistor::{N, NOff, P};
    [
        (0, "ApsOverflowLevel", Voltage(27, 6)),
        (1, "ApsCas", Voltage(21, 6)),
        (2, "AdcRefHigh", Voltage(32, 7)),
        (3, "AdcRefLow", Voltage(1, 7)),
        (4, "AdcTestVoltage", Voltage(21, 7)),
        (8, "LocalBufBn", CoarseFine(N, 5, 164)),
        (9, "PadFollBn", CoarseFine(NOff, 7, 215)),
        (10, "DiffBn", CoarseFine(N, 4, 39)),
        (11, "OnBn", CoarseFine(N, 5, 255)),
        (12, "OffBn", CoarseFine(N, 4, 1)),
        (13, "PixInvBn", CoarseFine(N, 6, 144)),
        (14, "PrBp", CoarseFine(P, 2, 58)),
        (15, "PrSFBp", CoarseFine(P, 1, 16)),
        (16, "RefrBp", CoarseFine(P, 4, 25)),
        (17, "ReadoutBufBp", CoarseFine(P, 6, 20)),
        (18, "ApsROSFBn", CoarseFine(N, 6, 219)),
        (19, "AdcCompBp", CoarseFine(P, 5, 20)),
        (20, "ColSelLowBn", CoarseFine(N, 0, 1)),
        (21, "DACBufBp", CoarseFine(P, 6, 60)),
        (22, "LcolTimeoutBn", CoarseFine(N, 5, 49)),
        (23, "AEPdBn", CoarseFine(N, 6, 91)),
        (24, "AEPuXBp", CoarseFine(P, 4, 80)),
        (25, "AEPuYBp", CoarseFine(P, 7, 152)),
        (26, "IFRefrBn", CoarseFine(N, 5, 255)),
        (27, "IFThrBn", CoarseFine(N, 5, 255)),
        (34, "BiasBuffer", CoarseFine(N, 5, 254)),
        (35, "SSP", ShiftedSource(1, 33)),
        (36, "SSN", ShiftedSource(1, 33)),
    ]
};

/// Values of the chip's configuration registers, in the biases' module: multiplexers at rest, calibration off.
const CHIP_CONFIGURATION: [(u8, u16); 16] = [
    (128, 0),
    (129, 0),
    (130, 0),
    (131, 0),
    (132, 0),
    (133, 0),
    (134, 0),
    (135, 0),
    // Reset of the calibration neuron.
    (136, 1),
    (137, 0),
    // Reset of the test pixel.
    (138, 1),
    (140, 0),
    (141, 0),
    // Global shutter; no frames are taken.
    (142, 0),
    // Gray counter.
    (143, 1),
    (144, 0),
];

/// A current of one of the chip's biases.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoarseFine {
    /// Decade: 0 to 7, for about 11 pA, 94 pA, 756 pA, 6 nA, 48 nA, 388 nA, 3.1 uA, 25 uA.
    pub coarse: u8,
    /// Share of the decade's current, in 255ths.
    pub fine: u8,
}

impl CoarseFine {
    /// The largest coarse value.
    pub const MAX_COARSE: u8 = 7;
}

/// A bias setting that the chip does not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BiasError {
    /// No bias of this name can be set.
    #[error("the DAVIS346 has no bias {name} to set; it has {}", names().collect::<Vec<_>>().join(", "))]
    Unknown {
        /// The name given.
        name: String,
    },
    /// The coarse value is beyond its range; fine values have none.
    #[error("bias {name} has a coarse value from 0 to {}, not {coarse}", CoarseFine::MAX_COARSE)]
    OutOfRange {
        /// The bias.
        name: String,
        /// The value given.
        coarse: u8,
    },
}

/// Names of the biases that can be set, which are those that are currents.
pub fn names() -> impl Iterator<Item = &'static str> {
    BIASES.iter().filter(|(.., circuit)| matches!(circuit, Circuit::CoarseFine(..))).map(|&(_, name, _)| name)
}

/// Checks one setting.
///
/// # Errors
/// [`BiasError`].
pub fn check(name: &str, value: CoarseFine) -> Result<(), BiasError> {
    if !names().any(|known| known == name) {
        return Err(BiasError::Unknown { name: name.to_owned() });
    }
    if value.coarse > CoarseFine::MAX_COARSE {
        return Err(BiasError::OutOfRange { name: name.to_owned(), coarse: value.coarse });
    }
    Ok(())
}

/// Addresses and words of the chip's module, in the order of addresses: the biases, with what `settings` changes, and the
/// chip's configuration.
pub(super) fn words(settings: &[(String, CoarseFine)]) -> impl Iterator<Item = (u8, u16)> {
    let biases = BIASES.iter().map(|&(address, name, default)| {
        let setting = settings.iter().rev().find(|(named, _)| named == name);
        let circuit = match (default, setting) {
            (Circuit::CoarseFine(transistor, ..), Some((_, value))) => {
                Circuit::CoarseFine(transistor, value.coarse, value.fine)
            }
            (default, _) => default,
        };
        (address, circuit.word())
    });
    biases.chain(CHIP_CONFIGURATION)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words as they go over the wire with libcaer's defaults.
    const DEFAULT_WORDS: [u16; 28] = [
        0x019B, 0x0195, 0x01E0, 0x01C1, 0x01D5, 0x5A4F, 0x7D7E, 0x427F, 0x5FFF, 0x401F, 0x690F, 0x23AD,
        0x110D, 0x419D, 0x614D, 0x6DBF, 0x514D, 0x001F, 0x63CD, 0x531F, 0x65BF, 0x450D, 0x798D, 0x5FFF,
        0x5FFF, 0x5FEF, 0x8410, 0x8410,
    ];

    #[test]
    fn defaults_are_those_of_the_maker() {
        let found: Vec<u16> = words(&[]).map(|(_, word)| word).take(28).collect();
        assert_eq!(found, DEFAULT_WORDS);
        assert!(words(&[]).is_sorted_by_key(|(address, _)| address));
    }

    #[test]
    fn settings_change_their_bias_and_no_other() {
        let value = CoarseFine { coarse: 3, fine: 200 };
        let changed: Vec<_> =
            words(&[("PrBp".to_owned(), value)]).zip(words(&[])).filter(|(a, b)| a != b).collect();
        assert_eq!(changed, [((14, 0x3C8D), (14, 0x23AD))]);
    }

    #[test]
    fn what_the_chip_does_not_have_is_refused() {
        let value = CoarseFine { coarse: 8, fine: 0 };
        assert!(check("PrBp", value).unwrap_err().to_string().contains("from 0 to 7, not 8"));
        assert!(check("SSP", value).unwrap_err().to_string().contains("DiffBn"));
        assert_eq!(check("DiffBn", CoarseFine { coarse: 7, fine: 255 }), Ok(()));
    }
}

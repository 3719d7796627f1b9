//! Messages of Firmata 2.x: commands have the high bit set, data has not; numbers come in sevens of bits, low ones first.

/// Longest system message that is kept, bytes; the capabilities of a board with 70 pins are shorter.
const LONGEST_SYSEX: usize = 2048;
const START_SYSEX: u8 = 0xF0;
const END_SYSEX: u8 = 0xF7;
const REPORT_VERSION: u8 = 0xF9;
const SET_PIN_MODE: u8 = 0xF4;
const SET_DIGITAL_PIN: u8 = 0xF5;
const ANALOG: u8 = 0xE0;
const DIGITAL: u8 = 0x90;
const REPORT_ANALOG: u8 = 0xC0;
const EXTENDED_ANALOG: u8 = 0x6F;
const ANALOG_MAP_QUERY: u8 = 0x69;
const ANALOG_MAP: u8 = 0x6A;
const CAPABILITY_QUERY: u8 = 0x6B;
const CAPABILITIES: u8 = 0x6C;
const SAMPLING_INTERVAL: u8 = 0x7A;
const NOT_ANALOG: u8 = 0x7F;

/// What a pin is used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PinMode {
    /// A digital output.
    Output,
    /// An analog input.
    Analog,
    /// A pulse-width modulated output.
    Pwm,
}

impl PinMode {
    fn code(self) -> u8 {
        match self {
            Self::Output => 1,
            Self::Analog => 2,
            Self::Pwm => 3,
        }
    }
}

/// What is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Which version of the protocol?
    Version,
    /// Which pins are which analog channels?
    AnalogMap,
    /// What can the pins do?
    Capabilities,
    /// What a pin is to be.
    Mode(u8, PinMode),
    /// How often analog channels are reported, ms.
    SamplingInterval(u16),
    /// Whether a channel, 0 to 15, is reported.
    Report(u8, bool),
    /// A digital output.
    Digital(u8, bool),
    /// The duty of a PWM pin.
    Pwm(u8, u16),
}

/// The low and the high seven of 14 bits.
fn sevens(value: u16) -> [u8; 2] {
    [(value & 0x7F) as u8, (value >> 7 & 0x7F) as u8]
}

impl Command {
    /// The bytes on the line.
    pub fn encode(self) -> Vec<u8> {
        match self {
            Self::Version => vec![REPORT_VERSION],
            Self::AnalogMap => vec![START_SYSEX, ANALOG_MAP_QUERY, END_SYSEX],
            Self::Capabilities => vec![START_SYSEX, CAPABILITY_QUERY, END_SYSEX],
            Self::Mode(pin, mode) => vec![SET_PIN_MODE, pin & 0x7F, mode.code()],
            Self::SamplingInterval(ms) => {
                let [low, high] = sevens(ms);
                vec![START_SYSEX, SAMPLING_INTERVAL, low, high, END_SYSEX]
            }
            Self::Report(channel, on) => vec![REPORT_ANALOG | channel & 0x0F, u8::from(on)],
            Self::Digital(pin, high) => vec![SET_DIGITAL_PIN, pin & 0x7F, u8::from(high)],
            Self::Pwm(pin @ 0..16, duty) => {
                let [low, high] = sevens(duty);
                vec![ANALOG | pin, low, high]
            }
            Self::Pwm(pin, duty) => {
                let [low, high] = sevens(duty);
                vec![START_SYSEX, EXTENDED_ANALOG, pin & 0x7F, low, high, END_SYSEX]
            }
        }
    }
}

/// What comes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Message {
    /// The version of the protocol.
    Version(u8, u8),
    /// A reading of a channel.
    Analog {
        /// 0 to 15.
        channel: u8,
        /// Up to 14 bits.
        value: u16,
    },
    /// For each pin its channel, if it is analog.
    AnalogMap(Vec<Option<u8>>),
    /// For each pin the modes that it has, with their resolution in bits.
    Capabilities(Vec<Vec<(u8, u8)>>),
    /// Something that does not matter here.
    Other,
}

/// Cuts the stream into messages. Bounded: a system message that is too long is thrown away.
#[derive(Debug, Default)]
pub struct Decoder {
    /// The command under way, and its data so far.
    command: Option<u8>,
    data: Vec<u8>,
}

impl Decoder {
    /// Takes a byte; gives the message that it ends.
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        if byte == END_SYSEX && self.command == Some(START_SYSEX) {
            self.command = None;
            return Some(sysex(&std::mem::take(&mut self.data)));
        }
        if byte >= 0x80 {
            // A command ends whatever was unfinished.
            self.command = Some(byte);
            self.data.clear();
            return None;
        }
        let command = self.command?;
        if self.data.len() == LONGEST_SYSEX {
            (self.command, self.data) = (None, Vec::new());
            return None;
        }
        self.data.push(byte);
        let &[first, second] = self.data.as_slice() else { return None };
        let message = match command {
            REPORT_VERSION => Message::Version(first, second),
            ANALOG..0xF0 => {
                Message::Analog { channel: command & 0x0F, value: u16::from(first) | u16::from(second) << 7 }
            }
            DIGITAL..0xA0 => Message::Other,
            _ => return None,
        };
        self.command = None;
        Some(message)
    }
}

fn sysex(data: &[u8]) -> Message {
    let Some((&command, rest)) = data.split_first() else { return Message::Other };
    match command {
        ANALOG_MAP => Message::AnalogMap(
            rest.iter().map(|&channel| (channel != NOT_ANALOG).then_some(channel)).collect(),
        ),
        CAPABILITIES => {
            let pins = rest.strip_suffix(&[NOT_ANALOG]).unwrap_or(rest).split(|&byte| byte == NOT_ANALOG);
            let modes = |pin: &[u8]| {
                pin.chunks_exact(2).filter_map(|pair| Some((*pair.first()?, *pair.last()?))).collect()
            };
            Message::Capabilities(pins.map(modes).collect())
        }
        _ => Message::Other,
    }
}

/// The resolution of `pin` in `mode`, bits, if it has that mode.
pub fn resolution(capabilities: &[Vec<(u8, u8)>], pin: u8, mode: PinMode) -> Option<u8> {
    let modes = capabilities.get(usize::from(pin))?;
    modes.iter().find(|(code, _)| *code == mode.code()).map(|&(_, bits)| bits)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn messages(bytes: &[u8]) -> Vec<Message> {
        let mut decoder = Decoder::default();
        bytes.iter().filter_map(|&byte| decoder.push(byte)).collect()
    }

    #[test]
    fn the_worked_examples() {
        for (command, bytes) in [
            (Command::Mode(14, PinMode::Analog), &[0xF4, 0x0E, 0x02][..]),
            (Command::Mode(4, PinMode::Output), &[0xF4, 0x04, 0x01]),
            (Command::Mode(3, PinMode::Pwm), &[0xF4, 0x03, 0x03]),
            (Command::SamplingInterval(1), &[0xF0, 0x7A, 0x01, 0x00, 0xF7]),
            (Command::SamplingInterval(5), &[0xF0, 0x7A, 0x05, 0x00, 0xF7]),
            (Command::Report(0, true), &[0xC0, 0x01]),
            (Command::Report(0, false), &[0xC0, 0x00]),
            (Command::Pwm(3, 200), &[0xE3, 0x48, 0x01]),
            (Command::Pwm(44, 200), &[0xF0, 0x6F, 0x2C, 0x48, 0x01, 0xF7]),
            (Command::Digital(4, true), &[0xF5, 0x04, 0x01]),
        ] {
            assert_eq!(command.encode(), bytes, "{command:?}");
        }
        assert_eq!(messages(&[0xF9, 0x02, 0x05]), [Message::Version(2, 5)]);
        assert_eq!(messages(&[0xE0, 0x6B, 0x03]), [Message::Analog { channel: 0, value: 491 }]);
        let mut map = vec![0xF0, 0x6A];
        map.extend([0x7F; 14]);
        map.extend([0, 1, 2, 3, 4, 5, 0xF7]);
        let [Message::AnalogMap(channels)] = &messages(&map)[..] else { panic!("a map") };
        assert_eq!((channels[13], channels[14], channels.len()), (None, Some(0), 20));
        let pin_3 = [0x00, 0x01, 0x0B, 0x01, 0x01, 0x01, 0x03, 0x08, 0x04, 0x0E, 0x7F];
        let capabilities = [&[0xF0, 0x6C, 0x7F, 0x7F, 0x7F][..], &pin_3, &[0xF7]].concat();
        let [Message::Capabilities(pins)] = &messages(&capabilities)[..] else { panic!("capabilities") };
        assert_eq!(pins.len(), 4);
        assert_eq!(resolution(pins, 3, PinMode::Pwm), Some(8));
        assert_eq!(resolution(pins, 3, PinMode::Analog), None);
        assert_eq!(resolution(pins, 99, PinMode::Analog), None);
    }

    #[test]
    fn a_system_message_without_an_end_is_bounded() {
        let mut decoder = Decoder::default();
        decoder.push(START_SYSEX);
        for _ in 0..100_000 {
            assert_eq!(decoder.push(0x11), None);
        }
        assert!(decoder.data.len() <= LONGEST_SYSEX);
    }

    proptest! {
        /// Readings survive; no bytes make the decoder panic, and after them it is in step again at the next command.
        #[test]
        fn readings_survive(
            value in 0_u16..0x4000, channel in 0_u8..16, garbage in prop::collection::vec(any::<u8>(), 0..3000)
        ) {
            let [low, high] = sevens(value);
            let stream = [&garbage[..], &[ANALOG | channel, low, high]].concat();
            prop_assert_eq!(messages(&stream).last().cloned(), Some(Message::Analog { channel, value }));
        }
    }
}

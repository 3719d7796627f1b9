//! INDI 1.7: properties that a server defines and updates, and that a client sets.

use super::xml::{Token, Tokenizer, escape};

/// Most members of a property.
const MOST_MEMBERS: usize = 256;

/// The state of a property.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Nothing has been done, or it was aborted.
    Idle,
    /// Done.
    Ok,
    /// Under way.
    Busy,
    /// Failed.
    Alert,
}

/// The kind of a property's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Numbers.
    Number,
    /// `On` and `Off`.
    Switch,
    /// Text.
    Text,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Number => "Number",
            Self::Switch => "Switch",
            Self::Text => "Text",
        }
    }
}

/// A value of a property.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Member {
    /// Its name.
    pub name: String,
    /// As sent; numbers may be sexagesimal.
    pub value: String,
    /// The lowest number, in definitions.
    pub min: String,
    /// The highest.
    pub max: String,
}

/// What a server says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Message {
    /// A property is there (`def...Vector`) or has changed (`set...Vector`).
    Property(Property),
    /// A property is gone, or all of a device's.
    Gone {
        /// The device.
        device: String,
        /// The property; empty for all.
        name: String,
    },
    /// Words for people.
    Text {
        /// The device.
        device: String,
        /// The words.
        text: String,
    },
}

/// A property of a device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// The device.
    pub device: String,
    /// The property.
    pub name: String,
    /// The kind of its values; definitions and updates of other kinds are not reported.
    pub kind: Kind,
    /// Whether this defines it.
    pub is_definition: bool,
    /// Its state, if the message has it.
    pub state: Option<State>,
    /// What people are told about the change; empty for nothing.
    pub text: String,
    /// Its values.
    pub members: Vec<Member>,
}

impl Property {
    /// The value called `name`.
    pub fn member(&self, name: &str) -> Option<&Member> {
        self.members.iter().find(|member| member.name == name)
    }

    /// Takes the values of an update, and its limits where it has any: drivers learn a focuser's limits after they have defined
    /// its position, and tell them so.
    pub fn update(&mut self, members: Vec<Member>) {
        for new in members {
            if let Some(known) = self.members.iter_mut().find(|known| known.name == new.name) {
                known.value = new.value;
                for (limit, new) in [(&mut known.min, new.min), (&mut known.max, new.max)] {
                    if !new.is_empty() {
                        *limit = new;
                    }
                }
            }
        }
    }
}

/// A number, plain or sexagesimal (`-1:30`, `12 30 36`).
pub fn number(text: &str) -> Option<f64> {
    let text = text.trim();
    let (sign, digits) = text.strip_prefix('-').map_or((1.0, text), |digits| (-1.0, digits));
    let mut value = 0.0;
    let mut unit = 1.0;
    for part in digits.split([':', ' ', ';']).filter(|part| !part.is_empty()) {
        value += part.parse::<f64>().ok()? * unit;
        unit /= 60.0;
    }
    (unit < 1.0 && value.is_finite()).then_some(sign * value)
}

/// Puts tokens together to messages.
#[derive(Debug, Default)]
pub struct Decoder {
    tokenizer: Tokenizer,
    depth: usize,
    outer: Option<(String, Vec<(String, String)>)>,
    members: Vec<Member>,
}

impl Decoder {
    /// Takes a byte; gives the message that it ends.
    pub fn push(&mut self, byte: u8) -> Option<Message> {
        let Self { tokenizer, depth, outer, members } = self;
        let mut message = None;
        tokenizer.push(byte, |token| match token {
            Token::Start { name, attributes } => {
                *depth += 1;
                if *depth == 1 {
                    members.clear();
                    *outer = Some((name, attributes));
                } else if *depth == 2 && members.len() < MOST_MEMBERS {
                    let [name, min, max] = ["name", "min", "max"].map(|key| attribute(&attributes, key));
                    members.push(Member { name, value: String::new(), min, max });
                }
            }
            Token::Text(text) => {
                if *depth == 2
                    && let Some(member) = members.last_mut()
                {
                    member.value = text;
                }
            }
            Token::End => {
                *depth = depth.saturating_sub(1);
                if *depth == 0
                    && let Some((name, attributes)) = outer.take()
                {
                    message = understand(&name, &attributes, std::mem::take(members));
                }
            }
        });
        message
    }
}

fn attribute(attributes: &[(String, String)], key: &str) -> String {
    attributes.iter().find(|(name, _)| name == key).map(|(_, value)| value.clone()).unwrap_or_default()
}

fn understand(element: &str, attributes: &[(String, String)], members: Vec<Member>) -> Option<Message> {
    let get = |key| attribute(attributes, key);
    let (device, name, text) = (get("device"), get("name"), get("message"));
    match element {
        "message" => return Some(Message::Text { device, text }),
        "delProperty" => return Some(Message::Gone { device, name }),
        _ => {}
    }
    let (is_definition, rest) = match element.strip_prefix("def") {
        Some(rest) => (true, rest),
        None => (false, element.strip_prefix("set")?),
    };
    let kind = match rest {
        "NumberVector" => Kind::Number,
        "SwitchVector" => Kind::Switch,
        "TextVector" => Kind::Text,
        _ => return None,
    };
    let state = match get("state").as_str() {
        "Idle" => Some(State::Idle),
        "Ok" => Some(State::Ok),
        "Busy" => Some(State::Busy),
        "Alert" => Some(State::Alert),
        _ => None,
    };
    Some(Message::Property(Property { device, name, kind, is_definition, state, text, members }))
}

/// Asks for all properties of all devices.
pub const GET_PROPERTIES: &[u8] = b"<getProperties version=\"1.7\"/>\n";

/// Sets one value of a property.
pub fn set(device: &str, property: &str, kind: Kind, member: &str, value: &str) -> Vec<u8> {
    let [device, property, member, value] = [device, property, member, value].map(escape);
    let kind = kind.name();
    format!(
        "<new{kind}Vector device=\"{device}\" name=\"{property}\"><one{kind} name=\"{member}\">{value}</one{kind}></new{kind}Vector>\n"
    )
    .into_bytes()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn messages(text: &[u8]) -> Vec<Message> {
        let mut decoder = Decoder::default();
        text.iter().filter_map(|&byte| decoder.push(byte)).collect()
    }

    #[test]
    fn definitions_updates_and_words() {
        let text = b"<?xml version='1.0'?>
            <defNumberVector device='F' name='ABS_FOCUS_POSITION' state='Ok' perm='rw'>
                <defNumber name='FOCUS_ABSOLUTE_POSITION' min='0' max='65535' step='1'>
                  8.7899999999999991473
                </defNumber>
            </defNumberVector>
            <setBLOBVector device='F' name='CCD1'><oneBLOB name='x'>AAAA</oneBLOB></setBLOBVector>
            <message device=\"F\" message=\"[ERROR] out of bound\"/>
            <delProperty device='F'/>
            <setNumberVector device=\"F\" name=\"ABS_FOCUS_POSITION\" state=\"Alert\"></setNumberVector>";
        let found = messages(text);
        let [
            Message::Property(defined),
            Message::Text { text, .. },
            Message::Gone { name, .. },
            Message::Property(set),
        ] = found.as_slice()
        else {
            panic!("{found:?}");
        };
        assert!(defined.is_definition && defined.state == Some(State::Ok) && defined.kind == Kind::Number);
        let position = defined.member("FOCUS_ABSOLUTE_POSITION").unwrap();
        assert_eq!((number(&position.value), number(&position.max)), (Some(8.79), Some(65_535.0)));
        assert_eq!((text.as_str(), name.as_str()), ("[ERROR] out of bound", ""));
        assert!(!set.is_definition && set.state == Some(State::Alert) && set.members.is_empty());
    }

    #[test]
    fn numbers_of_all_kinds() {
        for (text, value) in
            [(" 5\n", 5.0), ("-1:30", -1.5), ("12 30 36", 12.51), ("1e3", 1000.0), ("-0:30", -0.5)]
        {
            assert!((number(text).unwrap() - value).abs() < 1e-9, "{text}");
        }
        for text in ["", "x", "nan", "inf", "1:x"] {
            assert_eq!(number(text), None, "{text}");
        }
    }

    #[test]
    fn commands_escape_what_people_call_their_devices() {
        let bytes = set("A & B", "CONNECTION", Kind::Switch, "CONNECT", "On");
        let text = String::from_utf8(bytes).unwrap();
        assert!(
            text.contains("device=\"A &amp; B\"")
                && text.contains("<oneSwitch name=\"CONNECT\">On</oneSwitch>")
        );
    }

    proptest! {
        /// No bytes make the decoder panic, and its memory is bounded by what one property may hold.
        #[test]
        fn any_bytes(garbage in prop::collection::vec(prop_oneof![Just(b'<'), Just(b'>'), Just(b'/'), any::<u8>()], 0..2000)) {
            messages(&garbage);
        }
    }
}

//! As much XML as INDI speaks: elements one inside another, attributes in either kind of quotes, text, the five entities.
//! Bounded: what is longer than anything INDI sends a client about a focuser is cut off.

/// Longest tag or text that is kept, bytes; pictures (BLOBs), which are longer, do not matter here.
const LONGEST: usize = 4096;
/// Most attributes of an element.
const MOST_ATTRIBUTES: usize = 32;

/// A piece of the stream.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Token {
    /// `<name key="value">`.
    Start { name: String, attributes: Vec<(String, String)> },
    /// `</name>`, or the end of `<name/>`.
    End,
    /// Text between tags, without the white space around it.
    Text(String),
}

/// Where the tokenizer is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Place {
    #[default]
    Text,
    Tag,
    /// In an attribute's value, with the quote that ends it.
    Quoted(u8),
}

/// Cuts the stream into tokens.
#[derive(Debug, Default)]
pub(super) struct Tokenizer {
    place: Place,
    buffer: Vec<u8>,
}

impl Tokenizer {
    /// Takes a byte, and gives the tokens that it ends to `found`.
    pub(super) fn push(&mut self, byte: u8, mut found: impl FnMut(Token)) {
        match (self.place, byte) {
            (Place::Text, b'<') => {
                let text = unescape(String::from_utf8_lossy(&self.buffer).trim());
                if !text.is_empty() {
                    found(Token::Text(text));
                }
                self.buffer.clear();
                self.place = Place::Tag;
                return;
            }
            (Place::Tag, b'>') => {
                tag(&String::from_utf8_lossy(&self.buffer), found);
                self.buffer.clear();
                self.place = Place::Text;
                return;
            }
            (Place::Tag, b'"' | b'\'') => self.place = Place::Quoted(byte),
            (Place::Quoted(quote), _) if byte == quote => self.place = Place::Tag,
            (Place::Text | Place::Tag | Place::Quoted(_), _) => {}
        }
        if self.buffer.len() < LONGEST {
            self.buffer.push(byte);
        }
    }
}

/// What is between `<` and `>`. Declarations and comments are nothing.
fn tag(tag: &str, mut found: impl FnMut(Token)) {
    if tag.starts_with(['?', '!']) {
        return;
    }
    if tag.starts_with('/') {
        found(Token::End);
        return;
    }
    let (tag, is_whole) = tag.strip_suffix('/').map_or((tag, false), |tag| (tag, true));
    let (name, rest) = tag.split_at(tag.find(char::is_whitespace).unwrap_or(tag.len()));
    found(Token::Start { name: name.to_owned(), attributes: attributes(rest) });
    if is_whole {
        found(Token::End);
    }
}

fn attributes(mut rest: &str) -> Vec<(String, String)> {
    let mut found = Vec::new();
    while found.len() < MOST_ATTRIBUTES {
        let Some((key, after)) = rest.split_once('=') else { break };
        let after = after.trim_start();
        let Some(quote) = after.chars().next().filter(|quote| matches!(quote, '"' | '\'')) else { break };
        let Some((value, after)) = after.get(1..).and_then(|after| after.split_once(quote)) else { break };
        found.push((key.trim().to_owned(), unescape(value)));
        rest = after;
    }
    found
}

fn unescape(text: &str) -> String {
    // The ampersand last, so that "&amp;lt;" stays "&lt;".
    let entities = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&apos;", "'"), ("&amp;", "&")];
    entities.iter().fold(text.to_owned(), |text, (entity, plain)| text.replace(entity, plain))
}

/// `text` as an attribute or as text.
pub(super) fn escape(text: &str) -> String {
    let entities = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;"), ("'", "&apos;")];
    entities.iter().fold(text.to_owned(), |text, (plain, entity)| text.replace(plain, entity))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn tokens(text: &[u8]) -> Vec<Token> {
        let (mut tokenizer, mut found) = (Tokenizer::default(), Vec::new());
        for &byte in text {
            tokenizer.push(byte, |token| found.push(token));
        }
        found
    }

    fn start(name: &str, attributes: &[(&str, &str)]) -> Token {
        let attributes = attributes.iter().map(|&(key, value)| (key.to_owned(), value.to_owned())).collect();
        Token::Start { name: name.to_owned(), attributes }
    }

    #[test]
    fn both_kinds_of_quotes_and_everything_on_lines_of_its_own() {
        let text = b"<?xml version='1.0'?>\n<defNumber\n    name='A'\n    label=\"it's > 1\"\n>\n  5\n</defNumber>\n<x/>";
        let expected = [
            start("defNumber", &[("name", "A"), ("label", "it's > 1")]),
            Token::Text("5".to_owned()),
            Token::End,
            start("x", &[]),
            Token::End,
        ];
        assert_eq!(tokens(text), expected);
        assert_eq!(tokens(b"<m t='&lt;&amp;lt;'/>")[0], start("m", &[("t", "<&lt;")]));
    }

    #[test]
    fn an_endless_tag_is_bounded() {
        let mut tokenizer = Tokenizer::default();
        for byte in b"<a b='".iter().chain(std::iter::repeat_n(&b'x', 1_000_000)) {
            tokenizer.push(*byte, |_| {});
        }
        assert!(tokenizer.buffer.len() <= LONGEST);
    }

    proptest! {
        /// Any text survives as an attribute and as text; no bytes make the tokenizer panic.
        #[test]
        fn text_survives(text in "\\S(\\PC{0,80}\\S)?", garbage in prop::collection::vec(any::<u8>(), 0..600)) {
            tokens(&garbage);
            let escaped = escape(&text);
            let stream = format!("<a b='{escaped}'>{escaped}</a>");
            prop_assert_eq!(tokens(stream.as_bytes()), [start("a", &[("b", &text)]), Token::Text(text), Token::End]);
        }
    }
}

//! Tells what a file is by its first bytes; the extension only decides where bytes cannot.

use std::path::Path;

use crate::Format;
use crate::csv::Layout;
use crate::raw_header::{Encoding, RawHeader};
use evfocus_core::decode::davis::looks_like_davis_words;

/// What the content of a file is, or why that is not clear.
#[derive(Debug)]
pub(crate) enum Sniffed {
    Is(Format),
    Foreign { found: String, remedy: String },
}

/// How many words must all be possible before a file without a name to support it counts as DAVIS346 words.
const ENOUGH_DAVIS_BYTES: usize = 256;

/// Recognises the format from `start`, the first bytes of the file at `path` (all of them if it is shorter).
pub(crate) fn sniff(path: &Path, start: &[u8]) -> Sniffed {
    if start.is_empty() {
        return foreign("the file is empty", "record it again");
    }
    if start.starts_with(b"% ") {
        return prophesee(start);
    }
    if start.starts_with(b"#!AER-DAT4.0\r\n") {
        return Sniffed::Is(Format::Aedat4);
    }
    if let Some((_, name, remedy)) = KNOWN_FOREIGN.iter().find(|(magic, _, _)| start.starts_with(magic)) {
        return foreign(name, remedy);
    }
    if let Some(text) = as_text(start) {
        return text_file(path, text);
    }
    let named_words = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("bin"));
    if (named_words || start.len() >= ENOUGH_DAVIS_BYTES) && looks_like_davis_words(start) {
        return Sniffed::Is(Format::DavisWords);
    }
    let bytes: Vec<String> = start.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
    foreign(
        &format!("binary data that begins with {}", bytes.join(" ")),
        "if these are the bare words of a camera, name the format: evt3, evt2 or davis346-words",
    )
}

/// Formats that are recognised in order to say what to do with them.
const KNOWN_FOREIGN: [(&[u8], &str, &str); 12] = [
    (b"#!AER-DAT2.0", "an AEDAT 2.0 recording", "convert it to AEDAT4 with dv-gui"),
    (b"#!AER-DAT3", "an AEDAT 3 recording", "convert it to AEDAT4 with dv-gui"),
    (b"#!AER-DAT4", "the start of an AEDAT4 recording, broken off or damaged", "record or copy it again"),
    (b"#!AER-DAT", "an AEDAT recording of an unknown version", "convert it to AEDAT4 with dv-gui"),
    (b"Event Stream", "an Event Stream (.es) recording", "convert it to CSV or EVT3 with faery"),
    (b"\x89PNG", "a PNG picture", "give the recording itself"),
    (b"\xFF\xD8\xFF", "a JPEG picture", "give the recording itself"),
    (b"\x89HDF", "an HDF5 file", "convert it with Metavision's metavision_hdf5_to_raw or to CSV"),
    (b"#ROSBAG", "a ROS bag", "convert it to RAW or CSV"),
    (b"PK\x03\x04", "a ZIP archive", "unpack it first"),
    (b"\x1F\x8B", "a gzip archive", "unpack it first"),
    (b"\x28\xB5\x2F\xFD", "a zstd archive", "unpack it first"),
];

fn foreign(found: &str, remedy: &str) -> Sniffed {
    Sniffed::Foreign { found: found.to_owned(), remedy: format!("{}; {remedy}", Format::supported()) }
}

fn prophesee(start: &[u8]) -> Sniffed {
    let header = RawHeader::parse(start);
    if header.cut_short || (!header.ended && header.data_start == start.len()) {
        return foreign("a Prophesee header that breaks off before the data", "record or copy it again");
    }
    match header.encoding {
        Some(Encoding::Evt3) => Sniffed::Is(Format::Evt3),
        Some(Encoding::Evt2) => Sniffed::Is(Format::Evt2),
        Some(Encoding::Evt21) => foreign(
            "a Prophesee RAW file with EVT 2.1 words",
            "set the camera to EVT3, or convert the file to CSV with metavision_file_to_csv",
        ),
        Some(Encoding::Other(name)) => foreign(
            &format!("a Prophesee RAW file with words of the kind {name:?}"),
            "convert it to EVT3 or CSV with the Metavision tools",
        ),
        None => foreign(
            "a Prophesee header without an 'evt' or 'format' line (DAT files have none)",
            "convert DAT to CSV or EVT3 with faery; for a RAW file name the format, evt3 or evt2",
        ),
    }
}

/// The bytes as text, if that is what they are; a character cut off at the end is no objection.
fn as_text(start: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(start) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(start.get(..error.valid_up_to())?).ok()?
        }
        Err(_) => return None,
    };
    let is_text = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t');
    text.chars().all(is_text).then_some(text)
}

/// Text is CSV if its first lines are; a file that is called CSV is taken at its word, so that the error names the line.
fn text_file(path: &Path, text: &str) -> Sniffed {
    let named = ["csv", "tsv", "txt"]
        .iter()
        .any(|name| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(name)));
    if named || Layout::detect(text).is_ok() {
        return Sniffed::Is(Format::Csv);
    }
    let line: String = text.lines().next().unwrap_or_default().chars().take(60).collect();
    foreign(
        &format!("text that begins with {line:?}"),
        "a CSV file of events begins with a line such as \"t_us,x,y,p\"",
    )
}

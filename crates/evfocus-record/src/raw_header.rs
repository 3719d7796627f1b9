//! The header of Prophesee RAW files: lines "% key value", then "% end" in newer files (Prophesee, "RAW File Format").

use evfocus_core::Geometry;

/// Longer headers are not headers.
pub(crate) const MAX_HEADER_BYTES: usize = 64 * 1024;
/// Key of the header line that [`Evt3Writer`](crate::Evt3Writer) adds: microseconds to add to the file's times.
pub(crate) const ORIGIN_KEY: &str = "t0_us";

/// What the words of a RAW file are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Encoding {
    Evt3,
    Evt2,
    Evt21,
    Other(String),
}

/// What a RAW header says.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct RawHeader {
    pub(crate) encoding: Option<Encoding>,
    pub(crate) geometry: Option<Geometry>,
    pub(crate) origin_us: i64,
    /// Where the words start, in bytes from the start of the file.
    pub(crate) data_start: usize,
    /// Whether the header is closed by "% end".
    pub(crate) ended: bool,
    /// Whether the bytes ran out in the middle of a header line.
    pub(crate) cut_short: bool,
}

impl RawHeader {
    /// Reads the header at the start of `bytes`, which hold at least the header or the whole file.
    pub(crate) fn parse(bytes: &[u8]) -> Self {
        let mut header = Self::default();
        let mut rest = bytes;
        // The header ends at the first line that is none; older files have no "% end".
        while let Some(line_start) = rest.strip_prefix(b"% ") {
            let Some(length) = line_start.iter().position(|&byte| byte == b'\n') else {
                header.cut_short = line_start.iter().all(|&byte| is_text(byte));
                break;
            };
            let (line, after) = line_start.split_at(length);
            if !line.iter().all(|&byte| is_text(byte)) {
                break;
            }
            rest = after.get(1..).unwrap_or_default();
            let line = String::from_utf8_lossy(line);
            let (key, value) = line.trim().split_once(' ').unwrap_or((line.trim(), ""));
            header.line(key, value.trim());
            if header.ended {
                break;
            }
        }
        header.data_start = bytes.len() - rest.len();
        header
    }

    fn line(&mut self, key: &str, value: &str) {
        match key {
            "end" => self.ended = true,
            "evt" => {
                self.encoding = Some(match value {
                    "3.0" => Encoding::Evt3,
                    "2.0" => Encoding::Evt2,
                    "2.1" => Encoding::Evt21,
                    other => Encoding::Other(other.to_owned()),
                });
            }
            "format" => self.format(value),
            "geometry" => {
                if let Some((width, height)) = value.split_once('x') {
                    self.geometry = geometry(width, height).or(self.geometry);
                }
            }
            ORIGIN_KEY => self.origin_us = value.parse().unwrap_or(0),
            _ => {}
        }
    }

    /// "EVT3;height=720;width=1280".
    fn format(&mut self, value: &str) {
        let mut parts = value.split(';');
        self.encoding = match parts.next() {
            Some("EVT3") => Some(Encoding::Evt3),
            Some("EVT2") => Some(Encoding::Evt2),
            Some("EVT21") => Some(Encoding::Evt21),
            Some(other) => Some(Encoding::Other(other.to_owned())),
            None => self.encoding.take(),
        };
        let (mut width, mut height) = ("", "");
        for part in parts {
            match part.split_once('=') {
                Some(("width", value)) => width = value,
                Some(("height", value)) => height = value,
                _ => {}
            }
        }
        self.geometry = geometry(width, height).or(self.geometry);
    }
}

fn is_text(byte: u8) -> bool {
    byte == b'\t' || byte == b'\r' || (b' '..0x7F).contains(&byte)
}

fn geometry(width: &str, height: &str) -> Option<Geometry> {
    let (width, height) = (width.trim().parse().ok()?, height.trim().parse().ok()?);
    (width > 0 && height > 0).then_some(Geometry { width, height })
}

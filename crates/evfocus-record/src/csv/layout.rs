//! Which column of a text file is what.

use evfocus_core::{CameraMicros, Event, Geometry, Polarity};

use super::number::{is_fractional, polarity, seconds};

/// The unit of a file's times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeUnit {
    /// Whole microseconds.
    Microseconds,
    /// Seconds, whole or not.
    Seconds,
}

/// What separates the fields of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Separator {
    Char(char),
    /// Any amount of blanks and tabs.
    Space,
}

/// Which column is what, and in which unit the times are.
///
/// A header names the columns: `t`, `ts`, `time` or `timestamp`, with a unit (`t_us`, `t_s`, `timestamp [us]`) or without;
/// `x`; `y`; `p`, `pol`, `polarity` or `on`; others are passed over. A width or height may follow (`x@640`, as faery writes
/// it). Without a header there must be four columns, either `x,y,p,t` (Prophesee's tools) or `t x y p` (the data sets of the
/// University of Zurich), and the first lines must fit only one of them. Times without a unit are seconds if any of the first
/// lines has a fraction, else microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    separator: Separator,
    has_header: bool,
    time: usize,
    x: usize,
    y: usize,
    polarity: usize,
    unit: TimeUnit,
    geometry: Option<Geometry>,
}

/// Why the columns are not clear, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {what}")]
pub struct LayoutError {
    /// Line number, from 1.
    pub line: u64,
    /// What is wrong with it.
    pub what: String,
}

/// Lines that are looked at to decide about columns without a header.
const SAMPLE_LINES: usize = 1000;

impl Layout {
    /// Decides from `start`, the first lines of a file; the last line may be cut off.
    ///
    /// # Errors
    /// [`LayoutError`] if there is no line, a header lacks a column, or the columns without a header are not clear.
    pub fn detect(start: &str) -> Result<Self, LayoutError> {
        let start = start.trim_start_matches('\u{feff}');
        // The last line is dropped if it is cut off, unless it is all there is.
        let whole = start.rfind('\n').map_or(start, |end| start.get(..end).unwrap_or(start));
        let mut lines = whole.lines().enumerate().filter(|(_, line)| !is_blank(line)).take(SAMPLE_LINES);
        let Some((index, first)) = lines.next() else {
            return Err(LayoutError { line: 1, what: String::from("there are no lines of events") });
        };
        let separator = Separator::of(first);
        let fields: Vec<&str> = separator.split(first).collect();
        let samples: Vec<&str> = lines.map(|(_, line)| line).collect();
        let error = |what| LayoutError { line: index as u64 + 1, what };
        if fields.iter().any(|field| field.parse::<f64>().is_err() && polarity(field).is_none()) {
            return Self::from_header(separator, &fields, &samples).map_err(error);
        }
        Self::without_header(separator, first, &samples).map_err(error)
    }

    /// Whether the first line names the columns.
    pub fn has_header(&self) -> bool {
        self.has_header
    }

    /// The unit of the times.
    pub fn unit(&self) -> TimeUnit {
        self.unit
    }

    /// The sensor's size, if the header tells it.
    pub fn geometry(&self) -> Option<Geometry> {
        self.geometry
    }

    /// The event in a line.
    ///
    /// # Errors
    /// What is wrong with the line, in words.
    pub fn parse(&self, line: &str) -> Result<Event, String> {
        let (mut time, mut x, mut y, mut on) = (None, None, None, None);
        for (index, field) in self.separator.split(line).enumerate() {
            // A column has one role, so the order of these does not matter.
            if index == self.time {
                time = Some(self.time(field)?);
            } else if index == self.x {
                x = Some(coordinate(field, 'x')?);
            } else if index == self.y {
                y = Some(coordinate(field, 'y')?);
            } else if index == self.polarity {
                on =
                    Some(polarity(field).ok_or_else(|| {
                        format!("{field:?} is no polarity (1 or 0, 1 or -1, true or false)")
                    })?);
            }
        }
        let (Some(time), Some(x), Some(y), Some(on)) = (time, x, y, on) else {
            return Err(String::from("there are too few fields"));
        };
        if let Some(geometry) = self.geometry
            && !geometry.contains(x, y)
        {
            return Err(format!(
                "column {x}, row {y} lie outside of the {}x{} sensor",
                geometry.width, geometry.height
            ));
        }
        Ok(Event { t: CameraMicros(time), x, y, polarity: Polarity::from_on(on) })
    }

    fn time(&self, field: &str) -> Result<i64, String> {
        match self.unit {
            TimeUnit::Seconds => seconds(field).ok_or_else(|| format!("{field:?} is not a time in seconds")),
            TimeUnit::Microseconds => {
                field.parse().map_err(|_| format!("{field:?} is not a time in whole microseconds"))
            }
        }
    }

    fn from_header(separator: Separator, names: &[&str], samples: &[&str]) -> Result<Self, String> {
        let (mut time, mut x, mut y, mut polarity) = (None, None, None, None);
        let (mut unit, mut width, mut height) = (None, None, None);
        for (index, name) in names.iter().enumerate() {
            let (name, size) = name.split_once('@').unwrap_or((name, ""));
            let name = normalised(name);
            let column = match name.as_str() {
                "x" => {
                    width = size.parse().ok();
                    &mut x
                }
                "y" => {
                    height = size.parse().ok();
                    &mut y
                }
                "p" | "pol" | "polarity" | "on" => &mut polarity,
                _ => match time_column(&name) {
                    TimeColumn::None => continue,
                    TimeColumn::Unsupported => {
                        return Err(format!("times must be in microseconds or seconds, not as in {name:?}"));
                    }
                    TimeColumn::Plain => &mut time,
                    TimeColumn::In(named) => {
                        unit = Some(named);
                        &mut time
                    }
                },
            };
            if column.replace(index).is_some() {
                return Err(format!("two columns are called {name:?}"));
            }
        }
        let (Some(time), Some(x), Some(y), Some(polarity)) = (time, x, y, polarity) else {
            return Err(String::from(
                "this header does not name the columns t (or t_us, t_s, timestamp), x, y and p (or polarity, on)",
            ));
        };
        let geometry = match (width, height) {
            (Some(width), Some(height)) if width > 0 && height > 0 => Some(Geometry { width, height }),
            _ => None,
        };
        let unit = unit.unwrap_or_else(|| unit_of(separator, time, samples));
        Ok(Self { separator, has_header: true, time, x, y, polarity, unit, geometry })
    }

    fn without_header(separator: Separator, first: &str, samples: &[&str]) -> Result<Self, String> {
        let lines = || std::iter::once(first).chain(samples.iter().copied());
        if separator.split(first).count() != 4 {
            return Err(String::from("without a header there must be four columns"));
        }
        let candidate = |time, x, y, polarity| {
            let lines: Vec<&str> = lines().collect();
            let unit = unit_of(separator, time, &lines);
            let layout = Self { separator, has_header: false, time, x, y, polarity, unit, geometry: None };
            layout.fits(&lines).then_some(layout)
        };
        let candidates = [candidate(3, 0, 1, 2), candidate(0, 1, 2, 3)];
        match candidates {
            [Some(layout), None] | [None, Some(layout)] => Ok(layout),
            [None, None] => Err(String::from("the first lines are neither x,y,p,t nor t,x,y,p")),
            [Some(_), Some(_)] => Err(String::from("the first lines may be x,y,p,t as well as t,x,y,p")),
        }
    }

    /// Whether all lines are events in order of time.
    fn fits(&self, lines: &[&str]) -> bool {
        let mut last = i64::MIN;
        lines.iter().all(|line| {
            self.parse(line).is_ok_and(|event| std::mem::replace(&mut last, event.t.0) <= event.t.0)
        })
    }
}

impl Separator {
    fn of(line: &str) -> Self {
        [',', ';'].into_iter().find(|&c| line.contains(c)).map_or(Self::Space, Self::Char)
    }

    fn split(self, line: &str) -> impl Iterator<Item = &str> {
        // One of the two is empty; a common type for both costs less than a box per line.
        let (by_char, by_space) = match self {
            Self::Char(c) => (Some(line.split(c).map(str::trim)), None),
            Self::Space => (None, Some(line.split_whitespace())),
        };
        by_char.into_iter().flatten().chain(by_space.into_iter().flatten())
    }
}

/// Whether a line has nothing to say: empty, or a comment.
pub(super) fn is_blank(line: &str) -> bool {
    let line = line.trim();
    line.is_empty() || line.starts_with('#')
}

/// "Timestamp [us]" as "timestamp_us".
fn normalised(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("_")
}

/// What a column's name says about times.
enum TimeColumn {
    None,
    Plain,
    In(TimeUnit),
    Unsupported,
}

fn time_column(name: &str) -> TimeColumn {
    let (base, unit) = name.split_once('_').unwrap_or((name, ""));
    if !["t", "ts", "time", "timestamp"].contains(&base) {
        return TimeColumn::None;
    }
    match unit {
        "" => TimeColumn::Plain,
        "us" | "usec" | "micros" | "microseconds" => TimeColumn::In(TimeUnit::Microseconds),
        "s" | "sec" | "seconds" => TimeColumn::In(TimeUnit::Seconds),
        "ms" | "ns" => TimeColumn::Unsupported,
        _ => TimeColumn::None,
    }
}

fn unit_of(separator: Separator, time: usize, lines: &[&str]) -> TimeUnit {
    let fractional = lines.iter().any(|line| separator.split(line).nth(time).is_some_and(is_fractional));
    if fractional { TimeUnit::Seconds } else { TimeUnit::Microseconds }
}

fn coordinate(field: &str, axis: char) -> Result<u16, String> {
    field.parse().map_err(|_| format!("{field:?} is no {axis} coordinate (0 to 65535)"))
}

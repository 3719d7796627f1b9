//! Events as text, one a line. Which columns there are, and in which unit the times are, is decided once, by the header or,
//! without one, by the first lines; see [`Layout`].

mod layout;
mod number;
mod reader;
mod writer;

pub use layout::{Layout, LayoutError, TimeUnit};
pub use writer::CsvWriter;

pub(crate) use reader::CsvSource;

/// The longest line that is read, in bytes.
pub const MAX_LINE_BYTES: usize = 4096;

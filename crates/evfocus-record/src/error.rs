//! Why a recording or a positions file could not be read or written.

use std::io;
use std::path::PathBuf;

/// What went wrong with which file, and what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file could not be opened.
    #[error("{}: cannot open: {source}; {remedy}", path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
        /// What the user can do.
        remedy: &'static str,
    },
    /// Reading stopped with an error of the operating system.
    #[error("{}: cannot read on: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// Writing failed.
    #[error("{}: cannot write: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        source: io::Error,
    },
    /// The content is of no kind that evfocus reads.
    #[error("{}: not a recording that evfocus reads: {found}; {remedy}", path.display())]
    Unrecognised {
        /// The file.
        path: PathBuf,
        /// What the content looks like.
        found: String,
        /// What the user can do.
        remedy: String,
    },
    /// The content breaks the rules of its format at a place that cannot be skipped.
    #[error("{}: at byte {offset}: {what}; {remedy}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// Bytes from the start of the file.
        offset: u64,
        /// What was found there.
        what: String,
        /// What the user can do.
        remedy: &'static str,
    },
    /// A line of a text file is not what it must be.
    #[error("{}: line {line}: {what}: {text:?}; {remedy}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: u64,
        /// What is wrong.
        what: String,
        /// The offending text, shortened if long.
        text: String,
        /// What the user can do.
        remedy: &'static str,
    },
    /// An event cannot be expressed in the format it is to be written in.
    #[error("{}: {source}", path.display())]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: crate::encode::EncodeError,
    },
}

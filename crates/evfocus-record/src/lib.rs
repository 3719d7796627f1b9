//! Recordings of event cameras: reading, writing, summing up.
//!
//! [`Recording::open`] recognises a file by its content and hands out its events batch by batch; [`Summary`] counts a whole
//! file in one pass; [`Evt3Writer`] and its siblings write files that the tools of the field read; [`positions`] reads and
//! writes where the lens was meanwhile; [`ReplayCamera`] plays a file as if it were a camera. The decoders are those of live cameras, [`evfocus_core::decode`].
//!
//! Not its job: judging whether a recording is good enough to focus with, opening devices, decompressing archives.
//!
//! # Memory
//! A reader holds one buffer of [`READ_BYTES`] (for AEDAT4 one packet, at most [`aedat4::MAX_PACKET_BYTES`]) whatever the
//! size of the file, and appends at most [`MAX_EVENTS_PER_READ`] events to the batch it is lent.

pub mod aedat4;
pub mod csv;
pub mod encode;
pub mod positions;

mod error;
mod format;
mod raw_header;
mod raw_writer;
mod recording;
mod replay;
mod sniff;
mod summary;
mod words;

pub use aedat4::{Aedat4Compression, Aedat4Writer};
pub use csv::CsvWriter;
pub use error::RecordError;
pub use format::{Format, UnknownFormat};
pub use raw_writer::Evt3Writer;
pub use recording::{MAX_EVENTS_PER_READ, READ_BYTES, Recording};
pub use replay::{ReplayCamera, ReplayEnd, ReplayPace};
pub use summary::{GAP_US, PEAK_WINDOW_US, Summary};

//! One file for each subcommand: its options, and what it does.

pub mod abort;
pub mod analyze;
pub mod calibrate;
pub mod completions;
pub mod demo;
pub mod devices;
pub mod doctor;
pub mod eval;
pub mod focus;
pub mod info;
pub mod man;
pub mod measure;
pub mod mode;
pub mod move_lens;
pub mod pause;
pub mod record;
pub mod reload;
pub mod replay;
pub mod report;
pub mod simulate;
pub mod status;
pub mod watch;

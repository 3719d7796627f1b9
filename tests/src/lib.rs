//! What the workspace tests share.

pub mod recorded_sweeps;

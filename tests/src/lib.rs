//! What the workspace tests share.

pub mod random_runs;
pub mod recorded_sweeps;

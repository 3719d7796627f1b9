//! What the workspace tests share.

pub mod fault_laboratory;
pub mod random_runs;
pub mod recorded_sweeps;

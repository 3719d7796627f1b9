//! What the workspace tests share.

pub mod continuous;
pub mod fault_laboratory;
pub mod lens_faults;
pub mod lenses;
pub mod random_runs;
pub mod recorded_sweeps;

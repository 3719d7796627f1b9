//! What judges evfocus: the baselines of the paper, data sets with known focus, errors and tables.
//!
//! - [`operators`] are the eleven focus operators on pictures that the paper compares with; [`GreyImage`] is what they look at.
//! - [`reconstruct`] makes pictures from events, [`frames`] makes the frames of a simulated camera.
//! - [`dataset`] has the sequences: simulated ones and those of others; [`simulated_sweep`] makes one.
//! - [`evaluate()`] asks every [`Candidate`] about every sequence; [`tables`] and [`figures`] show what came of it.
//!
//! Not its job: focusing. Nothing that runs on a rig depends on this crate.

pub mod cache;
mod candidate;
pub mod dataset;
mod evaluate;
pub mod figures;
pub mod frames;
mod grey_image;
pub mod operators;
pub mod reconstruct;
pub mod result;
pub mod simulated_sweep;
pub mod tables;

pub use cache::Cache;
pub use candidate::Candidate;
pub use evaluate::evaluate;
pub use grey_image::GreyImage;
pub use operators::Operator;

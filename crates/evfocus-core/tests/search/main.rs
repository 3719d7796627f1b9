//! Focus measures, searches and what they say of a sweep's quality, on streams whose answer is known.
#![expect(clippy::unwrap_used, reason = "a test whose own fixture is missing fails")]

#[path = "../support/random.rs"]
mod random;
mod stream;

mod egs;
mod egs_official;
mod measures;
mod quality;
mod structure;

//! The program from outside: arguments in, output and exit status out.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that panics has failed, as it should"
)]

mod analyze;
mod bad_input;
mod daemon;
mod demo;
mod eval;
mod program;
#[cfg(test)]
mod record;

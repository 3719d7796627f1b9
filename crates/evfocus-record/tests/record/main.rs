//! Tests of evfocus-record from outside, in one binary.

#[cfg(test)]
mod chunks;
#[cfg(test)]
mod common;
#[cfg(test)]
mod csv;
#[cfg(test)]
mod damaged;
#[cfg(test)]
mod foreign;
#[cfg(test)]
mod lossless;
#[cfg(test)]
mod positions;
#[cfg(test)]
mod recordings;
#[cfg(test)]
mod replay;
#[cfg(test)]
mod summary;

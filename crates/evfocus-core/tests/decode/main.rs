//! Decoding and counting the words of cameras.

#[cfg(test)]
mod common;
#[cfg(test)]
mod counts;
#[cfg(test)]
mod pieces;
#[cfg(test)]
mod plain;
#[cfg(test)]
mod words;

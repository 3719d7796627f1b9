//! The drivers over emulated devices, in virtual time.

#[cfg(test)]
mod common;
#[cfg(test)]
mod configuration;
#[cfg(test)]
mod conformance;
#[cfg(test)]
mod discovery;
#[cfg(test)]
mod faults;
#[cfg(test)]
mod opening;

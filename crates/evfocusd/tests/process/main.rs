//! The daemon as a process, with the simulated rig in real time.

mod clients;
mod clock;
mod daemon;
mod disk;
mod faults;
mod life;

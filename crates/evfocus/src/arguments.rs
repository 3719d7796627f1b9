//! Options and values that several subcommands take.

mod choice;
mod config;
mod duration;
mod position;
mod rig;
mod socket;
mod window;

pub use choice::choices;
pub use config::ConfigArguments;
pub use duration::duration;
pub use position::{position, speed};
pub use rig::RigArguments;
pub use socket::SocketArguments;
pub use window::window;

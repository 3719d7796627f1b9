//! Options and values that several subcommands take.

mod choice;
mod duration;
mod position;
mod rig;
mod socket;
mod window;

pub use choice::choices;
pub use duration::duration;
pub use position::{position, speed};
pub use rig::RigArguments;
pub use socket::SocketArguments;
pub use window::window;

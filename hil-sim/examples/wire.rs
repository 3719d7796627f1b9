//! Serves an emulated lens controller to other programs until its standard input ends.
//!
//! `cargo run -p hil-sim --example wire -- moonlite` prints the path of a pseudo-terminal, or for protocols over TCP an address on
//! the loopback interface, and then ten times a second where the glass is.

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use evfocus_hal::{Clock, SystemClock};
use hil_sim::wire::{Protocol, Server};
use hil_sim::{Rig, RigConfig};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or_default();
    let protocol: Protocol = name.parse()?;
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let rig = Rig::new(RigConfig::default(), Arc::clone(&clock))?;
    let server = match protocol {
        Protocol::MoonLite | Protocol::Optotune | Protocol::Grbl | Protocol::Firmata => {
            Server::pty(rig.wire(protocol))?
        }
        Protocol::LabJack | Protocol::Indi => Server::tcp(rig.wire(protocol))?,
    };
    let mut out = std::io::stdout();
    writeln!(out, "{}", server.address())?;
    let (ended_in, ended) = channel();
    std::thread::spawn(move || {
        // Whatever ends the input, it has ended.
        std::io::stdin().read_to_end(&mut Vec::new()).unwrap_or_default();
        drop(ended_in);
    });
    while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(Duration::from_millis(100)) as Result<(), _>
    {
        writeln!(out, "{:.1}", rig.glass(clock.now()).0)?;
        out.flush()?;
    }
    Ok(())
}

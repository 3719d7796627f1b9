//! How long a command takes from the decision until its first bytes are written: through the daemon's lens thread and each driver, to the
//! model of its device on a pseudo-terminal or a socket, in real time. A motion of a lens that the driver steers has left when the loop has
//! it. A report; nothing is asserted.
#![expect(clippy::print_stdout, reason = "the report is what this program is for")]

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use evfocus_hal::{Clock, Lens, SystemClock};
use evfocus_lens::{Port, firmata, grbl, moonlite, optotune};
use evfocusd::config::LensBackend;
use evfocusd::{Config, Departures, command_latency, devices};
use hil_sim::Rig;
use hil_sim::wire::{Protocol, Server, WirePort};

/// Orders of each lens.
const ORDERS: usize = 400;

const LENSES: [(&str, u32); 7] = [
    ("backend = \"simulated\"", 0),
    (
        "backend = \"moonlite\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\n[lens.moonlite]\nmax_speed_counts_per_s = 1000",
        moonlite::BAUD,
    ),
    ("backend = \"optotune\"\nport = \"emulated\"", optotune::BAUD),
    (
        "backend = \"grbl\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750\npoll_ms = 20",
        grbl::BAUD,
    ),
    ("backend = \"firmata\"\nport = \"emulated\"\nmin_counts = 220\nmax_counts = 3750", firmata::BAUD),
    ("backend = \"labjack\"\naddress = \"emulated\"\nmin_counts = 220\nmax_counts = 3750", 0),
    ("backend = \"indi\"\naddress = \"emulated\"\n[lens.indi]\ndevice = \"Focuser\"", 0),
];

fn main() -> Result<()> {
    println!("Milliseconds from the decision until the command has left, {ORDERS} commands each.\n");
    println!("| driver | median | 99 % | most |\n| --- | ---: | ---: | ---: |");
    for (section, baud) in LENSES {
        let config = Config::parse(&format!("[lens]\n{section}"), Path::new("(in the benchmark)"))?;
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let departures = Departures::new(Arc::clone(&clock));
        let (lens, _server): (Box<dyn Lens>, Option<Server>) = match &config.lens {
            LensBackend::Simulated => {
                (Box::new(Rig::new(config.rig.clone(), Arc::clone(&clock))?.devices().1), None)
            }
            LensBackend::Driver { driver, .. } => {
                let wire = WirePort::with_a_motor(driver.protocol(), config.rig.lens, Arc::clone(&clock));
                let (server, port) = if matches!(driver.protocol(), Protocol::LabJack | Protocol::Indi) {
                    let server = Server::tcp(wire)?;
                    let port = Port::tcp(server.address(), Arc::clone(&clock));
                    (server, port)
                } else {
                    let server = Server::pty(wire)?;
                    let port = Port::serial(server.address(), baud, Arc::clone(&clock));
                    (server, port)
                };
                (devices::open_driver(driver, departures.tap(port), Arc::clone(&clock))?, Some(server))
            }
        };
        let mut latencies = command_latency(lens, config.lens_poll, ORDERS, &departures);
        latencies.sort_unstable();
        let millis = |share: f64| {
            let index = ((latencies.len() as f64 * share) as usize).min(latencies.len().saturating_sub(1));
            latencies.get(index).map_or(f64::NAN, |latency: &Duration| latency.as_secs_f64() * 1e3)
        };
        println!(
            "| {} | {:.3} | {:.3} | {:.3} |",
            config.lens.name(),
            millis(0.5),
            millis(0.99),
            millis(1.0)
        );
    }
    Ok(())
}

//! Opens the only camera that there is with the crate neuromorphic-drivers (libusb), and prints sums over the first 2, 4, 8 and
//! so on events that it decodes, in the form in which `hil-sim serve` prints those that it sent.
//!
//! usage: evfocus-rig-witness EVENTS

use std::error::Error;
use std::time::{Duration, Instant};

use neuromorphic_drivers::types::{Polarity, PolarityEvent};
use neuromorphic_drivers::{Adapter, RingConfiguration};

/// How long the events may take to come.
const PATIENCE: Duration = Duration::from_secs(120);

#[derive(Default)]
struct Sums {
    events: u64,
    on: u64,
    x: u64,
    y: u64,
    first_us: u64,
    t_us: u64,
}

impl Sums {
    fn add(&mut self, event: PolarityEvent<u64, u16, u16>, wanted: u64) {
        if self.events == wanted {
            return;
        }
        if self.events == 0 {
            self.first_us = event.t;
        }
        self.events += 1;
        self.on += u64::from(matches!(event.polarity, Polarity::On));
        self.x += u64::from(event.x);
        self.y += u64::from(event.y);
        self.t_us += event.t - self.first_us;
        if self.events >= 2 && self.events.is_power_of_two() {
            let Self { events, on, x, y, t_us, .. } = self;
            println!("tally: {events} events, {on} on, x {x}, y {y}, t since the first {t_us}");
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: u64 = std::env::args().nth(1).ok_or("say how many events")?.parse()?;
    for device in neuromorphic_drivers::list_devices()? {
        println!("found {device:?}");
    }
    let (flag, event_loop) = neuromorphic_drivers::flag_and_event_loop()?;
    let ring = RingConfiguration { buffer_length: 1 << 14, ring_length: 64, parallel_submissions: 8 };
    let device = neuromorphic_drivers::open(
        neuromorphic_drivers::Identifier::None,
        None,
        Some(ring),
        event_loop,
        flag.clone(),
    )?;
    println!("opened {} {} at {}", device.name(), device.serial(), device.connection());
    let mut adapter = device.create_adapter();
    let mut sums = Sums::default();
    let began = Instant::now();
    while sums.events < wanted {
        flag.load_error()?;
        if began.elapsed() > PATIENCE {
            return Err(format!("only {} events", sums.events).into());
        }
        let Some(view) = device.next_with_timeout(&Duration::from_millis(100)) else { continue };
        match &mut adapter {
            Adapter::Davis346(adapter) => {
                adapter.convert(view.slice, |event| sums.add(event, wanted), |_| {}, |_| {}, |_| {});
            }
            Adapter::Evt3(adapter) => adapter.convert(view.slice, |event| sums.add(event, wanted), |_| {}),
            _ => return Err("a camera of another kind".into()),
        }
    }
    println!("{} packets dropped", device.dropped_packets());
    Ok(())
}

//! What answers on a port is found, by its model.

use std::time::Duration;

use evfocus_hal::{DeviceError, DeviceErrorKind, SystemClock, Transport};
use evfocus_lens::{ask_all, probe};
use hil_sim::LensConfig;
use hil_sim::wire::{Protocol, Server, WireFault};

use crate::bench::{Bench, stands};

/// What is found behind the model of `protocol`, which hears only what is sent at `baud`.
fn ask(bench: &Bench, baud: u32) -> Result<Option<&'static str>, DeviceError> {
    // At another speed nobody understands anybody.
    let open = |asked: u32| -> Result<Box<dyn Transport>, DeviceError> {
        if asked == baud {
            bench.wire.open()
        } else {
            Ok(Box::new(Deaf(std::sync::Arc::clone(&bench.clock))))
        }
    };
    Ok(ask_all(open, bench.clock.as_ref())?.map(|answered| answered.driver))
}

/// A line from which nothing comes.
struct Deaf(std::sync::Arc<dyn evfocus_hal::Clock>);

impl Transport for Deaf {
    fn write(&mut self, _: &[u8]) -> Result<(), DeviceError> {
        Ok(())
    }
    fn read(&mut self, _: &mut [u8], deadline: evfocus_core::HostMicros) -> Result<usize, DeviceError> {
        self.0.sleep_until(deadline);
        Ok(0)
    }
    fn listen(&mut self, _: &evfocus_hal::Bell) {}
    fn drain(&mut self) -> Result<(), DeviceError> {
        Ok(())
    }
}

const SPEEDS: [(Protocol, u32); 4] = [
    (Protocol::MoonLite, 9600),
    (Protocol::Optotune, 115_200),
    (Protocol::Grbl, 115_200),
    (Protocol::Firmata, 57_600),
];

#[test]
fn each_device_is_known_by_its_answer_and_does_not_move() {
    for (protocol, baud) in SPEEDS {
        let bench = Bench::new(protocol, LensConfig::default());
        let began = bench.now();
        assert_eq!(ask(&bench, baud).unwrap(), Some(protocol.name()));
        assert!(bench.now().since(began) < Duration::from_secs(8));
        stands(&bench);
        assert!(bench.glass().distance(evfocus_core::LensPosition(220.0)) < 1.0, "{protocol} moved");
    }
}

#[test]
fn a_board_that_boots_is_waited_for() {
    for (protocol, baud) in SPEEDS {
        let bench = Bench::new(protocol, LensConfig::default());
        bench.wire.strike(WireFault::Reset);
        assert_eq!(ask(&bench, baud).unwrap(), Some(protocol.name()), "{protocol}");
    }
}

#[test]
fn silence_garbage_and_another_device_are_nothing() {
    for fault in [WireFault::Silence, WireFault::Garbage] {
        for (protocol, baud) in SPEEDS {
            let bench = Bench::new(protocol, LensConfig::default());
            bench.wire.strike(fault);
            let began = bench.now();
            assert_eq!(ask(&bench, baud).unwrap(), None, "{protocol}, {fault:?}");
            assert!(bench.now().since(began) < Duration::from_secs(9), "{protocol}, {fault:?}");
        }
    }
}

#[test]
fn a_pseudo_terminal_is_asked_and_a_port_in_use_is_left_alone() {
    let bench = Bench::live(Protocol::Grbl, LensConfig::default());
    let server = Server::pty(bench.wire.clone()).unwrap();
    let clock: std::sync::Arc<dyn evfocus_hal::Clock> = std::sync::Arc::new(SystemClock::new());
    assert_eq!(probe(server.address(), &clock).unwrap().unwrap().driver, "grbl");
    let port = evfocus_lens::Port::serial(server.address(), 115_200, std::sync::Arc::clone(&clock));
    let range = LensConfig::default().range;
    let config = evfocus_lens::grbl::GrblConfig {
        axis: evfocus_lens::grbl::protocol::Axis::X,
        range,
        needs_homing: false,
    };
    let _lens = evfocus_lens::Grbl::open(port, config, std::sync::Arc::clone(&clock)).unwrap();
    assert_eq!(probe(server.address(), &clock).unwrap_err().kind, DeviceErrorKind::Busy);
    assert_eq!(probe("/dev/ttyNOBODY", &clock).unwrap_err().kind, DeviceErrorKind::Disconnected);
}

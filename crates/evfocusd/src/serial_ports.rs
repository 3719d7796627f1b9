//! The serial ports that a lens could be attached to, and what answers on them.

use std::path::Path;
use std::sync::Arc;

use evfocus_hal::{Clock, DeviceErrorKind, SystemClock};
use evfocus_ipc::{Device, DeviceRole, DeviceState};
use evfocus_lens::UsbPort;
use rustix::fs::Access;

/// What a port is called as long as nobody knows what is on it.
const PORT: &str = "serial port";

/// The ports that are on USB, besides the one that is `used`; with `probe` each is asked what answers there, or those that it names.
pub(crate) fn free(used: &str, probe: Option<&[String]>) -> Vec<Device> {
    let used = std::fs::canonicalize(used).unwrap_or_default();
    let is_free = |path: &str| std::fs::canonicalize(path).unwrap_or_else(|_| path.into()) != used;
    let named = probe.unwrap_or_default();
    let mut ports = evfocus_lens::usb_ports();
    let unlisted = |path: &&String| !ports.iter().any(|port| port.path == **path);
    let others: Vec<_> = named.iter().filter(unlisted).cloned().collect();
    let plain = |path| UsbPort { path, product: String::new(), serial: String::new() };
    ports.extend(others.into_iter().map(plain));
    ports.retain(|port| is_free(&port.path));
    let is_asked = |port: &UsbPort| probe.is_some() && (named.is_empty() || named.contains(&port.path));
    // One after the other would take seconds each.
    std::thread::scope(|scope| {
        let asked: Vec<_> = ports
            .into_iter()
            .map(|port| {
                let asked = is_asked(&port);
                scope.spawn(move || look(port, asked))
            })
            .collect();
        // A panic has been printed; the other ports are worth telling.
        asked.into_iter().filter_map(|thread| thread.join().ok()).collect()
    })
}

fn look(UsbPort { path, product, serial }: UsbPort, ask: bool) -> Device {
    let may = rustix::fs::access(&path, Access::READ_OK | Access::WRITE_OK).is_ok();
    let remedy = "let the user that evfocusd runs as into the group that owns the port, dialout on Debian";
    let is_there = Path::new(&path).exists();
    let (state, message) = match (is_there, may) {
        (false, _) => (DeviceState::Missing, Some("there is no such port".to_owned())),
        (true, false) => (DeviceState::PermissionDenied, Some(remedy.to_owned())),
        (true, true) => (DeviceState::Available, None),
    };
    let device = Device {
        role: DeviceRole::Lens,
        driver: PORT.to_owned(),
        model: product,
        serial,
        location: path,
        state,
        message,
    };
    if ask && may { asked(device) } else { device }
}

/// `device` with what answers there.
fn asked(device: Device) -> Device {
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    match evfocus_lens::probe(&device.location, &clock) {
        Ok(Some(answered)) => Device {
            driver: answered.driver.to_owned(),
            message: Some(format!(
                "answers ({}): lens.backend = \"{}\", lens.port = \"{}\"",
                answered.words, answered.driver, device.location
            )),
            ..device
        },
        Ok(None) => {
            let message = Some("nothing that there is a driver for answers; is its power on?".to_owned());
            Device { message, ..device }
        }
        Err(error) => {
            let state = if error.kind == DeviceErrorKind::Busy {
                DeviceState::Busy
            } else if error.kind == DeviceErrorKind::PermissionDenied {
                DeviceState::PermissionDenied
            } else {
                device.state
            };
            Device { state, message: Some(error.what), ..device }
        }
    }
}

//! Which serial ports there are to attach a lens to.

use serialport::SerialPortType;

/// A serial port on USB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbPort {
    /// The device file.
    pub path: String,
    /// What the USB device calls itself; empty if it does not.
    pub product: String,
    /// Its serial number; empty if it has none.
    pub serial: String,
}

/// The serial ports on USB, without opening them: that would reset some of the boards behind them. Empty where the operating
/// system does not tell.
pub fn usb_ports() -> Vec<UsbPort> {
    let ports = serialport::available_ports().unwrap_or_default();
    let usb = ports.into_iter().filter_map(|port| match port.port_type {
        SerialPortType::UsbPort(info) => Some(UsbPort {
            path: port.port_name,
            product: info.product.unwrap_or_default(),
            serial: info.serial_number.unwrap_or_default(),
        }),
        SerialPortType::PciPort | SerialPortType::BluetoothPort | SerialPortType::Unknown => None,
    });
    usb.collect()
}

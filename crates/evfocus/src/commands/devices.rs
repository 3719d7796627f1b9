//! `evfocus devices`: cameras and lenses.

use std::io::Write;

use clap::Args;
use evfocus_ipc::{Device, DeviceRole, DeviceState};

use crate::arguments::SocketArguments;
use crate::connection::{block_on, connect};
use crate::exit::Exit;
use crate::output::Output;

/// List the cameras and lenses in use, attached or configured
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  evfocus devices
  evfocus devices --probe
  evfocus devices --probe /dev/ttyUSB0,/dev/ttyACM0
  evfocus devices --json | jq '.[] | select(.state != \"active\")'")]
pub struct Arguments {
    /// Ask what answers on the free serial ports: those on USB, or those named. Resets some boards; up to 8 s a port
    #[arg(long, value_name = "PORT", num_args = 0.., value_delimiter = ',')]
    probe: Option<Vec<String>>,
    #[command(flatten)]
    socket: SocketArguments,
}

/// Prints the list.
pub fn run(arguments: &Arguments) -> anyhow::Result<Exit> {
    let devices = block_on(async {
        let mut client = connect(&arguments.socket).await?;
        Ok(match arguments.probe.clone() {
            None => client.devices().await?,
            Some(ports) => client.devices_asked(ports).await?,
        })
    })?;
    let mut out = Output::new();
    if arguments.socket.json {
        out.json(&devices)?;
    } else if devices.is_empty() {
        writeln!(out, "no devices")?;
    } else {
        for device in &devices {
            print(device, &mut out)?;
        }
    }
    Ok(Exit::Done)
}

fn print(device: &Device, out: &mut Output) -> anyhow::Result<()> {
    let role = match device.role {
        DeviceRole::Camera => "camera",
        DeviceRole::Lens => "lens",
    };
    let state = match device.state {
        DeviceState::Active => "in use",
        DeviceState::Available => "available",
        DeviceState::PermissionDenied => "permission denied",
        DeviceState::Busy => "busy",
        DeviceState::Missing => "missing",
    };
    let name = format!("{} {}", device.model, device.serial);
    writeln!(out, "{role:<6}  {:<28}  {:<12}  {:<12}  {state}", name.trim(), device.driver, device.location)?;
    if let Some(message) = &device.message {
        writeln!(out, "        {message}")?;
    }
    Ok(())
}

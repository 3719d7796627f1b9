//! `hil-sim`: a whole simulated rig for other programs, on the interfaces that a real one has.
//!
//! `hil-sim serve --camera davis346 --lens moonlite` offers the camera over USB/IP, for `usbip attach` of Linux, and the lens on a
//! pseudo-terminal (or a TCP port, if its protocol is one over TCP). It prints where they are, takes orders from its standard
//! input, line by line, and ends with it.

use std::io::{BufRead, Write};
use std::sync::Arc;
use std::time::Duration;

use clap::{Args, Parser, Subcommand};
use evfocus_core::{Geometry, LensPosition};
use evfocus_hal::{Clock, SystemClock};
use hil_sim::usbip;
use hil_sim::wire::{Protocol, Server, WireFault, WirePort};
use hil_sim::{
    CameraModel, LensConfig, Light, MotionConfig, OpticsConfig, Rig, RigConfig, Scene, SensorConfig,
    UsbModel, UsbPort,
};

/// Between the two looks at the lens that tell whether it moves.
const LOOK: Duration = Duration::from_millis(100);

/// A simulated rig for other programs.
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Offer a rig until standard input ends. Orders, one a line: "unplug camera", "plug camera", "unplug lens", "plug lens",
    /// "state" (where the glass is), "sent" (events that the camera put into its streams), "tally N" (sums over the first N events that the camera sent; N is a power of two).
    Serve(Serve),
}

#[derive(Debug, Args)]
struct Serve {
    /// Camera on USB/IP: davis346 or evk4.
    #[arg(long, value_name = "MODEL", value_parser = camera)]
    camera: Option<UsbModel>,
    /// TCP port of the camera; 0 for any that is free.
    #[arg(long, value_name = "PORT", default_value_t = 3240)]
    usbip_port: u16,
    /// Protocol of the lens: moonlite, optotune, grbl, firmata, labjack or indi.
    #[arg(long, value_name = "PROTOCOL")]
    lens: Option<Protocol>,
    /// Serial port to offer the lens on; default: a new pseudo-terminal. Not for labjack and indi.
    #[arg(long, value_name = "PATH", requires = "lens")]
    lens_port: Option<String>,
    /// What the camera looks at.
    #[arg(long, default_value = "dead-leaves")]
    scene: Scene,
    /// Columns and rows of pixels that are simulated, the upper left part of the sensor: fewer take less time. Default: all.
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = geometry)]
    pixels: Option<Geometry>,
    /// Lens position at which the scene is sharp, counts.
    #[arg(long, value_name = "COUNTS", default_value_t = 1985.0)]
    focus: f64,
    /// Where the lens stands at first, counts.
    #[arg(long, value_name = "COUNTS", default_value_t = 220.0)]
    start: f64,
    /// Blur, pixels for each count away from focus. Default: a lens of the same focal length and aperture before each camera.
    #[arg(long, value_name = "PIXELS")]
    blur: Option<f64>,
    /// Hand shake, pixels RMS.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    shake: f64,
    /// Steady motion of the scene to the right, pixels per second.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.0)]
    velocity: f64,
    /// Events a second by chance from the pixels that are not simulated, below those that are.
    #[arg(long, value_name = "EVENTS", default_value_t = 0)]
    background: u32,
    /// Every random choice follows from it.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

fn camera(name: &str) -> Result<UsbModel, String> {
    match name {
        "davis346" => Ok(UsbModel::Davis346),
        "evk4" => Ok(UsbModel::Evk4),
        _ => Err("there are davis346 and evk4".to_owned()),
    }
}

fn geometry(text: &str) -> Result<Geometry, String> {
    let sides = text.split_once('x').and_then(|(width, height)| {
        Some(Geometry { width: width.parse().ok()?, height: height.parse().ok()? })
    });
    sides.ok_or_else(|| "write columns x rows, for example 173x130".to_owned())
}

impl Serve {
    fn rig(&self) -> RigConfig {
        let model = match self.camera {
            Some(UsbModel::Evk4) => CameraModel::Imx636,
            Some(UsbModel::Davis346) | None => CameraModel::Davis346,
        };
        let preset = RigConfig::preset(model, Light::Light);
        let geometry = self.pixels.unwrap_or(preset.sensor.geometry);
        let blur_px_per_count = self.blur.unwrap_or(preset.optics.blur_px_per_count);
        RigConfig {
            optics: OpticsConfig { blur_px_per_count, ..preset.optics },
            sensor: SensorConfig { geometry, ..preset.sensor },
            scene: self.scene,
            focus: LensPosition(self.focus),
            lens: LensConfig { start: LensPosition(self.start), ..preset.lens },
            motion: MotionConfig {
                shake_px_rms: self.shake,
                velocity_px_per_s: (self.velocity, 0.0),
                ..MotionConfig::default()
            },
            seed: self.seed,
            ..preset
        }
    }

    fn run(&self) -> Result<(), Box<dyn std::error::Error>> {
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let rig = Rig::new(self.rig(), Arc::clone(&clock))?;
        let mut out = std::io::stdout();
        let camera = self.camera.map(|model| rig.plug(model));
        if let (Some(camera), 1..) = (&camera, self.background) {
            camera.set_background(self.background);
        }
        let usbip = camera.clone().map(|port| usbip::Server::tcp(port, self.usbip_port)).transpose()?;
        if let Some(usbip) = &usbip {
            let address = usbip.address();
            writeln!(
                out,
                "camera: usbip --tcp-port {} attach --remote {} --busid {}",
                address.port(),
                address.ip(),
                usbip.bus_id()
            )?;
        }
        let lens = self.lens.map(|protocol| (protocol, rig.wire(protocol)));
        let server = lens.clone().map(|(protocol, port)| match (protocol, &self.lens_port) {
            (Protocol::LabJack | Protocol::Indi, _) => Server::tcp(port),
            (_, Some(path)) => Server::serial(port, path),
            (_, None) => Server::pty(port),
        });
        let server = server.transpose()?;
        if let Some(server) = &server {
            writeln!(out, "lens: {}", server.address())?;
        }
        writeln!(out, "ready")?;
        out.flush()?;
        let bench = Bench { rig, clock, camera, lens: lens.map(|(_, port)| port) };
        for line in std::io::stdin().lock().lines() {
            bench.obey(line?.trim(), &mut out)?;
            out.flush()?;
        }
        Ok(())
    }
}

/// What orders are about.
struct Bench {
    rig: Rig,
    clock: Arc<dyn Clock>,
    camera: Option<UsbPort>,
    lens: Option<WirePort>,
}

impl Bench {
    fn obey(&self, order: &str, out: &mut impl Write) -> std::io::Result<()> {
        match (order, &self.camera, &self.lens) {
            ("", ..) => return Ok(()),
            ("unplug camera", Some(camera), _) => camera.pull(),
            ("plug camera", Some(camera), _) => camera.push(),
            ("unplug lens", _, Some(lens)) => lens.strike(WireFault::Unplugged),
            ("plug lens", _, Some(lens)) => lens.repair(),
            ("state", ..) => {
                let before = self.rig.glass(self.clock.now()).0;
                self.clock.sleep_until(self.clock.now() + LOOK);
                let after = self.rig.glass(self.clock.now()).0;
                let speed = (after - before) / LOOK.as_secs_f64();
                return writeln!(out, "state: glass at {after:.1} counts, {speed:.0} counts/s");
            }
            ("sent", Some(camera), _) => {
                let (events, bytes) = camera.sent();
                return writeln!(out, "sent: {events} events, {bytes} bytes");
            }
            (_, Some(camera), _) if order.starts_with("tally ") => {
                let wanted = order.strip_prefix("tally ").and_then(|events| events.parse().ok());
                let tallies = camera.tallies();
                return match tallies.iter().find(|tally| Some(tally.events) == wanted) {
                    Some(hil_sim::Tally { events, on, x, y, t_us }) => {
                        writeln!(
                            out,
                            "tally: {events} events, {on} on, x {x}, y {y}, t since the first {t_us}"
                        )
                    }
                    None => writeln!(out, "no tally of so many events: a power of two that have been sent"),
                };
            }
            _ => return writeln!(out, "no such order: {order:?}"),
        }
        writeln!(out, "done: {order}")
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let Command::Serve(serve) = Arguments::parse().command;
    serve.run()
}

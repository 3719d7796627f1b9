//! The light on the simulated sensor as a series of pictures.

use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use evfocus_core::{Geometry, HostMicros};
use hil_sim::Rig;
use png::{BitDepth, ColorType, Encoder};

/// Steps of a frame's values per DN of intensity: 16 bits reach to 512 DN, twice white, where lamps are.
pub(super) const STEPS_PER_DN: f32 = 128.0;

/// Writes 16-bit PNGs of linear intensity and a list of their times.
pub(super) struct FrameWriter {
    folder: PathBuf,
    fps: f64,
    geometry: Geometry,
    written: u64,
    times: BufWriter<File>,
    bytes: Vec<u8>,
}

impl FrameWriter {
    /// Frames in `folder`, which is made if need be, `fps` a second.
    pub(super) fn new(folder: &Path, fps: f64, geometry: Geometry) -> anyhow::Result<Self> {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make the folder", folder.display()))?;
        let list = folder.join("frames.csv");
        let file = File::create(&list).with_context(|| format!("{}: cannot write", list.display()))?;
        let mut times = BufWriter::new(file);
        writeln!(times, "file,t_us,lens_position")?;
        let folder = folder.to_owned();
        Ok(Self { folder, fps, geometry, written: 0, times, bytes: Vec::new() })
    }

    /// Writes the frames that are due by `now`.
    pub(super) fn write_until(&mut self, now: HostMicros, rig: &Rig) -> anyhow::Result<()> {
        loop {
            let due = HostMicros((self.written as f64 / self.fps * 1e6).round() as i64);
            if due > now {
                return Ok(());
            }
            let glass = rig.glass(due);
            let intensity = rig.intensity_frame(due, glass);
            let name = format!("frame_{:06}.png", self.written);
            let path = self.folder.join(&name);
            self.write(&path, &intensity).with_context(|| format!("{}: cannot write", path.display()))?;
            writeln!(self.times, "{name},{},{}", due.0, glass.0)?;
            self.written += 1;
        }
    }

    fn write(&mut self, path: &Path, intensity: &[f32]) -> anyhow::Result<()> {
        self.bytes.clear();
        for value in intensity {
            // Beyond the ends the conversion saturates.
            self.bytes.extend_from_slice(&((value * STEPS_PER_DN).round() as u16).to_be_bytes());
        }
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = Encoder::new(file, self.geometry.width.into(), self.geometry.height.into());
        encoder.set_color(ColorType::Grayscale);
        encoder.set_depth(BitDepth::Sixteen);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.bytes)?;
        Ok(writer.finish()?)
    }

    /// Completes the list; returns the number of frames and their rate.
    pub(super) fn finish(mut self) -> anyhow::Result<(u64, f64)> {
        self.times.flush()?;
        Ok((self.written, self.fps))
    }
}

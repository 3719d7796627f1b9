//! The light on the sensor at one instant: blur, motion, breathing and flicker put together.

use std::sync::OnceLock;

use crate::config::RigConfig;
use crate::motion::{Motion, Pose};
use crate::optics::{Blend, BlurStack};
use crate::random::Stream;

/// Everything about the light that does not change while the rig lives.
#[derive(Debug)]
pub(crate) struct Picture {
    /// Each plane's stack and focus position. Made when first looked at: who only wants the lens does not wait for it.
    planes: OnceLock<Vec<(BlurStack, f64)>>,
    motion: Motion,
    config: RigConfig,
    width: usize,
    height: usize,
}

/// What determines the light on the sensor; equal views make equal pictures.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    blends: Vec<Blend>,
    pose: Pose,
    /// Magnification against that in the middle of the lens range.
    scale: f64,
    gain: f32,
}

/// Rows that rendering needs for itself.
#[derive(Debug, Default)]
pub(crate) struct Scratch {
    blended: [Vec<f32>; 2],
    line: Vec<f32>,
}

impl Picture {
    pub(crate) fn new(config: RigConfig) -> Self {
        let geometry = config.sensor.geometry;
        let (width, height) = (usize::from(geometry.width), usize::from(geometry.height));
        Self {
            planes: OnceLock::new(),
            motion: Motion::new(&config.motion, &mut Stream::Shake.generator(config.seed)),
            config,
            width,
            height,
        }
    }

    fn planes(&self) -> &[(BlurStack, f64)] {
        self.planes.get_or_init(|| {
            let config = &self.config;
            let planes = config.scene.planes(self.width, self.height, config.seed).into_iter().map(|plane| {
                let focus = if plane.second { config.second_focus } else { config.focus };
                let ends = [config.lens.range.min(), config.lens.range.max()];
                let largest = ends.map(|end| config.optics.radius(end.counts_from(focus)));
                let stack = BlurStack::new(&plane.texture, &config.optics, largest[0].max(largest[1]));
                (stack, focus.0)
            });
            planes.collect()
        })
    }

    pub(crate) fn config(&self) -> &RigConfig {
        &self.config
    }

    pub(crate) fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// What is seen with the glass at `position`, `seconds` after the rig was made.
    pub(crate) fn view(&self, position: f64, seconds: f64) -> View {
        let range = self.config.lens.range;
        let middle = f64::midpoint(range.min().0, range.max().0);
        let optics = &self.config.optics;
        View {
            blends: self
                .planes()
                .iter()
                .map(|(stack, focus)| stack.blend(optics.radius(position - focus)))
                .collect(),
            pose: self.motion.pose(seconds),
            scale: 1.0 + optics.breathing * (position - middle) / range.length(),
            gain: self.config.flicker.map_or(1.0, |flicker| flicker.gain(seconds)) as f32,
        }
    }

    /// Puts the light of `view` into `image`, DN, row by row.
    pub(crate) fn render(&self, view: &View, scratch: &mut Scratch, image: &mut [f32]) {
        for (plane, ((stack, _), blend)) in self.planes().iter().zip(&view.blends).enumerate() {
            self.render_plane(stack, *blend, view, scratch, image, plane > 0);
        }
        if (view.gain - 1.0).abs() > 0.0 {
            for value in image {
                *value *= view.gain;
            }
        }
    }

    fn render_plane(
        &self,
        stack: &BlurStack,
        blend: Blend,
        view: &View,
        scratch: &mut Scratch,
        image: &mut [f32],
        add: bool,
    ) {
        let (sharp, soft) = (&stack.levels[blend.level], &stack.levels[blend.level + 1]);
        let (width, height) = (sharp.width, sharp.height);
        let (middle_x, middle_y) = (self.width as f64 / 2.0, self.height as f64 / 2.0);
        let mut cached: [Option<usize>; 2] = [None; 2];
        let Scratch { blended, line } = scratch;
        for row in blended.iter_mut() {
            row.resize(width, 0.0);
        }
        line.resize(2 * width + self.width + 2, 0.0);
        let mut fetch = |row: usize, blended: &mut [Vec<f32>; 2]| -> usize {
            // Neighbouring rows have different places, also where the even number of rows wraps round.
            let place = row % 2;
            if cached[place] != Some(row) {
                cached[place] = Some(row);
                let range = row * width..(row + 1) * width;
                mix(&sharp.values[range.clone()], &soft.values[range], blend.share, &mut blended[place]);
            }
            place
        };
        for (y, out) in image.chunks_exact_mut(self.width).take(self.height).enumerate() {
            let v = height as f64 / 2.0 + (y as f64 - middle_y) / view.scale - view.pose.down;
            let (top, below) = split(v, height);
            let above = fetch(top, blended);
            if below > 0.0 {
                let next = if top + 1 == height { 0 } else { top + 1 };
                let under = fetch(next, blended);
                mix(&blended[above], &blended[under], below, &mut line[..width]);
            } else {
                line[..width].copy_from_slice(&blended[above]);
            }
            let shear = view.pose.roll * (y as f64 - middle_y);
            let u = width as f64 / 2.0 - middle_x / view.scale - view.pose.right + shear;
            let (left, right) = split(u, width);
            extend(line, width, left + (self.width as f64 / view.scale).ceil() as usize + 2);
            if (view.scale - 1.0).abs() > 0.0 {
                stretched(line, left as f32 + right, (1.0 / view.scale) as f32, out, add);
            } else {
                shifted(&line[left..=left + self.width], right, out, add);
            }
        }
    }
}

/// The whole and the fractional part of a coordinate on a torus.
fn split(coordinate: f64, size: usize) -> (usize, f32) {
    let wrapped = coordinate.rem_euclid(size as f64);
    let whole = (wrapped as usize).min(size - 1);
    (whole, (wrapped - whole as f64) as f32)
}

/// Repeats the first `width` values of `line` up to index `end`.
fn extend(line: &mut [f32], width: usize, end: usize) {
    let mut have = width;
    let end = end.min(line.len());
    while have < end {
        let count = width.min(end - have);
        line.copy_within(..count, have);
        have += count;
    }
}

/// `out = first + share (second - first)`.
fn mix(first: &[f32], second: &[f32], share: f32, out: &mut [f32]) {
    for ((out, first), second) in out.iter_mut().zip(first).zip(second) {
        *out = first + share * (second - first);
    }
}

/// `out[i]` between `line[i]` and `line[i + 1]`.
fn shifted(line: &[f32], share: f32, out: &mut [f32], add: bool) {
    let keep = if add { 1.0 } else { 0.0 };
    for ((out, first), second) in out.iter_mut().zip(line).zip(&line[1..]) {
        *out = keep * *out + first + share * (second - first);
    }
}

/// `out[i]` at `start + i step` on `line`.
fn stretched(line: &[f32], start: f32, step: f32, out: &mut [f32], add: bool) {
    let keep = if add { 1.0 } else { 0.0 };
    for (index, out) in out.iter_mut().enumerate() {
        let at = start + index as f32 * step;
        let whole = (at as usize).min(line.len() - 2);
        let share = at - whole as f32;
        *out = keep * *out + line[whole] + share * (line[whole + 1] - line[whole]);
    }
}

//! The light on the sensor at one instant: blur, motion, breathing and flicker put together.

mod rows;

use std::sync::OnceLock;

use crate::changes::Scenery;
use crate::config::RigConfig;
use crate::fan::{Fan, Place};
use crate::motion::{Motion, Pose};
use crate::optics::{Blend, BlurStack, mix};
use crate::random::Stream;
use rows::{extend, shifted, split, stretched};

/// Columns that share a degree of blur where the sensor is tilted.
const STRIP: usize = 8;

/// Everything about the light that does not change while the rig lives.
#[derive(Debug)]
pub(crate) struct Picture {
    /// Made when first looked at: who only wants the lens does not wait for it.
    content: OnceLock<Content>,
    motion: Motion,
    config: RigConfig,
    width: usize,
    height: usize,
}

/// What there is to be seen.
#[derive(Debug)]
struct Content {
    /// Each plane's stack and focus position.
    planes: Vec<(BlurStack, f64)>,
    fan: Option<(Fan, f64)>,
    /// Size of the scene, which repeats.
    canvas: (usize, usize),
}

/// What determines the light on the sensor; equal views make equal pictures.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct View {
    /// Of each plane in turn: from left to right, one for each strip of the scene.
    blends: Vec<Blend>,
    /// Blur and angle of the fan.
    fan: Option<(Blend, f64)>,
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
    fan: Vec<f32>,
}

impl Picture {
    pub(crate) fn new(config: RigConfig) -> Self {
        let geometry = config.sensor.geometry;
        let (width, height) = (usize::from(geometry.width), usize::from(geometry.height));
        Self {
            content: OnceLock::new(),
            motion: Motion::new(&config.motion, &mut Stream::Shake.generator(config.seed)),
            config,
            width,
            height,
        }
    }

    fn content(&self) -> &Content {
        self.content.get_or_init(|| {
            let config = &self.config;
            let optics = &config.optics;
            let positions = (config.lens.range.min().0, config.lens.range.max().0);
            let mut planes = config.scene.planes(self.width, self.height, config.seed);
            let fan = config.fan.map(|fan| {
                let focus = config.focus.0 + fan.depth_counts;
                let mut textures: Vec<_> = planes.iter_mut().map(|plane| &mut plane.texture).collect();
                let largest = optics.largest_radius(focus, positions);
                (Fan::new(&fan, (self.width, self.height), &mut textures, optics, largest), focus)
            });
            let canvas = planes.first().map_or((1, 1), |plane| (plane.texture.width, plane.texture.height));
            let planes = planes.into_iter().map(|plane| {
                let focus = if plane.second { config.second_focus } else { config.focus }.0;
                (BlurStack::new(&plane.texture, optics, optics.largest_radius(focus, positions)), focus)
            });
            Content { planes: planes.collect(), fan, canvas }
        })
    }

    /// How much further up the lens range the picture is in focus than in its middle, `right` pixels to the right of that.
    fn tilt(&self, right: f64) -> f64 {
        self.config.optics.tilt_counts * (right / self.width as f64).clamp(-0.5, 0.5)
    }

    /// Columns of the scene that share a degree of blur.
    fn strip(&self) -> usize {
        if self.config.optics.tilt_counts.abs() > 0.0 { STRIP } else { self.content().canvas.0 }
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
        let Content { planes, fan, canvas } = self.content();
        let scenery = Scenery::at(&self.config.changes, seconds);
        let pose = self.motion.pose(scenery.motion_seconds);
        let (strip, canvas_width) = (self.strip(), canvas.0 as f64);
        let mut blends = Vec::new();
        for (stack, focus) in planes {
            blends.extend((0..canvas.0.div_ceil(strip)).map(|index| {
                // The tilt stays with the sensor while the scene moves: it is that of the place where the strip is seen.
                let column = (index * strip) as f64 + 0.5 * (strip as f64) + pose.right;
                let right = column.rem_euclid(canvas_width) - 0.5 * canvas_width;
                stack.blend(optics.radius(position - focus - scenery.focus - self.tilt(right)))
            }));
        }
        let fan = fan.as_ref().zip(self.config.fan).map(|((fan, focus), config)| {
            let tilt = self.tilt((config.middle.0 - 0.5) * self.width as f64);
            (fan.blend(optics.radius(position - focus - scenery.focus - tilt)), config.angle(seconds))
        });
        View {
            blends,
            fan,
            pose,
            scale: 1.0 + optics.breathing * (position - middle) / range.length(),
            gain: (scenery.light * self.config.flicker.map_or(1.0, |flicker| flicker.gain(seconds))) as f32,
        }
    }

    /// Puts the light of `view` into `image`, DN, row by row.
    pub(crate) fn render(&self, view: &View, scratch: &mut Scratch, image: &mut [f32]) {
        let Content { planes, fan, canvas } = self.content();
        let strips = view.blends.len() / planes.len();
        for (plane, ((stack, _), blends)) in planes.iter().zip(view.blends.chunks_exact(strips)).enumerate() {
            self.render_plane(stack, blends, view, scratch, image, plane > 0);
        }
        if let Some(((fan, _), seen)) = fan.as_ref().zip(view.fan) {
            let Pose { right, down, roll } = view.pose;
            let (width, height) = (self.width, self.height);
            let place = Place { width, height, canvas: *canvas, right, down, roll, scale: view.scale };
            fan.render(seen, &place, &mut scratch.fan, image);
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
        blends: &[Blend],
        view: &View,
        scratch: &mut Scratch,
        image: &mut [f32],
        add: bool,
    ) {
        let (width, height) = self.content().canvas;
        let strip = self.strip();
        let (middle_x, middle_y) = (self.width as f64 / 2.0, self.height as f64 / 2.0);
        let mut cached: [Option<usize>; 2] = [None; 2];
        let Scratch { blended, line, .. } = scratch;
        for row in blended.iter_mut() {
            row.resize(width, 0.0);
        }
        line.resize(2 * width + self.width + 2, 0.0);
        let mut fetch = |row: usize, blended: &mut [Vec<f32>; 2]| -> usize {
            // Neighbouring rows have different places, also where the even number of rows wraps round.
            let place = row % 2;
            if cached[place] != Some(row) {
                cached[place] = Some(row);
                let parts = blended[place].chunks_mut(strip).zip(blends).enumerate();
                for (index, (out, blend)) in parts {
                    let first = row * width + index * strip;
                    stack.mix(first..first + out.len(), *blend, out);
                }
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

//! A fan in the picture: something that changes all the time, whatever the lens does.

use std::f64::consts::TAU;

use crate::ConfigError;
use crate::fourier::{Texture, fast_size};
use crate::optics::{Blend, BlurStack, OpticsConfig};
use crate::scene::brush::{cover, stamp};

/// Brightness of the blades, DN.
const BLADE_DN: f64 = 200.0;

/// A disc of bright blades and dark gaps, as wide as each other, that turns steadily before the scene and hides what lies
/// behind it. The lens blurs it as the rest, and it moves with the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FanConfig {
    /// Its middle, as shares of the picture's width and height from the upper left corner. Default (0.7, 0.5).
    pub middle: (f64, f64),
    /// Radius as a share of the picture's height, 0.01 to 1. Default 0.25.
    pub radius: f64,
    /// Turns per second; 1 to 2 is usual (sensor-and-optics, section 2). Default 1.5; negative the other way round.
    pub revolutions_per_s: f64,
    /// Number of blades, 1 to 64. Default 5.
    pub blades: u32,
    /// Contrast of blades and gaps, (bright - dark) / (bright + dark), 0 to 1. Default 0.8.
    pub contrast: f64,
    /// Where it is sharp, counts above the scene's focus. Default 0.
    pub depth_counts: f64,
}

impl Default for FanConfig {
    fn default() -> Self {
        Self {
            middle: (0.7, 0.5),
            radius: 0.25,
            revolutions_per_s: 1.5,
            blades: 5,
            contrast: 0.8,
            depth_counts: 0.0,
        }
    }
}

impl FanConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        ConfigError::check("fan.middle.0", self.middle.0, 0.0, 1.0)?;
        ConfigError::check("fan.middle.1", self.middle.1, 0.0, 1.0)?;
        ConfigError::check("fan.radius", self.radius, 0.01, 1.0)?;
        ConfigError::check("fan.revolutions_per_s", self.revolutions_per_s, -100.0, 100.0)?;
        ConfigError::check("fan.blades", f64::from(self.blades), 1.0, 64.0)?;
        ConfigError::check("fan.contrast", self.contrast, 0.0, 1.0)?;
        ConfigError::check("fan.depth_counts", self.depth_counts, -1e4, 1e4)
    }

    /// Angle of the first blade `seconds` after the rig was made, radians.
    pub(crate) fn angle(&self, seconds: f64) -> f64 {
        TAU * (self.revolutions_per_s * seconds).rem_euclid(1.0)
    }
}

/// A fan in a picture of a certain size.
#[derive(Debug)]
pub(crate) struct Fan {
    /// The fan at angle zero on black, by degree of blur.
    stack: BlurStack,
    /// Its middle, pixels to the right of and below the picture's.
    middle: (f64, f64),
    /// Beyond this many pixels from its middle there is nothing of it.
    reach: f64,
}

impl Fan {
    /// The fan in a picture of `width` x `height` pixels. Cuts its place out of the `scene`.
    pub(crate) fn new(
        config: &FanConfig,
        (width, height): (usize, usize),
        scene: &mut [&mut Texture],
        optics: &OpticsConfig,
        largest_blur: f64,
    ) -> Self {
        let radius = config.radius * height as f64;
        let middle = ((config.middle.0 - 0.5) * width as f64, (config.middle.1 - 0.5) * height as f64);
        for texture in scene {
            let at = (texture.width as f64 / 2.0 + middle.0, texture.height as f64 / 2.0 + middle.1);
            stamp(texture, at, (radius, radius), |pixel, x, y| *pixel *= 1.0 - cover(radius - x.hypot(y)));
        }
        // A Gaussian blur reaches further than its disc.
        let reach = radius + 1.6 * largest_blur + 4.0;
        let size = fast_size((2.0 * reach) as usize + 4);
        let mut texture = Texture::filled(size, size, 0.0);
        let gap = BLADE_DN * (1.0 - config.contrast) / (1.0 + config.contrast);
        let blades = f64::from(config.blades);
        let at = size as f64 / 2.0;
        stamp(&mut texture, (at, at), (radius, radius), |pixel, x, y| {
            let phase = (y.atan2(x) / TAU * blades).rem_euclid(1.0);
            // From the nearest edge of a blade along the circle, pixels; inside the blade above zero.
            let turns = if phase < 0.5 { phase.min(0.5 - phase) } else { (0.5 - phase).max(phase - 1.0) };
            let blade = cover(turns / blades * TAU * x.hypot(y));
            *pixel = cover(radius - x.hypot(y)) * (gap + (BLADE_DN - gap) * f64::from(blade)) as f32;
        });
        Self { stack: BlurStack::new(&texture, optics, largest_blur), middle, reach }
    }

    pub(crate) fn blend(&self, radius: f64) -> Blend {
        self.stack.blend(radius)
    }

    /// Adds the fan to `image`, which shows a scene that repeats every `canvas` pixels.
    pub(crate) fn render(
        &self,
        (blend, angle): (Blend, f64),
        place: &Place,
        blurred: &mut Vec<f32>,
        image: &mut [f32],
    ) {
        let size = self.stack.levels[0].width;
        blurred.resize(size * size, 0.0);
        self.stack.mix(0..size * size, blend, blurred);
        let (sine, cosine) = angle.sin_cos();
        let (canvas_x, canvas_y) = (place.canvas.0 as f64, place.canvas.1 as f64);
        let (middle_x, middle_y) = (place.width as f64 / 2.0, place.height as f64 / 2.0);
        for (y, row) in image.chunks_exact_mut(place.width).enumerate() {
            let below = y as f64 - middle_y;
            let down = wrapped(below / place.scale - place.down + 0.5 - self.middle.1, canvas_y);
            let half = (self.reach * self.reach - down * down).max(0.0).sqrt();
            let left = wrapped(place.roll * below - place.right + 0.5 - self.middle.0, canvas_x)
                - middle_x / place.scale;
            for copy in [-canvas_x, 0.0, canvas_x] {
                // Column x lies `left + copy + x / scale` to the right of the fan's middle.
                let first =
                    ((-half - left - copy) * place.scale).ceil().clamp(0.0, place.width as f64) as usize;
                let end = ((half - left - copy) * place.scale).ceil().clamp(0.0, place.width as f64) as usize;
                for (x, out) in row.iter_mut().enumerate().take(end).skip(first) {
                    let right = left + copy + x as f64 / place.scale;
                    let at = (cosine * right + sine * down, cosine * down - sine * right);
                    *out += sample(blurred, size, at);
                }
            }
        }
    }
}

/// Where the scene is in the picture.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Of the picture, pixels.
    pub(crate) width: usize,
    /// Of the picture, pixels.
    pub(crate) height: usize,
    /// The scene repeats after so many pixels.
    pub(crate) canvas: (usize, usize),
    /// Displacement, pixels.
    pub(crate) right: f64,
    /// Displacement, pixels.
    pub(crate) down: f64,
    /// Radians.
    pub(crate) roll: f64,
    /// Magnification.
    pub(crate) scale: f64,
}

/// The nearest of the offsets that are the same on a torus of `size`.
fn wrapped(offset: f64, size: f64) -> f64 {
    (offset + 0.5 * size).rem_euclid(size) - 0.5 * size
}

/// The square picture `values` at an offset from its middle, between four pixels.
fn sample(values: &[f32], size: usize, (right, down): (f64, f64)) -> f32 {
    let middle = size as f64 / 2.0 - 0.5;
    let (x, y) = ((middle + right).max(0.0), (middle + down).max(0.0));
    let (column, row) = ((x as usize).min(size - 2), (y as usize).min(size - 2));
    let (share_x, share_y) = ((x - column as f64) as f32, (y - row as f64) as f32);
    let at = row * size + column;
    let above = values[at] + share_x * (values[at + 1] - values[at]);
    let below = values[at + size] + share_x * (values[at + size + 1] - values[at + size]);
    above + share_y * (below - above)
}

//! What the camera looks at: procedural pictures that repeat at their margins.

pub(crate) mod brush;
mod chart;
mod natural;
mod outdoor;
mod text;

use rand_xoshiro::Xoshiro256PlusPlus;

use crate::fourier::{Texture, fast_size};
use crate::names::named;
use crate::random::Stream;

/// A scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Scene {
    /// A page of letters of several sizes, dark on light.
    Text,
    /// Black and white wedges that meet in the middle.
    SiemensStar,
    /// Discs of all sizes and shades that hide each other: the statistics of natural scenes.
    DeadLeaves,
    /// Random texture with the 1/f spectrum of natural scenes.
    PinkNoise,
    /// Points of light on black.
    StarField,
    /// A checkerboard of 16 pixel squares.
    Checker,
    /// Twigs and branches of all sizes against the sky.
    Foliage,
    /// Fronts of houses with rows of windows.
    Buildings,
    /// A wall with soft shading and weak edges only.
    LowTexture,
    /// A nearly even grey: nothing to focus on.
    BlankWall,
    /// Dead leaves on the left, text on the right, sharp at different lens positions.
    TwoDepths,
}

named!(Scene, "scene", {
    Text => "text",
    SiemensStar => "siemens-star",
    DeadLeaves => "dead-leaves",
    PinkNoise => "pink-noise",
    StarField => "star-field",
    Checker => "checker",
    Foliage => "foliage",
    Buildings => "buildings",
    LowTexture => "low-texture",
    BlankWall => "blank-wall",
    TwoDepths => "two-depths",
});

/// The part of a scene that is sharp at one lens position, with black where the scene is elsewhere.
#[derive(Debug)]
pub(crate) struct Plane {
    pub(crate) texture: Texture,
    /// Whether this is the half with the second focus position.
    pub(crate) second: bool,
}

impl Scene {
    /// The planes of the scene, each somewhat larger than a sensor of `width` x `height` pixels, so that what leaves the
    /// picture on one side does not come in on the other at once.
    pub(crate) fn planes(self, width: usize, height: usize, seed: u64) -> Vec<Plane> {
        let mut canvas = Texture::filled(fast_size(width + 48), fast_size(height + 48), 0.0);
        let mut rng = Stream::Scene.generator(seed);
        if self != Self::TwoDepths {
            self.paint(&mut canvas, &mut rng);
            return vec![Plane { texture: canvas, second: false }];
        }
        let mut second = canvas.clone();
        Self::DeadLeaves.paint(&mut canvas, &mut rng);
        Self::Text.paint(&mut second, &mut Stream::SecondScene.generator(seed));
        let middle = canvas.width / 2;
        for row in canvas.values.chunks_exact_mut(canvas.width) {
            row[middle..].fill(0.0);
        }
        for row in second.values.chunks_exact_mut(second.width) {
            row[..middle].fill(0.0);
        }
        vec![Plane { texture: canvas, second: false }, Plane { texture: second, second: true }]
    }

    fn paint(self, canvas: &mut Texture, rng: &mut Xoshiro256PlusPlus) {
        match self {
            Self::Text => text::page(canvas, rng),
            Self::SiemensStar => chart::siemens_star(canvas),
            Self::DeadLeaves | Self::TwoDepths => natural::dead_leaves(canvas, rng),
            Self::PinkNoise => natural::pink_noise(canvas, rng),
            Self::StarField => natural::star_field(canvas, rng),
            Self::Checker => chart::checker(canvas),
            Self::Foliage => outdoor::foliage(canvas, rng),
            Self::Buildings => outdoor::buildings(canvas, rng),
            Self::LowTexture => outdoor::low_texture(canvas, rng),
            Self::BlankWall => chart::blank_wall(canvas),
        }
    }
}

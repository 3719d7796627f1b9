//! Independent random streams from one seed.

use rand::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// What a random stream is for. Each purpose has a stream of its own, so that a change of one (more noise, say) leaves the
/// others (the scene, the shake) as they were.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Stream {
    Scene = 1,
    SecondScene,
    Mismatch,
    Noise,
    Shake,
    Transfers,
    LensReadOut,
    PatchNoise,
}

impl Stream {
    /// The generator of this stream for the rig's `seed`.
    pub(crate) fn generator(self, seed: u64) -> Xoshiro256PlusPlus {
        // An odd constant keeps the streams of neighbouring seeds apart; the generator's own seeding mixes the bits.
        Xoshiro256PlusPlus::seed_from_u64(seed ^ (self as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }
}

//! Seeds that something was found with. As long as draws are what they are, a seed keeps its story, and the tests tell it again.

/// What a seed has found.
#[derive(Debug)]
pub struct Found {
    /// The seed.
    pub seed: u64,
    /// What was wrong.
    pub wrong: &'static str,
    /// What was done about it.
    pub mended: &'static str,
}

/// Everything that was found.
pub const FOUND: &[Found] = &[];

//! [`Random`]: words that look random, the same for the same seed.

use super::{hash, unit_float};
use glam::Vec2;

/// A stream of numbers in [0, 1).
pub struct Random {
    seed: u32,
    taken: u32,
}

impl Random {
    /// Streams of different seeds have nothing to do with each other.
    pub fn new(seed: u32) -> Self {
        Random { seed, taken: 0 }
    }

    /// The next number.
    pub fn next(&mut self) -> f32 {
        self.taken += 1;
        unit_float(hash(self.seed, self.taken))
    }

    /// Two numbers.
    pub fn pair(&mut self) -> Vec2 {
        Vec2::new(self.next(), self.next())
    }

    /// A key for the ray that starts now; takes no number.
    pub fn key(&self) -> u32 {
        hash(self.seed, self.taken ^ 0x8000_0000)
    }
}

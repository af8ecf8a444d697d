//! [`Stack`]: what a walk has yet to visit.

use crate::math::simd::LANES;

/// A stack of words.
pub struct Stack {
    words: [u64; STACK],
    len: usize,
    /// What did not fit: a tree is that deep only where thousands of triangles lie in one place.
    below: Vec<u64>,
}

const STACK: usize = 256;

impl Stack {
    #[inline(always)]
    pub fn new() -> Self {
        Stack { words: [0; STACK], len: 0, below: Vec::new() }
    }

    /// Makes room for the children of a node; returns where they begin.
    #[inline(always)]
    pub fn reserve(&mut self) -> usize {
        if self.len > STACK - LANES {
            self.spill();
        }
        self.len
    }

    /// Puts `word` among those from `base` on, greatest first. At most [`LANES`] for each call of [`Stack::reserve`].
    #[inline(always)]
    pub fn insert(&mut self, base: usize, word: u64) {
        let mut k = self.len;
        while k > base && self.words[k - 1] < word {
            self.words[k] = self.words[k - 1];
            k -= 1;
        }
        self.words[k] = word;
        self.len += 1;
    }

    /// Puts `word` on top.
    #[inline(always)]
    pub fn push(&mut self, word: u64) {
        self.words[self.len] = word;
        self.len += 1;
    }

    #[inline(always)]
    pub fn pop(&mut self) -> Option<u64> {
        if self.len == 0 {
            return self.below.pop();
        }
        self.len -= 1;
        Some(self.words[self.len])
    }

    #[cold]
    fn spill(&mut self) {
        self.below.extend_from_slice(&self.words[..self.len]);
        self.len = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_spills_what_does_not_fit() {
        let mut stack = Stack::new();
        let words = 5 * STACK as u64;
        for first in (0..words).step_by(LANES - 1) {
            let base = stack.reserve();
            (first..first + LANES as u64 - 1).for_each(|w| stack.insert(base, w));
        }
        // Of each seven the least lies on top.
        let mut popped: Vec<u64> = std::iter::from_fn(|| stack.pop()).collect();
        assert!(popped.chunks(LANES - 1).all(|c| c.is_sorted()));
        popped.sort_unstable();
        assert!(popped.iter().copied().eq(0..popped.len() as u64));
    }
}

//! Eight single-precision numbers at once: the processor's best at run time, the same results on all of them.
//!
//! The one file with intrinsics. Every operation is rounded once, as IEEE 754 says, on every path (no fused
//! multiply-add), so that results do not depend on the machine.
#![allow(unsafe_code)]

/// Numbers in a vector.
pub const LANES: usize = 8;

/// Eight numbers, aligned as vectors like them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Eight(pub [f32; LANES]);

/// Eight numbers in registers. A mask has one bit a lane, lane 0 lowest.
pub trait Lanes: Copy {
    fn splat(x: f32) -> Self;
    fn load(x: &Eight) -> Self;
    fn store(self) -> Eight;
    fn add(self, o: Self) -> Self;
    fn sub(self, o: Self) -> Self;
    fn mul(self, o: Self) -> Self;
    fn div(self, o: Self) -> Self;
    /// `self < o ? self : o`
    fn min(self, o: Self) -> Self;
    /// `self > o ? self : o`
    fn max(self, o: Self) -> Self;
    /// Lanes where `self <= o`.
    fn le(self, o: Self) -> u32;
}

/// Instruction sets that work is compiled for, the plainest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Arrays; whatever the compiler makes of them.
    Portable,
    /// 256-bit vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Level {
    /// Those that this processor has, the best last.
    pub fn available() -> Vec<Level> {
        let mut levels = vec![Level::Portable];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("lzcnt") {
            levels.push(Level::Avx2);
        }
        levels
    }

    /// The best that this processor has.
    pub fn best() -> Level {
        Level::available().pop().unwrap_or(Level::Portable)
    }
}

/// Work that is compiled once for each level; `run` and all that it calls must be `#[inline(always)]`.
pub trait Task {
    /// What it returns.
    type Output;
    fn run<S: Lanes>(self) -> Self::Output;
}

/// Runs a task at a level.
#[inline(always)]
pub fn run<T: Task>(level: Level, task: T) -> T::Output {
    match level {
        Level::Portable => task.run::<Portable>(),
        #[cfg(target_arch = "x86_64")]
        // Safety: `Level::Avx2` comes from `Level::available` only.
        Level::Avx2 => unsafe { avx2::run(task) },
    }
}

#[derive(Clone, Copy)]
struct Portable([f32; LANES]);

impl Portable {
    #[inline(always)]
    fn zip(self, o: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = f(self.0[k], o.0[k]);
        }
        out
    }

    #[inline(always)]
    fn mask(self, o: Self, f: impl Fn(f32, f32) -> bool) -> u32 {
        let mut mask = 0;
        for k in 0..LANES {
            mask |= u32::from(f(self.0[k], o.0[k])) << k;
        }
        mask
    }
}

impl Lanes for Portable {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Portable([x; LANES])
    }
    #[inline(always)]
    fn load(x: &Eight) -> Self {
        Portable(x.0)
    }
    #[inline(always)]
    fn store(self) -> Eight {
        Eight(self.0)
    }
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        self.zip(o, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        self.zip(o, |a, b| a - b)
    }
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        self.zip(o, |a, b| a / b)
    }
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        self.zip(o, |a, b| a * b)
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        self.zip(o, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        self.zip(o, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn le(self, o: Self) -> u32 {
        self.mask(o, |a, b| a <= b)
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Eight, LANES, Lanes, Task};
    use std::arch::x86_64::*;

    /// Must only run where the processor has these features.
    #[target_feature(enable = "avx2,bmi1,lzcnt")]
    pub unsafe fn run<T: Task>(task: T) -> T::Output {
        task.run::<Avx2>()
    }

    #[derive(Clone, Copy)]
    pub struct Avx2(__m256);

    // Safety of all below: `Avx2` is named by `run` only, whose caller vouches for the processor; loads and stores go to
    // aligned memory of their size.
    impl Lanes for Avx2 {
        #[inline(always)]
        fn splat(x: f32) -> Self {
            Avx2(unsafe { _mm256_set1_ps(x) })
        }
        #[inline(always)]
        fn load(x: &Eight) -> Self {
            Avx2(unsafe { _mm256_load_ps(x.0.as_ptr()) })
        }
        #[inline(always)]
        fn store(self) -> Eight {
            let mut out = Eight([0.0; LANES]);
            unsafe { _mm256_store_ps(out.0.as_mut_ptr(), self.0) };
            out
        }
        #[inline(always)]
        fn add(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_add_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn sub(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_sub_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn div(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_div_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn mul(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_mul_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn min(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_min_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn max(self, o: Self) -> Self {
            Avx2(unsafe { _mm256_max_ps(self.0, o.0) })
        }
        #[inline(always)]
        fn le(self, o: Self) -> u32 {
            unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, o.0)) as u32 }
        }
    }
}

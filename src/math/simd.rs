//! Eight single-precision numbers at once: the processor's best at run time, the same results on all of them.
//!
//! The one file with intrinsics. Every operation is rounded once, as IEEE 754 says, on every path (no fused
//! multiply-add, but where bounds allow for it), so that results do not depend on the machine.
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
    /// `self * a - b`, rounded once or twice, as the processor likes: for bounds that allow for either.
    fn mul_sub(self, a: Self, b: Self) -> Self;
    /// The same numbers, but `x` in one lane.
    fn with(self, lane: usize, x: f32) -> Self;
    /// Lanes in which `words`, without the bits that `mask` lacks, are `word`.
    fn equal(words: &[u32; LANES], mask: u32, word: u32) -> u32;
    /// `a[0] p[0] + a[1] p[1] + a[2] p[2] + a[3]`, added up in this order, in double precision until the end.
    fn affine(p: [Self; 3], a: &[f64; 4]) -> Self;
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
        if is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("lzcnt")
        {
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
    #[inline(always)]
    fn mul_sub(self, a: Self, b: Self) -> Self {
        self.mul(a).sub(b)
    }
    #[inline(always)]
    fn with(mut self, lane: usize, x: f32) -> Self {
        self.0[lane] = x;
        self
    }
    #[inline(always)]
    fn equal(words: &[u32; LANES], mask: u32, word: u32) -> u32 {
        (0..LANES).map(|k| u32::from(words[k] & mask == word) << k).sum()
    }
    #[inline(always)]
    fn affine(p: [Self; 3], a: &[f64; 4]) -> Self {
        let p = |axis: usize, k: usize| f64::from(p[axis].0[k]);
        Portable(std::array::from_fn(|k| (a[0] * p(0, k) + a[1] * p(1, k) + a[2] * p(2, k) + a[3]) as f32))
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Eight, LANES, Lanes, Task};
    use std::arch::x86_64::*;

    /// Must only run where the processor has these features.
    #[target_feature(enable = "avx2,fma,bmi1,lzcnt")]
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
        #[inline(always)]
        fn mul_sub(self, a: Self, b: Self) -> Self {
            Avx2(unsafe { _mm256_fmsub_ps(self.0, a.0, b.0) })
        }
        #[inline(always)]
        fn with(self, lane: usize, x: f32) -> Self {
            unsafe {
                let here =
                    _mm256_cmpeq_epi32(_mm256_set1_epi32(lane as i32), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
                Avx2(_mm256_blendv_ps(self.0, _mm256_set1_ps(x), _mm256_castsi256_ps(here)))
            }
        }
        #[inline(always)]
        fn equal(words: &[u32; LANES], mask: u32, word: u32) -> u32 {
            unsafe {
                let words = _mm256_and_si256(_mm256_loadu_si256(words.as_ptr().cast()), _mm256_set1_epi32(mask as i32));
                let equal = _mm256_cmpeq_epi32(words, _mm256_set1_epi32(word as i32));
                _mm256_movemask_ps(_mm256_castsi256_ps(equal)) as u32
            }
        }
        #[inline(always)]
        fn affine(p: [Self; 3], a: &[f64; 4]) -> Self {
            let [x, y, z] = p;
            Avx2(unsafe { _mm256_set_m128(half(a, x.high(), y.high(), z.high()), half(a, x.low(), y.low(), z.low())) })
        }
    }

    impl Avx2 {
        #[inline(always)]
        fn low(self) -> __m128 {
            unsafe { _mm256_castps256_ps128(self.0) }
        }
        #[inline(always)]
        fn high(self) -> __m128 {
            unsafe { _mm256_extractf128_ps::<1>(self.0) }
        }
    }

    /// Four lanes of [`Lanes::affine`]. No closure: it would not be compiled for the level.
    #[inline(always)]
    unsafe fn half(a: &[f64; 4], x: __m128, y: __m128, z: __m128) -> __m128 {
        unsafe {
            let x = _mm256_mul_pd(_mm256_set1_pd(a[0]), _mm256_cvtps_pd(x));
            let y = _mm256_mul_pd(_mm256_set1_pd(a[1]), _mm256_cvtps_pd(y));
            let z = _mm256_mul_pd(_mm256_set1_pd(a[2]), _mm256_cvtps_pd(z));
            _mm256_cvtpd_ps(_mm256_add_pd(_mm256_add_pd(_mm256_add_pd(x, y), z), _mm256_set1_pd(a[3])))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NUMBERS: [Eight; 3] = [
        Eight([0.0, -0.0, 1.0, -1.5, 3e38, 1e-40, f32::INFINITY, f32::NAN]),
        Eight([1.0, 0.0, 1.0, 2.5, 3e38, -1e-40, f32::NEG_INFINITY, 7.0]),
        Eight([0.1, -0.3, 1e7, 1.0 / 3.0, -1.0, 2.0, 16777217.0, 0.5]),
    ];

    struct Everything;

    impl Task for Everything {
        type Output = Vec<u32>;

        #[inline(always)]
        fn run<S: Lanes>(self) -> Vec<u32> {
            let mut out = Vec::new();
            for a in &NUMBERS {
                for b in &NUMBERS {
                    let (x, y) = (S::load(a), S::load(b));
                    let z = S::affine([x, y, S::splat(0.7)], &[0.1, -1.0 / 3.0, 1e-9, 5.5]);
                    for r in [x.add(y), x.sub(y), x.mul(y), x.div(y), x.min(y), x.max(y), x.with(5, 0.7), z] {
                        // Which NaN it is is not agreed on.
                        out.extend(r.store().0.iter().map(|r| if r.is_nan() { u32::MAX } else { r.to_bits() }));
                    }
                    out.push(x.le(y));
                    out.push(S::equal(&a.0.map(f32::to_bits), 0x7fff_ffff, 1.0f32.to_bits()));
                }
            }
            out
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        let plain = run(Level::Portable, Everything);
        for level in Level::available() {
            assert_eq!(run(level, Everything), plain, "{level:?}");
        }
    }
}

//! Textures: eight bits a channel as stored, linear when read.

use glam::{Affine2, UVec2, Vec2, Vec4};

/// A decoded picture with its mip levels; small because it stays in eight bits.
#[derive(Clone, Debug)]
pub struct Texture {
    levels: Vec<Level>,
    srgb: bool,
    wrap: [Wrap; 2],
    nearest: bool,
}

#[derive(Clone, Debug)]
struct Level {
    size: UVec2,
    rgba: Vec<[u8; 4]>,
}

/// What happens outside [0, 1].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The picture repeats.
    #[default]
    Repeat,
    /// It repeats, every other one mirrored.
    Mirror,
    /// The edge goes on.
    Clamp,
}

/// Where a material reads a texture.
#[derive(Clone, Debug)]
pub struct TextureRef {
    /// Index in [`super::Scene::textures`].
    pub texture: u32,
    /// Texture coordinate set of the mesh.
    pub set: u32,
    /// Applied to the coordinates (KHR_texture_transform).
    pub transform: Affine2,
}

impl Texture {
    /// `rgba`: rows from the top, `size.x * size.y` of them. `srgb`: rgb are sRGB-encoded (alpha never is).
    pub fn new(size: UVec2, rgba: Vec<[u8; 4]>, srgb: bool, wrap: [Wrap; 2], nearest: bool) -> Self {
        assert_eq!(rgba.len(), (size.x * size.y) as usize, "a texture's texels are its width times its height");
        let mut t = Texture { levels: vec![Level { size, rgba }], srgb, wrap, nearest };
        while let Some(last) = t.levels.last().filter(|l| l.size.max_element() > 1) {
            let next = t.halved(last);
            t.levels.push(next);
        }
        t
    }

    /// Bytes that a texture of `size` takes, all its levels.
    pub fn bytes(size: UVec2) -> u64 {
        let next = |s: &UVec2| (s.max_element() > 1).then(|| (*s / 2).max(UVec2::ONE));
        let levels = std::iter::successors(Some(size), next);
        levels.map(|s| u64::from(s.x) * u64::from(s.y) * size_of::<[u8; 4]>() as u64).sum()
    }

    /// The finest level: width and height, and its texels as stored, rows from the top.
    pub fn picture(&self) -> (UVec2, &[[u8; 4]]) {
        (self.levels[0].size, &self.levels[0].rgba)
    }

    /// What happens outside [0, 1], in u and in v.
    pub fn wrap(&self) -> [Wrap; 2] {
        self.wrap
    }

    /// True if the finest level is read without interpolation.
    pub fn is_nearest(&self) -> bool {
        self.nearest
    }

    /// Mean of the whole picture, linear rgba.
    pub fn mean(&self) -> Vec4 {
        self.sample(Vec2::splat(0.5), f32::MAX)
    }

    /// Linear rgba at `uv` (v down), bilinear, from the level whose texels are about `footprint` (in uv) wide.
    pub fn sample(&self, uv: Vec2, footprint: f32) -> Vec4 {
        let finest = self.levels[0].size.max_element() as f32;
        let mut level = 0;
        while level + 1 < self.levels.len() && footprint * finest >= (2u32 << level) as f32 {
            level += 1;
        }
        let l = &self.levels[level];
        let p = uv * l.size.as_vec2();
        // Coordinates that overflow (damaged, or scaled without bound) read the corner instead of spreading NaN.
        let p = if p.is_finite() { p } else { Vec2::ZERO };
        if self.nearest && level == 0 {
            return self.fetch(l, p.x.floor(), p.y.floor());
        }
        let p = p - 0.5;
        let (i, f) = (p.floor(), p - p.floor());
        let row = |y: f32| self.fetch(l, i.x, y).lerp(self.fetch(l, i.x + 1.0, y), f.x);
        row(i.y).lerp(row(i.y + 1.0), f.y)
    }

    fn fetch(&self, l: &Level, x: f32, y: f32) -> Vec4 {
        let x = wrapped(x, l.size.x, self.wrap[0]);
        let y = wrapped(y, l.size.y, self.wrap[1]);
        self.linear(l.rgba[(y * l.size.x + x) as usize])
    }

    fn linear(&self, c: [u8; 4]) -> Vec4 {
        let of = |c: u8| if self.srgb { crate::math::SRGB_TO_LINEAR[c as usize] } else { f32::from(c) / 255.0 };
        Vec4::new(of(c[0]), of(c[1]), of(c[2]), f32::from(c[3]) / 255.0)
    }

    /// The next level: each texel is the mean of the area it covers, so the picture's mean is kept at odd sizes too.
    fn halved(&self, from: &Level) -> Level {
        let size = (from.size / 2).max(UVec2::ONE);
        let at = |x: u32, y: u32| {
            let mut mean = Vec4::ZERO;
            for (j, wy) in taps(y, from.size.y, size.y) {
                for (i, wx) in taps(x, from.size.x, size.x) {
                    mean += self.linear(from.rgba[(j * from.size.x + i) as usize]) * (wx * wy);
                }
            }
            let of = |c: f32| if self.srgb { crate::math::linear_to_srgb(c) } else { c };
            [of(mean.x), of(mean.y), of(mean.z), mean.w].map(|c| (c * 255.0 + 0.5) as u8)
        };
        let rgba = (0..size.y).flat_map(|y| (0..size.x).map(move |x| at(x, y))).collect();
        Level { size, rgba }
    }
}

/// Texels of a row of `n` that texel `x` of a row of `m` covers, with their shares of it. The shares sum to 1.
fn taps(x: u32, n: u32, m: u32) -> impl Iterator<Item = (u32, f32)> {
    let (start, end) = (u64::from(x) * u64::from(n), u64::from(x + 1) * u64::from(n));
    // In units of 1/m texel: texel i spans [i m, (i + 1) m).
    let m = u64::from(m);
    (start / m..end.div_ceil(m)).map(move |i| {
        let share = end.min((i + 1) * m) - start.max(i * m);
        (i as u32, share as f32 / n as f32)
    })
}

fn wrapped(i: f32, n: u32, wrap: Wrap) -> u32 {
    let (i, n) = (i as i64, i64::from(n));
    let j = match wrap {
        Wrap::Repeat => i.rem_euclid(n),
        Wrap::Clamp => i.clamp(0, n - 1),
        Wrap::Mirror => {
            let k = i.rem_euclid(2 * n);
            if k < n { k } else { 2 * n - 1 - k }
        }
    };
    j as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(size: UVec2, values: &[u8], wrap: Wrap, nearest: bool) -> Texture {
        let rgba = values.iter().map(|v| [*v, *v, *v, 255]).collect();
        Texture::new(size, rgba, false, [wrap; 2], nearest)
    }

    #[test]
    fn centres_of_texels_read_their_value() {
        let t = grey(UVec2::new(2, 2), &[0, 50, 100, 255], Wrap::Repeat, false);
        for (uv, v) in [([0.25, 0.25], 0), ([0.75, 0.25], 50), ([0.25, 0.75], 100), ([0.75, 0.75], 255)] {
            assert!((t.sample(Vec2::from_array(uv), 0.0).x - v as f32 / 255.0).abs() < 1e-6, "{uv:?}");
        }
        assert!((t.sample(Vec2::new(0.5, 0.25), 0.0).x - 25.0 / 255.0).abs() < 1e-6);
    }

    #[test]
    fn wrap_modes_differ_outside() {
        let at =
            |wrap, u| (grey(UVec2::new(2, 1), &[0, 255], wrap, true).sample(Vec2::new(u, 0.5), 0.0).x * 255.0) as u8;
        assert_eq!([at(Wrap::Repeat, 1.25), at(Wrap::Mirror, 1.25), at(Wrap::Clamp, 1.25)], [0, 255, 255]);
        assert_eq!([at(Wrap::Repeat, -0.25), at(Wrap::Mirror, -0.25), at(Wrap::Clamp, -0.25)], [255, 0, 0]);
    }

    #[test]
    fn coarse_levels_keep_the_mean_at_odd_sizes() {
        for (w, h) in [(3, 1), (5, 5), (7, 2), (6, 9)] {
            let values: Vec<u8> = (0..w * h).map(|i| if i % w == w - 1 { 250 } else { 10 }).collect();
            let mean = values.iter().map(|v| f32::from(*v)).sum::<f32>() / values.len() as f32;
            let got = grey(UVec2::new(w, h), &values, Wrap::Repeat, false).sample(Vec2::splat(0.5), 100.0).x * 255.0;
            assert!((got - mean).abs() < 2.0, "{w} x {h}: {got} instead of {mean}");
        }
    }

    #[test]
    fn srgb_is_averaged_linearly_and_alpha_never_decoded() {
        let t = Texture::new(UVec2::new(2, 1), vec![[0, 0, 0, 0], [255; 4]], true, [Wrap::Clamp; 2], false);
        let mean = t.sample(Vec2::splat(0.5), 10.0);
        assert!((mean.x - 0.5).abs() < 0.01 && (mean.w - 0.5).abs() < 0.01, "{mean}");
    }

    #[test]
    fn absurd_coordinates_read_something_finite() {
        let t = grey(UVec2::new(2, 2), &[0, 50, 100, 255], Wrap::Mirror, false);
        for u in [f32::NAN, f32::INFINITY, -1e38, 3.4e38] {
            assert!(t.sample(Vec2::new(u, 0.5), 0.0).is_finite(), "{u}");
        }
    }
}

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
        while t.levels.last().is_some_and(|l| l.size.max_element() > 1) {
            t.levels.push(t.halved());
        }
        t
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

    fn halved(&self) -> Level {
        let from = self.levels.last().expect("a texture has a level");
        let size = (from.size / 2).max(UVec2::ONE);
        let at = |x: u32, y: u32| {
            let sum = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| {
                let (x, y) = ((2 * x + i).min(from.size.x - 1), (2 * y + j).min(from.size.y - 1));
                self.linear(from.rgba[(y * from.size.x + x) as usize])
            });
            let mean = (sum[0] + sum[1] + sum[2] + sum[3]) * 0.25;
            let of = |c: f32| if self.srgb { crate::math::linear_to_srgb(c) } else { c };
            [of(mean.x), of(mean.y), of(mean.z), mean.w].map(|c| (c * 255.0 + 0.5) as u8)
        };
        let rgba = (0..size.y).flat_map(|y| (0..size.x).map(move |x| at(x, y))).collect();
        Level { size, rgba }
    }
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

//! Rough metal: microfacets after GGX (Walter et al., 2007), with Smith's height-correlated masking and Schlick's Fresnel
//! term, as the core of glTF has it; half vectors from those that are visible (Heitz, "Sampling the GGX Distribution of Visible
//! Normals", JCGT 2018).

use crate::math::Frame;
use glam::{Vec2, Vec3, Vec3Swizzles};
use std::f32::consts::{PI, TAU};

/// Metal at a place, seen from one direction.
pub(super) struct Metal {
    frame: Frame,
    normal: Vec3,
    /// The eye's direction, around the normal.
    view: Vec3,
    /// Reflectance head on.
    color: Vec3,
    /// Reflectance at grazing angles.
    share: f32,
    /// Roughness, squared.
    alpha: f32,
}

/// Below this the slopes of microfacets drown in rounding.
const SMOOTHEST: f32 = 1e-3;
/// Below this metal is as good as a mirror: its directions find what shines, and looking for it does not.
const SMOOTH: f32 = 0.01;

impl Metal {
    /// Metal with this unit `normal`, seen from unit `back`: `share` of the surface, which reflects `color` head on.
    pub fn new(normal: Vec3, back: Vec3, color: Vec3, share: f32, roughness: f32) -> Self {
        let frame = Frame::around(normal);
        let flat = frame.flat(back);
        // A shading normal may look away from the eye: then as if seen at a grazing angle.
        let view = Vec3::new(flat.x, flat.y, back.dot(normal).max(1e-4)).normalize();
        Metal { frame, normal, view, color, share, alpha: (roughness * roughness).max(SMOOTHEST) }
    }

    /// True for a mirror, or nearly.
    pub fn is_smooth(&self) -> bool {
        self.alpha < SMOOTH
    }

    /// A direction of the light that is mirrored to the eye, and what of it is.
    pub fn sample(&self, u: Vec2) -> Option<(Vec3, Vec3)> {
        let (v, a) = (self.view, self.alpha);
        let stretched = Vec3::new(a * v.x, a * v.y, v.z).normalize();
        let across = Vec3::new(-stretched.y, stretched.x, 0.0).try_normalize().unwrap_or(Vec3::X);
        let up = stretched.cross(across);
        let (radius, angle) = (u.x.sqrt(), TAU * u.y);
        let x = radius * libm::cosf(angle);
        let s = 0.5 * (1.0 + stretched.z);
        let y = (1.0 - s) * (1.0 - x * x).max(0.0).sqrt() + s * radius * libm::sinf(angle);
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let h = across * x + up * y + stretched * z;
        let h = Vec3::new(a * h.x, a * h.y, h.z.max(1e-6)).normalize();
        let l = 2.0 * v.dot(h) * h - v;
        if l.z <= 0.0 {
            return None;
        }
        // Density is G1 D (v.h) / v.z over 4 (v.h): what remains is F G2 / G1.
        let share = self.fresnel(v.dot(h)) * ((1.0 + self.lambda(v)) / (1.0 + self.lambda(v) + self.lambda(l)));
        Some((self.frame.to_world(l), share))
    }

    /// Density, by solid angle, with which [`Metal::sample`] draws unit direction `d`.
    pub fn density(&self, d: Vec3) -> f32 {
        self.facets(d).map_or(0.0, |(_, _, facets)| facets / (4.0 * self.view.z * (1.0 + self.lambda(self.view))))
    }

    /// Radiance to the eye for irradiance across the beam from unit direction `to_light`.
    pub fn shine(&self, to_light: Vec3) -> Vec3 {
        let Some((l, h, facets)) = self.facets(to_light) else { return Vec3::ZERO };
        let v = self.view;
        self.fresnel(v.dot(h)) * (facets / (4.0 * v.z * (1.0 + self.lambda(v) + self.lambda(l))))
    }

    /// A direction around the normal, the half vector and how many facets face it (D); `None` below the surface.
    fn facets(&self, d: Vec3) -> Option<(Vec3, Vec3, f32)> {
        let l = self.frame.flat(d).extend(d.dot(self.normal));
        let (h, a) = ((l + self.view).normalize(), self.alpha);
        // With h.z^2 + |h.xy|^2 = 1, so that smooth metal does not lose all digits.
        let bend = h.xy().length_squared() + a * a * h.z * h.z;
        (l.z > 0.0).then(|| (l, h, a * a / (PI * bend * bend)))
    }

    fn fresnel(&self, cos: f32) -> Vec3 {
        let rest = (1.0 - cos).clamp(0.0, 1.0);
        let grazing = rest * rest * rest * rest * rest;
        self.color + (Vec3::splat(self.share) - self.color).max(Vec3::ZERO) * grazing
    }

    /// Smith's Lambda.
    fn lambda(&self, w: Vec3) -> f32 {
        let tan = w.xy().length_squared() / (w.z * w.z).max(1e-12);
        0.5 * ((1.0 + self.alpha * self.alpha * tan).sqrt() - 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::vec3;

    fn points(n: u32) -> impl Iterator<Item = Vec2> {
        (0..n).map(|i| {
            let [x, y, ..] = sobol_burley::sample_4d(i, 0, 3);
            Vec2::new(x, y)
        })
    }

    #[test]
    fn samples_have_the_density_of_what_they_mirror() {
        // The mirrored light of a sky that is brighter upwards, by samples and by the formula over all directions.
        let normal = Vec3::new(0.3, 0.9, -0.1).normalize();
        let sky = |d: Vec3| 1.0 + d.y + 0.3 * d.x;
        for (roughness, back) in [(0.3, Vec3::new(0.8, 0.4, 0.3)), (0.7, Vec3::new(-0.2, 1.0, 0.1)), (1.0, normal)] {
            let metal = Metal::new(normal, back.normalize(), Vec3::new(0.9, 0.5, 0.1), 1.0, roughness);
            let n = 1 << 15;
            let drawn = points(n).filter_map(|u| metal.sample(u)).map(|(d, share)| share * sky(d)).sum::<Vec3>();
            let even = points(n).map(|u| {
                let z = u.x;
                let flat = (1.0 - z * z).sqrt();
                let l = Vec3::new(flat * libm::cosf(TAU * u.y), flat * libm::sinf(TAU * u.y), z);
                let d = metal.frame.to_world(l);
                metal.shine(d) * (TAU * sky(d))
            });
            let whole: f32 = points(n)
                .map(|u| {
                    let flat = (1.0 - u.x * u.x).sqrt();
                    metal.density(metal.frame.to_world(vec3(
                        flat * libm::cosf(TAU * u.y),
                        flat * libm::sinf(TAU * u.y),
                        u.x,
                    )))
                })
                .sum::<f32>()
                * TAU
                / n as f32;
            let above = points(n).filter(|u| metal.sample(*u).is_some()).count() as f32 / n as f32;
            assert!((whole - above).abs() < 0.01, "{roughness}: {whole} {above}");
            let (drawn, even) = (drawn / n as f32, even.sum::<Vec3>() / n as f32);
            assert!((drawn / even - 1.0).abs().max_element() < 0.01, "{roughness}: {drawn} {even}");
        }
    }

    #[test]
    fn a_mirror_mirrors_and_keeps_its_colour() {
        let back = Vec3::new(0.6, 0.8, 0.0);
        let metal = Metal::new(Vec3::Y, back, Vec3::new(0.9, 0.5, 0.1), 1.0, 0.0);
        for u in points(64) {
            let (d, share) = metal.sample(u).unwrap();
            assert!((d - Vec3::new(-0.6, 0.8, 0.0)).length() < 0.05, "{d}");
            assert!((share - Vec3::new(0.9, 0.5, 0.1)).abs().max_element() < 1e-3, "{share}");
        }
    }

    #[test]
    fn no_metal_gives_more_than_it_gets() {
        for roughness in [0.0, 0.2, 0.5, 1.0] {
            for z in [1e-3f32, 0.1, 0.5, 1.0] {
                let back = Vec3::new((1.0 - z * z).sqrt(), 0.0, z);
                let metal = Metal::new(Vec3::Z, back, Vec3::ONE, 1.0, roughness);
                let sum = points(4096).filter_map(|u| metal.sample(u)).map(|(_, s)| s).sum::<Vec3>() / 4096.0;
                assert!(sum.max_element() <= 1.0 + 1e-3 && sum.min_element() > 0.3, "{roughness} {z}: {sum}");
                // In closed form: head on, as rough as can be.
                let exact = 1.0 - std::f32::consts::LN_2;
                assert!(roughness < 1.0 || z < 1.0 || (sum.x - exact).abs() < 1e-3, "{sum} {exact}");
            }
        }
    }
}

//! [`Received`]: the light of all sources at a texel, while it is measured.

use glam::Vec3;

/// What a texel receives from all sources.
#[derive(Clone, Copy, Default)]
pub(super) struct Received {
    pub lights: Vec3,
    pub hidden: Vec3,
    pub emitters: Vec3,
    pub sky_peaks: Vec3,
    /// Luminance of the unshadowed light, and of what arrives of it.
    pub sent: f32,
    pub arrived: f32,
    /// True if some rays to one source arrive and others do not.
    pub mixed: bool,
    /// Of the luminance of all light, about, from how the rays disagree.
    pub variance: f32,
    pub rays: u32,
}

impl Received {
    /// Light of all sources.
    pub fn total(&self) -> Vec3 {
        self.lights + self.hidden + self.emitters + self.sky_peaks
    }

    /// Each source's light by a function of its own and another's.
    pub fn zip(self, o: &Self, f: impl Fn(Vec3, Vec3) -> Vec3) -> Self {
        let (lights, hidden) = (f(self.lights, o.lights), f(self.hidden, o.hidden));
        Received {
            lights,
            hidden,
            emitters: f(self.emitters, o.emitters),
            sky_peaks: f(self.sky_peaks, o.sky_peaks),
            ..self
        }
    }
}

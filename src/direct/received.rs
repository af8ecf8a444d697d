//! [`Received`]: the light of all sources at a texel, while it is measured.

use crate::math::luminance;
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
    /// Of the luminance of all light, about, from how the rays disagree; and the part of it that emitters have.
    pub variance: f32,
    pub of_emitters: f32,
    pub rays: u32,
    /// Points from which each source was looked for, or the one that needed most; and those of emitters, which never need
    /// more than the first.
    pub points: u32,
    pub first: u32,
}

impl Received {
    /// Light of all sources.
    pub fn total(&self) -> Vec3 {
        self.lights + self.hidden + self.emitters + self.sky_peaks
    }

    /// The same, of a texel that was looked at from fewer points before. Rays that agree where those did not do so by chance:
    /// then the difference tells how far they are off.
    pub fn after(self, before: &Self) -> Self {
        if self.variance > 0.0 || before.variance == 0.0 {
            return self;
        }
        let difference = luminance(self.total() - before.total());
        let (few, many) = (before.points as f32, self.points as f32);
        Received { variance: difference * difference * few / (few + many).max(1.0), ..self }
    }

    /// What both have told, from points of their own.
    pub fn and(self, o: &Self) -> Self {
        let shares = |[a, b]: [u32; 2]| [a, b].map(|n| n as f32 / (a + b).max(1) as f32);
        let [a, b] = shares([self.points, o.points]);
        let [c, d] = shares([self.first, o.first]);
        let of_emitters = c * c * self.of_emitters + d * d * o.of_emitters;
        let of_others = [self, *o].map(|r| r.variance - r.of_emitters);
        let mut variance = a * a * of_others[0] + b * b * of_others[1] + of_emitters;
        if self.variance == 0.0 || o.variance == 0.0 {
            // The rays of one agree, by chance if its light is another's.
            let difference = luminance(self.total() - o.total());
            variance = variance.max(difference * difference * a * b);
        }
        Received {
            sent: a * self.sent + b * o.sent,
            arrived: a * self.arrived + b * o.arrived,
            mixed: self.mixed || o.mixed,
            variance,
            of_emitters,
            rays: self.rays + o.rays,
            points: self.points + o.points,
            first: self.first + o.first,
            emitters: self.emitters * c + o.emitters * d,
            ..self.zip(o, |x, y| x * a + y * b)
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn looked(light: f32, variance: f32, points: u32) -> Received {
        Received { lights: Vec3::splat(light), variance, points, first: points, ..Received::default() }
    }

    #[test]
    fn agreement_by_chance_is_doubted() {
        // None of 16 rays met a light that half of 8 did.
        let doubtful = looked(0.0, 0.0, 16).after(&looked(6.0, 4.0, 8));
        assert!((doubtful.variance - 12.0).abs() < 1e-3, "{}", doubtful.variance);
        let sure = looked(0.0, 0.0, 16).after(&looked(0.0, 0.0, 8));
        assert_eq!(sure.variance, 0.0);
        assert_eq!(looked(3.0, 2.0, 16).after(&looked(6.0, 4.0, 8)).variance, 2.0);
    }

    #[test]
    fn what_two_have_told_is_worth_their_points() {
        let both = looked(3.0, 2.0, 4).and(&looked(6.0, 4.0, 12));
        assert_eq!((both.lights.x, both.points, both.variance), (5.25, 16, 2.375));
        // One that agrees with itself, but not with the other, has been lucky.
        assert_eq!(looked(2.0, 0.0, 4).and(&looked(6.0, 0.0, 4)).variance, 4.0);
        assert_eq!(looked(2.0, 0.0, 4).and(&looked(2.0, 0.0, 4)).variance, 0.0);
        // Emitters were looked for from as many points, whatever lamps needed.
        let lamps = Received { points: 64, first: 16, emitters: Vec3::splat(2.0), ..looked(3.0, 0.0, 0) };
        let both = lamps.and(&Received { emitters: Vec3::splat(6.0), ..looked(3.0, 0.0, 16) });
        assert_eq!((both.emitters.x, both.lights.x, both.points, both.first), (4.0, 3.0, 80, 32));
        let alone = Received::default().and(&looked(6.0, 4.0, 16));
        assert_eq!((alone.lights.x, alone.variance), (6.0, 4.0));
    }
}

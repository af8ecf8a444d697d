//! Shadow rays from a texel to one source: aimed one by one, traced together.

use crate::{
    math::luminance,
    patches::SurfacePoint,
    trace::{Segment, Tracer},
};
use glam::Vec3;

/// Least over most light of rays that carry about the same.
const EVEN: f32 = 0.9;

/// Shadow rays and what they carry.
#[derive(Default)]
pub(super) struct Volley {
    segments: Vec<Segment>,
    shots: Vec<Shot>,
    through: Vec<Vec3>,
}

struct Shot {
    /// Unshadowed light that stands for this ray's: of a source whose pattern is sampled, its mean.
    sent: Vec3,
    /// Light that arrives if nothing is in the way.
    irradiance: Vec3,
}

/// Unshadowed and arriving light of one source.
#[derive(Default)]
pub(super) struct Tally {
    pub sent: Vec3,
    pub arrived: Vec3,
    /// Sum of the shares (luminance) that come through, and of their squares.
    pub through: [f32; 2],
    pub rays: u32,
    /// Points from which the source was looked for.
    pub points: u32,
}

impl Volley {
    /// Forgets all rays.
    pub fn clear(&mut self) {
        self.segments.clear();
        self.shots.clear();
    }

    /// Adds a ray from `p`.
    pub fn aim(&mut self, p: &SurfacePoint, direction: Vec3, t: f32, sent: Vec3, irradiance: Vec3) {
        self.segments.push(p.segment(direction, t));
        self.shots.push(Shot { sent, irradiance });
    }

    /// Traces all rays and sums up.
    pub fn fire(&mut self, tracer: &Tracer) -> Tally {
        self.through.resize(self.segments.len(), Vec3::ZERO);
        tracer.transmittance_of_each(&self.segments, &mut self.through);
        let mut tally = Tally { rays: self.shots.len() as u32, ..Tally::default() };
        for (shot, &through) in self.shots.iter().zip(&self.through) {
            tally.sent += shot.sent;
            tally.arrived += shot.irradiance * through;
            let share = luminance(through);
            tally.through[0] += share;
            tally.through[1] += share * share;
        }
        tally
    }

    /// True if a ray goes out from each of so many points, or from none, and all carry about the same.
    pub fn is_even(&self, points: usize) -> bool {
        let lights = || self.shots.iter().map(|shot| luminance(shot.sent));
        let (least, most) = (lights().fold(f32::INFINITY, f32::min), lights().fold(0.0, f32::max));
        self.shots.is_empty() || self.shots.len() == points && least > EVEN * most
    }

    /// Where each ray that was fired begins, and what arrived by it.
    pub fn arrivals(&self) -> impl Iterator<Item = (Vec3, Vec3)> {
        let lights = self.shots.iter().zip(&self.through).map(|(shot, &through)| shot.irradiance * through);
        self.segments.iter().map(|segment| segment.origin).zip(lights)
    }
}

impl Tally {
    /// Variance of the share that comes through, from ray to ray.
    pub fn spread(&self) -> f32 {
        let n = self.rays.max(1) as f32;
        let [mean, square] = self.through.map(|sum| sum / n);
        let spread = square - mean * mean;
        // Less is rounding.
        if spread > 1e-5 { spread } else { 0.0 }
    }

    /// The same share of `exact`.
    pub fn of(self, exact: Vec3) -> Self {
        let share = Vec3::select(self.sent.cmpgt(Vec3::ZERO), self.arrived / self.sent, Vec3::ZERO);
        Tally { sent: exact, arrived: exact * share, ..self }
    }

    /// Both together.
    pub fn and(self, o: Self) -> Self {
        let through = [self.through[0] + o.through[0], self.through[1] + o.through[1]];
        let (rays, points) = (self.rays + o.rays, self.points + o.points);
        Tally { sent: self.sent + o.sent, arrived: self.arrived + o.arrived, through, rays, points }
    }

    pub fn scaled(self, f: f32) -> Self {
        Tally { sent: self.sent * f, arrived: self.arrived * f, ..self }
    }
}

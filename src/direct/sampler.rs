//! [`Sampler`]: direct light at single points, for paths that go through them.

use super::{
    Sources,
    disc::Disc,
    emitters::{Sample, Stratum},
    punctual::{self, Aim},
    volley::Volley,
};
use crate::{math::Random, patches::SurfacePoint, scene::Bake, trace::Tracer};
use glam::{Vec2, Vec3};

/// Draws of a point of an emitter that is above the horizon.
const DRAWS: u32 = 4;

/// One shadow ray to each light, to the sky's peaks, to each emitter that is near or matters, and to one of the others. Reused: keeps its allocations.
#[derive(Default)]
pub struct Sampler {
    cut: Vec<Stratum>,
    volley: Volley,
    /// Shadow rays traced.
    pub rays: u64,
}

impl Sampler {
    /// An estimate of what [`Direct::total`](super::Direct::total) is the mean of, at `p`: irradiance, W/m^2.
    pub fn irradiance(&mut self, tracer: &Tracer, sources: &Sources, p: &SurfacePoint, random: &mut Random) -> Vec3 {
        let Sampler { cut, volley, rays } = self;
        volley.clear();
        let mut take = |aim: Option<Aim>| {
            if let Some(Aim { direction, distance, irradiance }) = aim {
                volley.aim(p, direction, distance * (1.0 - 1e-4), irradiance, irradiance);
            }
        };
        for light in sources.lights.iter().filter(|l| l.bake != Bake::None) {
            take(punctual::aim(light, p, random.pair()));
        }
        if let Some(peaks) = &sources.peaks {
            take(peaks.aim(p, random.pair()));
        }
        sources.emitters.cut(&Disc::around(p.position, p.face), cut);
        let (near, far) = sources.emitters.divide(cut);
        for leaf in near {
            let exact = sources.emitters.exact(leaf, p);
            // Points below the horizon say nothing of what is above.
            let mut sample = || sources.emitters.sample(sources.scene, leaf, p, random.pair());
            let sample = if exact == Vec3::ZERO { None } else { (0..DRAWS).find_map(|_| sample()) };
            if let Some(Sample { direction, distance, irradiance, mean }) = sample {
                let pattern = Vec3::select(mean.cmpgt(Vec3::ZERO), irradiance / mean, Vec3::ZERO);
                volley.aim(p, direction, distance * (1.0 - 1e-5), exact, exact * pattern);
            }
        }
        let total: f32 = far.iter().map(|s| s.weight).sum();
        let mut at = random.next() * total;
        let chosen = |s: &&Stratum| {
            let inside = at < s.weight;
            at -= if inside { 0.0 } else { s.weight };
            inside
        };
        // Rounding may leave the last one's end.
        if let Some(stratum) = far.iter().find(chosen).or(far.last()) {
            let u = Vec2::new((at / stratum.weight).clamp(0.0, 1.0), random.next());
            let sample = sources.emitters.sample(sources.scene, stratum, p, u);
            if let Some(Sample { direction, distance, irradiance, .. }) = sample {
                let irradiance = irradiance * (total / stratum.weight);
                volley.aim(p, direction, distance * (1.0 - 1e-5), irradiance, irradiance);
            }
        }
        let tally = volley.fire(tracer);
        *rays += u64::from(tally.rays);
        tally.arrived
    }
}

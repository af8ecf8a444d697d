//! What is seen around each texel, by a few rays.

use crate::{
    audit::Subject,
    math::{PointTable, cosine_hemisphere, hash},
    patches::{Faces, Footprint, Seen, seen},
};
use rayon::prelude::*;

/// What rays from a texel found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Look {
    /// Share of its points that geometry does not enclose.
    pub valid: f32,
    /// Share of rays that ended on a lit surface.
    pub seen: f32,
}

/// Points of a texel, and rays of a point.
const POINTS: usize = 8;
const RAYS: usize = 4;

/// Looks around from every texel.
pub(super) fn around(subject: &Subject) -> Vec<Look> {
    let (tracer, coverage) = (subject.tracer, subject.coverage);
    let table = PointTable::of_places(POINTS * RAYS, 0x696e_7370);
    let one = |faces: &mut Faces, texel: usize| {
        let footprint = Footprint::of(texel, faces);
        if footprint.faces().is_empty() {
            return Look { valid: 1.0, seen: 0.0 };
        }
        let at = coverage.texels[texel].at;
        let (mut open, mut met) = (0, 0);
        for (k, points) in table.block(at.x, at.y, 0).chunks(RAYS).enumerate() {
            let from = footprint.point(points[0].place);
            let mut enclosed = true;
            for (i, p) in points.iter().enumerate() {
                let mut direction = from.frame.to_world(cosine_hemisphere(p.extra));
                direction -= 2.0 * direction.dot(from.face).min(0.0) * from.face;
                let hit = tracer.closest(&from.ray(direction, hash(texel as u32, (k * RAYS + i) as u32)));
                let seen = hit.map(|hit| seen(coverage, &hit));
                met += u32::from(matches!(seen, Some(Seen::Front(_) | Seen::Back(_))));
                let dark = |h: crate::trace::Hit| !h.front && !tracer.world.material(h.triangle).emits();
                enclosed &= hit.is_some_and(dark);
            }
            open += u32::from(!enclosed);
        }
        Look { valid: open as f32 / POINTS as f32, seen: met as f32 / (POINTS * RAYS) as f32 }
    };
    let fresh = || Faces::new(&tracer.world, coverage);
    (0..coverage.texels.len()).into_par_iter().map_init(fresh, one).collect()
}

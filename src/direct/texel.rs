//! The light of all sources at one texel.

use super::{
    disc::Disc,
    emitters::{Sample, Stratum},
    measure::Task,
    parts::{Divided, Division},
    punctual::{self, Aim},
    received::Received,
    volley::{Tally, Volley},
};
use crate::{
    math::{Point, PointTable, hash, luminance, unit_float},
    patches::{Faces, Footprint, SurfacePoint},
    scene::Bake,
};
use glam::{UVec2, Vec2, Vec3};

/// Points at which closed forms are averaged over the texel, unless its middle stands for it, and where these differ.
const EXACT_POINTS: usize = 4;
pub(super) const NEAR_POINTS: usize = 64;
/// Cosine between faces that light reaches alike.
const FLAT: f32 = 0.99;
/// Part of the noise that asks for more rays that may come from there.
const NEAR_NOISE: f32 = 0.25;
/// Blocks of points among which a partly enclosed texel looks for open ones, and points, at least.
const BLOCKS: usize = 8;
const TRIES: usize = 32;

/// Allocations that serve one texel after the other.
pub(super) struct Desk<'a> {
    faces: Faces<'a>,
    footprint: Footprint,
    cut: Vec<Stratum>,
    few: Vec<SurfacePoint>,
    volley: Volley,
}

impl<'a> Desk<'a> {
    pub fn new(task: &Task<'a>) -> Self {
        let faces = Faces::new(&task.tracer.world, task.coverage);
        Desk { faces, footprint: Footprint::default(), cut: Vec::new(), few: Vec::new(), volley: Volley::default() }
    }
}

/// Where on a texel light is looked for: a block of points, or as many open ones, and further blocks.
struct Places<'p> {
    first: &'p [Point],
    /// More, for what costs no rays; the same where only few are open.
    many: &'p [Point],
    table: &'p PointTable,
    at: UVec2,
    /// With the first.
    blocks: usize,
    /// True if the texel's faces look to different sides.
    folded: bool,
}

impl<'p> Places<'p> {
    fn new(table: &'p PointTable, many: &'p PointTable, at: UVec2, footprint: &Footprint) -> Self {
        let normal = footprint.normal();
        let folded = footprint.normals().any(|n| n.dot(normal) < FLAT);
        let [first, many] = [table, many].map(|table| table.block(at.x, at.y, 0));
        Places { first, many, table, at, blocks: table.blocks(), folded }
    }

    /// The blocks after the first, of up to `most`.
    fn beyond(&self, most: usize) -> impl Iterator<Item = &[Point]> {
        (1..most.min(self.blocks)).map(|pass| self.table.block(self.at.x, self.at.y, pass))
    }
}

impl Task<'_> {
    /// Looks from up to `most` blocks of points; at the patch's parts, too, if it is to `divide` it.
    pub fn texel(
        &self,
        patch: usize,
        table: &PointTable,
        most: usize,
        divide: bool,
        desk: &mut Desk,
    ) -> (Received, Option<Box<Divided>>) {
        let Desk { faces, footprint, cut, few, volley } = desk;
        let (texel, back) = self.patches.texel(patch);
        let at = self.coverage.texels[texel].at;
        footprint.set(texel, faces);
        let on_surface = |u: Vec2| {
            let p = footprint.point(u);
            if back { p.reversed() } else { p }
        };
        let open;
        let mut places = Places::new(table, &self.many, at, footprint);
        if self.patches.validity[patch] < 1.0 {
            open = self.open_points(table, at, &on_surface);
            places = Places { first: &open, many: &open, blocks: 1, ..places };
        }
        let points = places.first;
        if points.is_empty() {
            return (Received::default(), None);
        }
        // Shifts of their own keep the table's period out of the picture.
        let key = hash(patch as u32, points.len() as u32);
        let shift = Vec2::new(unit_float(key), unit_float(hash(key, 1)));
        let n = points.len() as u32;
        let mut r = Received { points: n, first: n, ..Received::default() };
        let mut division = divide.then(|| Division::of(footprint));
        let (mut sent, mut arrived) = (0.0, 0.0);
        let mut book = |tally: Tally, r: &mut Received| {
            sent += luminance(tally.sent);
            arrived += luminance(tally.arrived);
            r.mixed |= tally.spread() > 0.0 || tally.rays == 0 && tally.sent != Vec3::ZERO;
            // Errors of stratified points at an edge fall faster than with the root of their number.
            let n = tally.rays.max(1) as f32;
            r.variance += luminance(tally.sent).powi(2) * tally.spread() / (n * n.sqrt().sqrt());
            r.rays += tally.rays;
            r.points = r.points.max(tally.points);
        };
        for light in self.sources.lights.iter().filter(|l| l.bake != Bake::None) {
            let aim = |p: &SurfacePoint, u| punctual::aim(light, p, wrapped(u + shift));
            let tally = self.punctual(&places, most, &on_surface, &aim, volley, division.as_mut());
            *(if light.bake == Bake::Full { &mut r.lights } else { &mut r.hidden }) += tally.arrived;
            book(tally, &mut r);
        }
        if let Some(peaks) = &self.sources.peaks {
            let aim = |p: &SurfacePoint, u| peaks.aim(p, wrapped(u + shift));
            let tally = self.punctual(&places, most, &on_surface, &aim, volley, division.as_mut());
            r.sky_peaks += tally.arrived;
            book(tally, &mut r);
        }
        if self.sources.emitters.is_empty() {
            return (Received { sent, arrived, ..r }, division.and_then(Division::finish));
        }
        let of_others = r.variance;
        let middle = if back { footprint.middle().reversed() } else { footprint.middle() };
        let disc = Disc::of_texel(footprint, &middle);
        self.sources.emitters.cut(&disc, cut);
        let (near, far) = self.sources.emitters.divide(cut);
        // The same points for all leaves: what their closed forms share between them sums up.
        let mut exact_at = |n: usize| {
            few.clear();
            few.extend(points.iter().take(n).map(|p| on_surface(p.place)));
            self.exact(near, few)
        };
        let all_open = self.patches.validity[patch] == 1.0;
        let (mut exact, mut variance) = if all_open && self.sources.emitters.see_a_point(near, &disc) {
            self.exact(near, &[middle])
        } else {
            exact_at(EXACT_POINTS)
        };
        let all: f32 = exact.iter().map(|e| luminance(*e)).sum();
        if points.len() > EXACT_POINTS && variance.sqrt() > NEAR_NOISE * self.noise * all.max(self.faint) {
            (exact, variance) = exact_at(NEAR_POINTS);
        }
        r.variance += variance;
        let near_weight: f32 = exact.iter().map(|e| luminance(*e)).sum();
        let far_weight: f32 = far.iter().map(|s| s.weight).sum();
        let samples = |part: f32| {
            let wish = points.len() as f32 * part / (near_weight + far_weight);
            (wish.round() as usize).clamp(1, points.len())
        };
        let (mut next, mut singles) = (0, Tally::default());
        for (stratum, exact) in near.iter().zip(exact).filter(|(_, exact)| *exact != Vec3::ZERO) {
            let n = samples(luminance(exact));
            let tally = self.leaf(stratum, points, next..next + n, &on_surface, shift, volley).of(exact);
            next += n;
            r.emitters += tally.arrived;
            // One ray does not tell whether all arrive; those to many leaves do together.
            match tally.rays {
                1 => singles = singles.and(tally),
                _ => book(tally, &mut r),
            }
        }
        if singles.rays > 0 {
            book(singles, &mut r);
        }
        if !far.is_empty() {
            let (tally, noise) =
                self.pooled(far, far_weight, &points[..samples(far_weight)], &on_surface, shift, volley);
            r.emitters += tally.arrived;
            r.variance += noise * noise;
            r.mixed |= noise > self.noise * luminance(r.emitters).max(self.faint);
            // Its spread is in the noise.
            book(Tally { through: [0.0; 2], ..tally }, &mut r);
        }
        r.of_emitters = r.variance - of_others;
        (Received { sent, arrived, ..r }, division.and_then(Division::finish))
    }

    /// Mean of each leaf's closed form over `points`, and the variance of what they sum up to.
    fn exact(&self, leaves: &[Stratum], points: &[SurfacePoint]) -> (Vec<Vec3>, f32) {
        let n = points.len() as f32;
        let mut at_points = vec![0.0; points.len()];
        let mean = |leaf| {
            let mut sum = Vec3::ZERO;
            for (p, all) in points.iter().zip(&mut at_points) {
                let light = self.sources.emitters.exact(leaf, p);
                sum += light;
                *all += luminance(light);
            }
            sum / n
        };
        let means = leaves.iter().map(mean).collect();
        let all = at_points.iter().sum::<f32>() / n;
        let squares: f32 = at_points.iter().map(|x| (x - all) * (x - all)).sum();
        (means, squares / (n * n * n.sqrt()))
    }

    /// As many points as a block has, or all that few blocks give, that other geometry does not enclose.
    fn open_points(&self, table: &PointTable, at: UVec2, on_surface: &impl Fn(Vec2) -> SurfacePoint) -> Vec<Point> {
        let (mut open, wish) = (Vec::new(), table.block(at.x, at.y, 0).len());
        let blocks = BLOCKS.max(TRIES / wish.max(1)).min(table.blocks());
        for points in (0..blocks).map(|pass| table.block(at.x, at.y, pass)) {
            let mut left: Vec<&Point> = points.iter().collect();
            // Rows have proved that it is partly enclosed. What one ray may take for backs all around, another may not.
            for turn in [Vec2::X, Vec2::NEG_X] {
                let some: Vec<SurfacePoint> = left.iter().map(|p| on_surface(p.place)).collect();
                let mut enclosed = self.enclosure.meet_backs(&some, at, turn).into_iter();
                let is_enclosed = |_: &&Point| enclosed.next() == Some(true);
                let (behind, out): (Vec<&Point>, Vec<&Point>) = left.into_iter().partition(is_enclosed);
                open.extend(out);
                left = behind;
            }
            if open.len() >= wish {
                break;
            }
        }
        open.truncate(wish);
        open
    }

    /// Mean over the texel's points of what arrives from a source that is one ray a point; over more if these disagree. Then
    /// parts may differ. Where few points would not even know the unshadowed light, they only tell the share that arrives.
    fn punctual(
        &self,
        places: &Places,
        most: usize,
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        aim: &impl Fn(&SurfacePoint, Vec2) -> Option<Aim>,
        volley: &mut Volley,
        mut parts: Option<&mut Division>,
    ) -> Tally {
        let mut fire = |some: &[Point]| {
            volley.clear();
            for point in some {
                let p = on_surface(point.place);
                if let Some(Aim { direction, distance, irradiance }) = aim(&p, point.extra) {
                    // A hair short of the light: a lamp's own surface may stand at it.
                    volley.aim(&p, direction, distance * (1.0 - 1e-4), irradiance, irradiance);
                }
                if let Some(parts) = &mut parts {
                    parts.visit(p.lifted());
                }
            }
            let tally = Tally { points: some.len() as u32, ..volley.fire(self.tracer) };
            if let Some(parts) = &mut parts {
                volley.arrivals().for_each(|(from, light)| parts.receive(from, light));
            }
            (tally, volley.is_even(some.len()))
        };
        let (mut tally, even) = fire(places.first);
        let mixed = tally.spread() > 0.0;
        if mixed {
            tally = places.beyond(most).fold(tally, |tally, some| tally.and(fire(some).0));
        }
        if let Some(parts) = parts {
            parts.end_source(mixed);
        }
        let share = 1.0 / tally.points as f32;
        let tally = tally.scaled(share);
        // Where nothing arrives, the share of it is nothing.
        let dark = tally.rays > 0 && tally.arrived == Vec3::ZERO;
        if dark || tally.points as usize >= NEAR_POINTS || even && !places.folded {
            return tally;
        }
        let sent = places.many.iter().map(|point| aim(&on_surface(point.place), point.extra));
        let add = |(sum, n), aim: Option<Aim>| (aim.map_or(sum, |aim| sum + aim.irradiance), n + 1.0);
        let (sum, n) = sent.fold((Vec3::ZERO, 0.0), add);
        tally.of(sum / n)
    }

    /// What arrives from points of a leaf.
    fn leaf(
        &self,
        leaf: &Stratum,
        points: &[Point],
        samples: std::ops::Range<usize>,
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        shift: Vec2,
        volley: &mut Volley,
    ) -> Tally {
        volley.clear();
        for k in samples {
            let point = &points[k % points.len()];
            self.to_emitter(leaf, &on_surface(point.place), wrapped(point.extra + shift), 1.0, volley);
        }
        volley.fire(self.tracer)
    }

    /// The mean of samples over the whole cut, and its standard error (luminance).
    fn pooled(
        &self,
        cut: &[Stratum],
        total: f32,
        points: &[Point],
        on_surface: &impl Fn(Vec2) -> SurfacePoint,
        shift: Vec2,
        volley: &mut Volley,
    ) -> (Tally, f32) {
        let mut sum = 0.0;
        let cumulative: Vec<f32> = cut
            .iter()
            .map(|s| {
                sum += s.weight;
                sum
            })
            .collect();
        volley.clear();
        for point in points {
            let p = on_surface(point.place);
            let u = wrapped(point.extra + shift);
            let at = u.x * total;
            let k = cumulative.partition_point(|&c| c <= at).min(cut.len() - 1);
            let stratum = &cut[k];
            let inside = 1.0 - (cumulative[k] - at) / stratum.weight;
            let u = Vec2::new(inside.clamp(0.0, 1.0), u.y);
            self.to_emitter(stratum, &p, u, total / stratum.weight, volley);
        }
        let tally = volley.fire(self.tracer);
        // Samples without a ray are zero.
        let squares: f32 = volley.arrivals().map(|(_, x)| luminance(x) * luminance(x)).sum();
        let (n, sum) = (points.len() as f32, luminance(tally.arrived));
        let variance = (squares / n - (sum / n) * (sum / n)).max(0.0);
        (tally.scaled(1.0 / n), (variance / n).sqrt())
    }

    /// Aims at a point of the stratum; what comes from there is worth `weight`.
    fn to_emitter(&self, stratum: &Stratum, p: &SurfacePoint, u: Vec2, weight: f32, volley: &mut Volley) {
        let sample = self.sources.emitters.sample(self.sources.scene, stratum, p, u);
        if let Some(Sample { way, irradiance, mean }) = sample {
            volley.aim(p, way, 1.0 - 1e-5, mean * weight, irradiance * weight);
        }
    }
}

/// A place of the unit square moved by another, around its edges.
fn wrapped(u: Vec2) -> Vec2 {
    u - Vec2::select(u.cmpge(Vec2::ONE), Vec2::ONE, Vec2::ZERO)
}

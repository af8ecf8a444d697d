//! Points of the truth. An audit draws them and forgets them; [`Truth`] keeps them, so that many lightmaps of a scene are
//! held against the same.

use super::{
    Audit, Budget, Interval, Options, ROUND, Subject,
    figures::{self, Point},
    halves::{Halves, PLACES},
    lookup, mean,
    path::{Bundle, Lights, PARTS, net},
    points::{self, Texels},
    surface::Place,
};
use crate::{
    atlas::Coverage,
    error::Result,
    lightmaps::{Lightmaps, Reading},
    math::hash,
    progress::{self, Observer},
};
use glam::{DVec3, Vec2};
use rayon::prelude::*;
use std::time::Instant;

/// Points that are enough for anything.
const MOST: u32 = 1 << 24;
/// A texel of which more is enclosed is left out.
const ENCLOSED: f64 = 0.02;

/// The truth at points of a scene, which does not depend on the lightmap that helped to find it.
pub struct Truth {
    drawn: Drawn<Known>,
    options: Options,
}

/// What was drawn, and the effort.
pub(super) struct Drawn<T> {
    pub kept: Vec<T>,
    /// Points left out because geometry encloses their texel.
    pub enclosed: usize,
    pub paths: u64,
    pub rays: u64,
}

impl<T> Default for Drawn<T> {
    fn default() -> Self {
        Drawn { kept: Vec::new(), enclosed: 0, paths: 0, rays: 0 }
    }
}

/// The truth at a texel.
pub(super) struct Known {
    texel: usize,
    /// Area that it stands for, 1 on average.
    weight: f64,
    dark: bool,
    border: bool,
    halves: [DVec3; 2],
    /// Its open places.
    spots: Vec<Spot>,
}

/// The truth at a place, twice.
struct Spot {
    triangle: u32,
    bary: Vec2,
    parts: [DVec3; PARTS],
}

impl Truth {
    /// Draws points on the layout of `subject`, more of them where its map changes. A map that is nearly right makes them
    /// certain sooner; its darker half is the darker half from now on.
    pub fn of(subject: &Subject, options: &Options, observer: &dyn Observer) -> Result<Self> {
        let mut drawn = Drawn::default();
        draw(&mut drawn, subject, options, observer, |known| known)?;
        Ok(Truth { drawn, options: *options })
    }

    /// Points that count.
    pub fn points(&self) -> usize {
        self.drawn.kept.len()
    }

    /// The mean errors and the bias of another map on the same layout.
    pub fn audit(&self, subject: &Subject) -> Audit {
        let Drawn { kept, enclosed, paths, rays } = &self.drawn;
        let kept = kept.par_iter().map(|known| known.point(subject)).collect();
        Audit::errors(&Drawn { kept, enclosed: *enclosed, paths: *paths, rays: *rays }, &self.options)
    }

    /// The error, at points of the surface, of a map on any layout of the scene: root mean square over the mean.
    pub fn look_ups(&self, coverage: &Coverage, lightmaps: &Lightmaps, reading: Reading) -> Option<Interval> {
        let read = |spot: &Spot| lightmaps.read(coverage, spot.triangle, spot.bary, reading);
        let point = |known: &Known| {
            let square = known.square(|spot| read(spot).as_dvec3());
            Point { weight: known.weight, truth: known.truth(), square, ..Point::default() }
        };
        let points: Vec<Point> = self.drawn.kept.par_iter().map(point).collect();
        figures::error(&points, self.options.level, self.options.seed)
    }
}

/// Draws points beside those of `out` until the budget of all ends (of time: that of this call), and keeps what is wanted of
/// each.
pub(super) fn draw<T: Send>(
    out: &mut Drawn<T>,
    subject: &Subject,
    options: &Options,
    observer: &dyn Observer,
    keep: impl Fn(Known) -> T + Sync,
) -> Result<()> {
    let start = Instant::now();
    let Some(texels) = Texels::new(subject) else { return Ok(()) };
    let lights = Lights::new(subject);
    let most = if let Budget::Points(n) = options.budget { n.min(MOST) } else { MOST };
    observer.begin("audit", if most < MOST { u64::from(most) } else { 0 });
    let mut drawn = (out.kept.len() + out.enclosed) as u32;
    while drawn < most && !options.budget.ends(start.elapsed(), out.rays, drawn) {
        let next = drawn..(drawn + ROUND).min(most);
        drawn = next.end;
        let looks: Vec<(Option<T>, u64)> = next
            .into_par_iter()
            .map_init(Bundle::default, |bundle, i| {
                let (known, rays) = look(subject, &lights, &texels, options, i, bundle);
                (known.map(&keep), rays)
            })
            .collect();
        progress::check(observer)?;
        observer.advance(looks.len() as u64);
        for (kept, rays) in looks {
            out.rays += rays;
            out.enclosed += usize::from(kept.is_none());
            out.kept.extend(kept);
        }
    }
    out.paths = u64::from(drawn) * 2 * u64::from(PLACES * options.paths_a_place());
    Ok(())
}

/// One point, none if its texel is enclosed; and the rays that it took.
fn look(
    subject: &Subject,
    lights: &Lights,
    texels: &Texels,
    options: &Options,
    i: u32,
    bundle: &mut Bundle,
) -> (Option<Known>, u64) {
    // Points spread evenly over the area, however many there are.
    let share = net(i, 0, hash(options.seed, 0x6175_6469)).x;
    let (texel, weight) = texels.at(f64::from(share));
    let halves = Halves::walk(subject, lights, texel, options, hash(hash(options.seed, 0x706f_696e), i), bundle);
    let known = (halves.enclosed() <= ENCLOSED).then(|| Known {
        texel,
        weight,
        dark: texels.is_dark(subject, texel),
        border: points::is_border(subject, texel),
        halves: halves.irradiance(),
        spots: halves.open.iter().flatten().map(Spot::of).collect(),
    });
    (known, halves.rays)
}

impl Known {
    /// What a map is worth here.
    pub fn point(&self, subject: &Subject) -> Point {
        let x = subject.value(self.texel).as_dvec3();
        let [a, b] = self.halves;
        let truth = self.truth();
        let difference = mean(x) - truth;
        Point {
            weight: self.weight,
            value: mean(x),
            truth,
            square: mean((x - a) * (x - b)),
            relative: [mean(x - a) * mean(x - b), difference * difference],
            dark: self.dark,
            border: self.border,
            ..Point::default()
        }
    }

    /// The same, and what look-ups at its places are worth.
    pub fn point_with_look_ups(&self, subject: &Subject) -> Point {
        let Subject { coverage, lightmaps, .. } = *subject;
        let own = self.square(|s| lightmaps.read(coverage, s.triangle, s.bary, Reading::Bilinear).as_dvec3());
        let halved = self.square(|s| lookup::halved(coverage, lightmaps, s.triangle, s.bary).as_dvec3());
        Point { lookups: [own, halved], ..self.point(subject) }
    }

    fn truth(&self) -> f64 {
        mean(self.halves[0] + self.halves[1]) * 0.5
    }

    /// Squared error of what is read at the places, on average.
    fn square(&self, read: impl Fn(&Spot) -> DVec3) -> f64 {
        let product = |spot: &Spot| {
            let (x, [a, b]) = (read(spot), spot.parts);
            mean((x - a) * (x - b))
        };
        self.spots.iter().map(product).sum::<f64>() / f64::max(self.spots.len() as f64, 1.0)
    }
}

impl Spot {
    fn of((place, parts): &(Place, [DVec3; PARTS])) -> Self {
        Spot { triangle: place.triangle, bary: place.bary, parts: *parts }
    }
}

//! The audit itself: its paths against closed forms and against another path tracer, its figures against errors that were
//! put in, its intervals against true errors.

mod figures;
mod paths;

#[path = "../common"]
#[allow(dead_code, reason = "nothing uses all of them")]
mod common {
    pub mod exact;
    pub mod npz;
    pub mod rooms;
    pub mod scenes;
    pub mod score;
    pub mod stage;
    pub mod true_error;
}

use common::stage::Stage;
use glam::{DVec3, UVec2, Vec3};
use luxel::{
    atlas::{self, Atlas, Coverage, Density, Unwrap},
    audit::{self, Audit, Budget, Options, Subject},
    lightmaps::{Content, Lightmaps, Map},
    progress::Silent,
    scene::{Scene, World},
    trace::Tracer,
};

/// A scene with a lightmap of zeros on its own charts.
struct Blank<'s> {
    tracer: Tracer<'s>,
    coverage: Coverage,
    lightmaps: Lightmaps,
    max_reflectance: f32,
}

impl<'s> Blank<'s> {
    fn new(scene: &'s Scene, edge: u32) -> Self {
        let options =
            atlas::Options { unwrap: Unwrap::Keep, density: Density::Resolution(edge), ..atlas::Options::default() };
        let laid: Atlas = atlas::unwrap(scene, &options, &scene.file, &Silent, &mut Vec::new()).expect("a layout");
        let world = World::new(scene);
        let coverage = Coverage::new(&world, &laid);
        let size = laid.pages[0].size;
        let covered: Vec<bool> = coverage.grids[0].iter().map(|t| *t != atlas::NO_TEXEL).collect();
        let page = Map { size, irradiance: vec![Vec3::ZERO; covered.len()], covered };
        let lightmaps = Lightmaps { pages: vec![page], content: Content::Full, ..Lightmaps::default() };
        Blank { tracer: Tracer::new(world), coverage, lightmaps, max_reflectance: 0.9999 }
    }

    fn subject(&self) -> Subject<'_, 's> {
        let Blank { tracer, coverage, lightmaps, max_reflectance } = self;
        Subject { tracer, coverage, lightmaps, max_reflectance: *max_reflectance }
    }

    /// The truth at all texels, by `paths` from each place.
    fn truth(&self, paths: u32) -> Vec<audit::Reference> {
        let texels: Vec<usize> = (0..self.coverage.texels.len()).collect();
        audit::reference(&self.subject(), &texels, &Options { paths, ..Options::default() })
    }

    /// Gives every texel a value.
    fn paint(&mut self, value: impl Fn(usize) -> Vec3) {
        let page = &mut self.lightmaps.pages[0];
        // Look-ups touch the gutters.
        page.irradiance.fill(value(0));
        for (i, t) in self.coverage.texels.iter().enumerate() {
            page.irradiance[(t.at.y * page.size.x + t.at.x) as usize] = value(i);
        }
    }

    fn audit(&self, points: u32, seed: u32) -> Audit {
        let options = Options { budget: Budget::Points(points), seed, ..Options::default() };
        Audit::of(&self.subject(), &options, &Silent).expect("an audit")
    }
}

/// Lays a stage out; the scene and the page's edge.
fn laid_out(mut stage: Stage) -> (Scene, u32) {
    let (edge, _) = stage.lay_out();
    (stage.scene, edge)
}

fn grey(v: DVec3) -> f64 {
    v.element_sum() / 3.0
}

/// Mean of both halves.
fn both(r: &audit::Reference) -> f64 {
    grey(r.halves[0] + r.halves[1]) * 0.5
}

fn texels(n: u32) -> UVec2 {
    UVec2::splat(n)
}

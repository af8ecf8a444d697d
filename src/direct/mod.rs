//! [`Direct`]: irradiance that arrives without a bounce, from lights, small emitters and the sky's peaks.
//!
//! Each source's unshadowed irradiance is known in closed form (or nearly); shadow rays measure the share that arrives.
//! Few probes settle the texels that see all of a source or nothing. Where they disagree, within the texel or with its
//! neighbours, more rays follow, which soft shadows share (`smooth`); most go to edges, which no fit explains. Sources that
//! rows see well enough (large emitters, smooth sky) are left to the rows: [`Sources`] decides, and each is counted once.
//! Patches that reflect much of this light are sources in their turn ([`Bounce`]).

mod bright;
mod disc;
mod emitters;
mod lambert;
mod measure;
mod parts;
mod punctual;
mod received;
mod sky;
mod smooth;
mod texel;
mod volley;

pub use parts::Parts;
pub use sky::sky_cells;

use crate::{
    atlas::Coverage,
    error::Result,
    patches::Patches,
    progress::Observer,
    scene::{Light, Scene},
    trace::Tracer,
};
use glam::Vec3;

/// Direct irradiance E of the open part of every patch, W/m^2, one map a light group.
#[derive(Clone, Debug, Default)]
pub struct Direct {
    /// Punctual lights baked in full.
    pub lights: Vec<Vec3>,
    /// Punctual lights of which only the bounces are baked.
    pub hidden_lights: Vec<Vec3>,
    /// Sampled emitters.
    pub emitters: Vec<Vec3>,
    /// Sampled peaks of the sky.
    pub sky_peaks: Vec<Vec3>,
    /// The part of what bright patches reflect that is sampled, too.
    pub bounce: Bounce,
    /// What of lamps, sun and peaks differs within a patch.
    pub parts: Parts,
    /// Shadow rays traced.
    pub shadow_rays: u64,
}

/// Light of the first bounce that is sampled, as that of emitters is, because few rays of a row would meet it.
#[derive(Clone, Debug, Default)]
pub struct Bounce {
    /// Exitance of each patch that is counted here, and that rows must not carry, W/m^2. Empty: none.
    pub exitance: Vec<Vec3>,
    /// Irradiance from there, at every patch. Empty: none.
    pub irradiance: Vec<Vec3>,
}

/// What shines, and by which way it is counted.
pub struct Sources<'s> {
    scene: &'s Scene,
    lights: &'s [Light],
    emitters: emitters::Emitters,
    peaks: Option<sky::Peaks>,
    /// Noise is judged against this luminance of irradiance at least.
    faint: f32,
    /// True if rows carry the exitance of surfaces; false if it is sampled here.
    pub gathered: bool,
}

impl<'s> Sources<'s> {
    /// Looks at all that emits. Surfaces are left to the rows where they make up much of what can be seen.
    pub fn new(tracer: &Tracer<'s>, patches: &Patches) -> Self {
        let scene = tracer.world.scene;
        let emits = |i: &usize| patches.exitance[*i] != Vec3::ZERO;
        let area = |i: usize| f64::from(patches.area[i]);
        let emitting: f64 = (0..patches.fronts).filter(emits).map(area).sum();
        let all: f64 = (0..patches.fronts).map(area).sum();
        let emitters = emitters::Emitters::new(&tracer.world);
        let least = if emitters.are_few() { GATHERED_SHARE } else { GATHERED_SHARE_OF_MANY };
        let gathered = emitting > least * all;
        let emitters = if gathered { emitters::Emitters::default() } else { emitters };
        Sources { scene, lights: &scene.lights, emitters, peaks: sky::Peaks::new(&scene.sky), faint: 0.0, gathered }
    }

    /// True if some of them are seen as points or small discs, along one ray from each place.
    fn are_punctual(&self) -> bool {
        !self.lights.is_empty() || self.peaks.is_some()
    }

    /// Shadow rays of `rays` that look for edges of shadows.
    fn probes(&self, rays: u32) -> u32 {
        probes(rays, self.emitters.is_empty() && self.peaks.is_none())
    }

    /// Patches that reflect much.
    fn reflecting(tracer: &Tracer<'s>, coverage: &Coverage, patches: &Patches, bright: &bright::Bright) -> Self {
        let emitters = emitters::Emitters::of_patches(&tracer.world, coverage, patches, &bright.exitance);
        Sources { scene: tracer.world.scene, lights: &[], emitters, peaks: None, faint: bright.mean, gathered: false }
    }
}

/// Emitters that cover more than this share of all area are seen by the rows: then a furnace has no noise at all.
const GATHERED_SHARE: f64 = 0.3;
/// The same for emitters of so many triangles that their closed forms would cost too much.
const GATHERED_SHARE_OF_MANY: f64 = 0.05;
/// Shadow rays over those that go to patches that reflect much, and how many do at least, if there are as many. Measured:
/// with more, errors of the rows hide what is gained.
const FEWER_TO_PATCHES: u32 = 4;
const LEAST_TO_PATCHES: u32 = 8;

/// What shadow rays have told so far, for more of them to join ([`Direct::refine`]).
#[derive(Default)]
pub struct Kept {
    known: measure::Known,
    /// The same of what bright patches reflect, which were chosen once: their exitance that is sampled.
    exitance: Vec<Vec3>,
    bounce: measure::Known,
}

impl Kept {
    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let exitance = self.exitance.capacity() * size_of::<Vec3>();
        self.known.bytes() + self.bounce.bytes() + exitance as u64
    }
}

impl Direct {
    /// Measures every patch. `rays` is the number of shadow rays a source where shadows are mixed, of edges four times
    /// that and, where they stay noisy, up to 64 times. Patches that reflect much get a quarter of them, at least 8.
    pub fn measure(
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &Patches,
        sources: &Sources,
        rays: u32,
        observer: &dyn Observer,
    ) -> Result<Self> {
        Self::refine(&mut Kept::default(), tracer, coverage, patches, sources, rays, observer)
    }

    /// The same, with the rays that are `kept` of a scene with the same sources, and fewer of them: only those that they lack are
    /// shot. Patches may have joined.
    pub fn refine(
        kept: &mut Kept,
        tracer: &Tracer,
        coverage: &Coverage,
        patches: &Patches,
        sources: &Sources,
        rays: u32,
        observer: &dyn Observer,
    ) -> Result<Self> {
        let mut direct = measure::measure(tracer, coverage, patches, sources, rays, &mut kept.known, observer)?;
        let exitance = std::mem::take(&mut kept.exitance);
        if let Some(bright) = bright::Bright::new(patches, &direct, exitance) {
            let sources = Sources::reflecting(tracer, coverage, patches, &bright);
            let fewer = (rays / FEWER_TO_PATCHES).max(LEAST_TO_PATCHES).min(rays);
            let received = measure::measure(tracer, coverage, patches, &sources, fewer, &mut kept.bounce, observer)?;
            direct.shadow_rays += received.shadow_rays;
            kept.exitance.clone_from(&bright.exitance);
            direct.bounce = Bounce { exitance: bright.exitance, irradiance: received.emitters };
        }
        Ok(direct)
    }

    /// Sum of all groups for a patch.
    pub fn total(&self, patch: usize) -> Vec3 {
        self.lights[patch] + self.hidden_lights[patch] + self.surroundings(patch)
    }

    /// What does not come from punctual lights.
    pub fn surroundings(&self, patch: usize) -> Vec3 {
        self.emitters[patch] + self.sky_peaks[patch]
    }
}

/// Few find edges of the shadows of lamps. What is sampled, emitters and the sky, is noise until there are more.
fn probes(rays: u32, of_lamps: bool) -> u32 {
    let least = if of_lamps { (rays / 4).clamp(2, 4) } else { 8 };
    (rays / 16).clamp(least, 64).min(rays.div_ceil(2))
}

#[cfg(test)]
mod tests {
    #[test]
    fn probes_are_few_of_the_shadow_rays() {
        let probes = |of_lamps| [1, 2, 8, 12, 16, 64, 128, 1 << 16].map(|rays| super::probes(rays, of_lamps));
        assert_eq!(probes(true), [1, 1, 2, 3, 4, 4, 8, 64]);
        assert_eq!(probes(false), [1, 1, 4, 6, 8, 8, 8, 64]);
    }
}

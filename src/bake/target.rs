//! A bake to a target: as much effort as the audit asks for.
//!
//! The first bake takes few rays. An audit looks at it with fresh points; if it cannot be sure that the error is below the
//! target, it says how many rays will do, by how errors fall with rays, and the bake adds those that it lacks. However often
//! it looks, the chance that it is ever satisfied wrongly stays that of one look: the n-th has 1/2^n of it. What is told in
//! the end is the figure of points that decided nothing.

use super::{Baked, Ground, Lit, Options, plan};
use crate::{
    audit::{self, Audit, Budget, Look, Subject},
    error::{Error, Result},
    memory,
    progress::Observer,
    report::{LookReport, TargetReport},
    scene::Scene,
    transport::{self, FormFactors},
};
use glam::Vec3;
use std::time::{Duration, Instant};

/// When a bake is good enough; whichever comes first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Root mean square error of texels over the mean, above 0.
    pub error: Option<f64>,
    /// Wall time. It is exceeded where the least effort takes longer.
    pub time: Option<Duration>,
    /// Rays a texel at most, 16..=1024; fewer where neighbours could not share them.
    pub most_rays: u32,
}

impl Default for Target {
    /// What nobody asked for: 2 %, but no more than 256 rays.
    fn default() -> Self {
        Target { error: Some(0.02), time: None, most_rays: 256 }
    }
}

impl Target {
    /// What somebody asked for.
    pub fn typed(error: Option<f64>, time: Option<Duration>) -> Self {
        Target { error, time, most_rays: 1024 }
    }
}

/// Errors by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// 10 %.
    Preview,
    /// 3 %.
    Medium,
    /// 1 %.
    High,
}

impl Quality {
    /// Everything there is to choose from.
    pub const ALL: [Quality; 3] = [Quality::Preview, Quality::Medium, Quality::High];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Quality::Preview => "preview",
            Quality::Medium => "medium",
            Quality::High => "high",
        }
    }

    /// Relative error.
    pub fn error(self) -> f64 {
        match self {
            Quality::Preview => 0.1,
            Quality::Medium => 0.03,
            Quality::High => 0.01,
        }
    }
}

/// Rays a texel to begin with: for errors that are seen, and for others.
const ROUGH: u32 = 8;
const FINE: u32 = 16;
/// Error that is seen.
const SEEN: f64 = 0.05;
/// Errors fall with about this power of the number of rays.
const POWER: f64 = 0.45;
/// More rays than this many times those before are not trusted to a guess.
const LEAP: u32 = 4;
/// Part of the target that a guess aims at: the audit must be sure.
const AIM: f64 = 0.8;
/// Rays of an audit: a share of the bake's, which take half the time, but not less than these: some three hundred points.
const SHARE: u64 = 12;
const LEAST: u64 = 1_500_000;
/// Paths from each place of an audit's points: more points rather than better ones.
const PATHS: u32 = 16;
/// Audits that a look may add up to, in rays, while the target lies within the interval.
const LOOK: u64 = 4;

/// Bakes `scene` until the target is reached, or cannot be: `options` but for the rays. [`Report::target`] says which.
///
/// Rows and direct light keep the rays that they have, and others join them. Adaptive receivers are not the same ones where
/// rays are more: there, all is measured anew.
///
/// [`Report::target`]: crate::report::Report::target
pub fn bake_to<'s>(scene: &'s Scene, options: &Options, target: &Target, observer: &dyn Observer) -> Result<Baked<'s>> {
    let start = Instant::now();
    if options.transport.form_factors != FormFactors::Rays {
        let name = options.transport.form_factors.name();
        return Err(Error::Usage(format!(
            "form factors by {name} have no effort that could grow to a target\n  use rays"
        )));
    }
    let first = if target.error.is_some_and(|e| e >= SEEN) { ROUGH } else { FINE };
    let mut effort = options.clone().with_rays(first);
    let mut ground = Ground { grows: true, ..Ground::new(scene, &effort, observer)? };
    let most = most_rays(ground.coverage.texels.len(), options, target.most_rays);
    let mut report = TargetReport { error: target.error, ..TargetReport::default() };
    let (mut before, mut kept) = (None, 0);
    let lit = loop {
        observer.attempt(effort.transport.rays);
        let began = Instant::now();
        let lit = ground.light(&effort, before.take(), observer)?;
        let spent = began.elapsed();
        let rays = effort.transport.rays;
        let next = match target.error {
            None => 2 * rays,
            Some(error) => {
                let look = look(&mut ground, &lit, &effort, report.looks.len(), error, observer)?;
                report.looks.push(look_report(&look, &effort));
                match look.error {
                    Some(found) if found.high > error => more_rays(rays, found.value / error),
                    found => {
                        // Nothing can be said of a scene without light, but that it is dark.
                        report.reached = found.is_some() || is_black(&lit);
                        break lit;
                    }
                }
            }
        };
        let next = next.min(most);
        // Audits take half as long again.
        let ahead = spent.mul_f64(1.5 * growth(kept, rays, next));
        if rays >= most || target.time.is_some_and(|time| start.elapsed() + ahead > time) {
            break lit;
        }
        let more = options.clone().with_rays(next);
        // Squares of adaptive receivers halve where rays grow fourfold, if not more.
        let receivers = (4 * lit.transport.receivers.len()).min(ground.coverage.texels.len());
        // Rows that are kept give way block by block, and leave holes that not all others fit into.
        let refines = lit.transport.can_refine(&more.transport);
        kept = if refines { rays } else { 0 };
        let held = if refines { lit.transport.rows.bytes() + lit.shadows.bytes() } else { 0 };
        let taken_mb = ground.taken_mb + (held >> 20);
        let rows = memory::fits(more.transport.bytes_of_rows(receivers) >> 20, plan::free_beside(taken_mb), "");
        match plan::announce(scene, &ground.atlas, &ground.coverage, &more, taken_mb, observer).and(rows) {
            Err(Error::Memory { .. }) => break lit,
            other => other?,
        }
        (effort, before) = (more, Some(lit));
    };
    let audit = final_audit(&mut ground, &lit, &effort, observer)?;
    let mut baked = ground.baked(lit, &effort);
    baked.report.target = Some(report);
    baked.audit = Some(audit);
    Ok(baked)
}

fn is_black(lit: &Lit) -> bool {
    lit.lightmaps.pages.iter().all(|page| page.irradiance.iter().all(|e| *e == Vec3::ZERO))
}

/// Time of the attempt after one that kept some of its rays, over that one's, at most: of what is kept the rays that are
/// shot count, of all else those that are used.
fn growth(kept: u32, rays: u32, next: u32) -> f64 {
    let shot = f64::from(next.saturating_sub(rays)) / f64::from(rays - kept);
    shot.max(f64::from(next) / f64::from(rays))
}

/// As many as neighbours can share, and `most`.
fn most_rays(texels: usize, options: &Options, most: u32) -> u32 {
    let shared = |rays: &u32| transport::Options { rays: *rays, ..options.transport }.shares(texels);
    let mut halved = std::iter::successors(Some(most), |rays| Some(rays / 2)).take_while(|rays| *rays >= FINE);
    if options.transport.reuse { halved.find(shared).unwrap_or(FINE) } else { most }
}

/// How many will do, for an error that is `excess` times the target.
fn more_rays(rays: u32, excess: f64) -> u32 {
    let factor = libm::pow(excess / AIM, 1.0 / POWER).clamp(2.0, f64::from(LEAP));
    rays * (factor.round() as u32).next_power_of_two()
}

/// Looks until the target lies outside of the interval, or long enough; the mean figures alone.
fn look(
    ground: &mut Ground,
    lit: &Lit,
    options: &Options,
    before: usize,
    error: f64,
    observer: &dyn Observer,
) -> Result<Audit> {
    // Resampling does not tell rarer cases from each other.
    let level = 1.0 - 0.05 / f64::from(2u32 << before.min(4)) / f64::from(LOOK.ilog2() + 1);
    let Ground { tracer, coverage, clock, .. } = ground;
    let subject = Subject { tracer, coverage, lightmaps: &lit.lightmaps, max_reflectance: options.max_reflectance };
    let options = audit::Options { seed: before as u32 + 1, level, paths: PATHS, ..audit::Options::default() };
    let (mut look, mut rays) = (Look::new(&options), rays_of_audit(lit));
    let most = LOOK * rays;
    clock.time("audit", || {
        loop {
            let found = look.until(rays, &subject, observer)?;
            let open = found.error.is_some_and(|e| e.value <= error && error < e.high);
            if !open || rays >= most {
                return Ok(found);
            }
            rays *= 2;
        }
    })
}

/// The figures of points that decided nothing.
fn final_audit(ground: &mut Ground, lit: &Lit, options: &Options, observer: &dyn Observer) -> Result<Audit> {
    let Ground { tracer, coverage, clock, .. } = ground;
    let subject = Subject { tracer, coverage, lightmaps: &lit.lightmaps, max_reflectance: options.max_reflectance };
    let options = audit::Options { budget: Budget::Rays(rays_of_audit(lit)), paths: PATHS, seed: 0, level: 0.95 };
    clock.time("audit", || Audit::of(&subject, &options, observer))
}

fn rays_of_audit(lit: &Lit) -> u64 {
    LEAST.max((lit.transport.stats.traced + lit.added.traced + lit.direct.shadow_rays) / SHARE)
}

fn look_report(look: &Audit, options: &Options) -> LookReport {
    let (rays, shadow_rays, points, seconds) = (options.transport.rays, options.shadow_rays, look.points, look.seconds);
    let [error, low, high] = [look.error.map(|e| e.value), look.error.map(|e| e.low), look.error.map(|e| e.high)];
    LookReport { rays, shadow_rays, error, low, high, level: look.level, points, seconds }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guesses_grow_with_the_excess_and_stay_near() {
        assert_eq!(more_rays(16, 0.9), 32);
        assert_eq!([1.1, 1.27, 1.5].map(|excess| more_rays(16, excess)), [32, 64, 64]);
        assert_eq!(more_rays(16, 1000.0), 16 * LEAP);
    }

    #[test]
    fn time_grows_with_the_rays_that_are_shot_or_used() {
        assert_eq!(
            [growth(0, 16, 32), growth(16, 32, 64), growth(16, 32, 128), growth(16, 64, 128)],
            [2.0, 2.0, 6.0, 2.0]
        );
    }

    #[test]
    fn rays_end_where_neighbours_cannot_share_them() {
        let options = Options::default();
        assert_eq!([1000, 1 << 19, 1 << 24].map(|texels| most_rays(texels, &options, 1024)), [1024, 512, 64]);
        assert_eq!(most_rays(1000, &options, 64), 64);
    }
}

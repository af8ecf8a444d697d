//! Bounces between [`Groups`] of texels.

use super::{Radiosity, Solver, System, solve::single};
use crate::{
    error::Result,
    math::luminance,
    progress::{Observer, check},
    transport::{Groups, Transport},
};
use glam::{DVec3, DVec4, Vec3};
use rayon::prelude::*;
use std::time::Instant;

/// Variance of rows of so many rays, whose directions are a net, over that of random ones. Measured: with twice as much,
/// contacts blur from 16 rays on; with half, 8 rays err more.
pub(super) fn net(rays: f32) -> f32 {
    f32::min(0.5, 4.0 / rays)
}

/// What a group has on average.
struct Mean {
    emission: Vec3,
    reflectance: Vec3,
    area: f64,
    extra: Vec3,
    direct: Vec3,
}

impl System<'_> {
    /// Follows bounces between groups, and gathers twice at every patch: once would leave groups in the light at contacts.
    pub(super) fn solve_between(
        &self,
        groups: &Groups,
        solver: Solver,
        tolerance: f64,
        observer: &dyn Observer,
    ) -> Result<Radiosity> {
        let start = Instant::now();
        let rows = groups.rows(self.transport);
        let solved = self.grouped(groups, &rows).solve(solver, tolerance, observer)?;
        let at_groups: Vec<DVec3> = solved.indirect.iter().map(|e| e.as_dvec3()).collect();
        let x = self.gathered_by(groups, &groups.spread(&at_groups));
        let mut mapped = x.clone();
        let mut report = solved.report;
        // Rows of groups were copied, and each patch has gathered.
        report.entries += 2 * self.entries();
        check(observer)?;
        report.entries += self.map(&x, &mut mapped);
        report.seconds = start.elapsed().as_secs_f64();
        Ok(Radiosity { indirect: self.at_patches(&mapped), gathered: single(&self.radiosity(&x)), report })
    }

    /// The map of `x`, where patches that differ from their group by no more than noise have its mean: few rays of each are
    /// much noise, of which whoever sees them has a part (shrinkage: James and Stein, 1961).
    fn gathered_by(&self, groups: &Groups, x: &[DVec3]) -> Vec<DVec3> {
        let told: Vec<DVec4> = self.radiosity(x).par_iter().map(|b| b.extend(light(*b).powi(2))).collect();
        let mut gathered = vec![DVec4::ZERO; x.len()];
        self.transport.rows.map_into(&mut gathered, |row| row.sum(|c| told[c as usize]));
        let drawn = |group: usize| {
            let members = groups.members(group);
            let weight = |&p: &u32| f64::from(self.transport.rows.row(p as usize).weight);
            let weight = members.iter().map(weight).sum::<f64>() / members.len() as f64;
            drawn_to_mean(&members.iter().map(|&p| gathered[p as usize]).collect::<Vec<_>>(), weight)
        };
        let drawn: Vec<Vec<DVec3>> = (0..groups.len()).into_par_iter().map(drawn).collect();
        let mut x = vec![DVec3::ZERO; x.len()];
        for (group, drawn) in drawn.into_iter().enumerate() {
            groups.members(group).iter().zip(drawn).for_each(|(&p, e)| x[p as usize] = e);
        }
        x.par_iter_mut().zip(&self.extra).for_each(|(e, extra)| *e += extra.as_dvec3());
        x
    }

    /// The same light between groups of patches, over `rows` between them.
    pub(super) fn grouped<'g>(&self, groups: &Groups, rows: &'g Transport) -> System<'g> {
        let means: Vec<Mean> =
            (0..groups.len()).into_par_iter().map(|group| self.mean(groups.members(group))).collect();
        let sky = &self.emission[self.reflectance.len()..];
        System {
            transport: rows,
            emission: means.iter().map(|m| m.emission).chain(sky.iter().copied()).collect(),
            reflectance: means.iter().map(|m| m.reflectance).collect(),
            area: means.iter().map(|m| m.area).collect(),
            sampled: &[],
            extra: means.iter().map(|m| m.extra).collect(),
            direct: means.iter().map(|m| m.direct).collect(),
        }
    }

    fn mean(&self, patches: &[u32]) -> Mean {
        let area: f64 = patches.iter().map(|&p| self.area[p as usize]).sum();
        let weight = |p: usize| if area > 0.0 { self.area[p] / area } else { 1.0 / patches.len() as f64 };
        let mean = |value: &dyn Fn(usize) -> Vec3| {
            patches.iter().map(|&p| value(p as usize).as_dvec3() * weight(p as usize)).sum::<DVec3>().as_vec3()
        };
        let at = |values: &[Vec3], p: usize| values.get(p).copied().unwrap_or_default();
        let reflectance = mean(&|p| self.reflectance[p]);
        // So that the mean of what they reflect of it is right, however shadows lie on a pattern.
        let reflected = mean(&|p| self.reflectance[p] * self.direct[p]);
        let some = reflectance.cmpgt(Vec3::ZERO);
        Mean {
            emission: mean(&|p| self.emission[p] - at(self.sampled, p)),
            reflectance,
            area,
            extra: mean(&|p| at(&self.extra, p)),
            direct: Vec3::select(some, reflected / reflectance, mean(&|p| self.direct[p])),
        }
    }
}

fn light(radiosity: DVec3) -> f64 {
    f64::from(luminance(radiosity.as_vec3()))
}

/// What patches have gathered, each drawn to the mean of all by the share of its variance that is noise; `gathered` has the mean
/// square of the rays' light, too, of which each weighs so much.
fn drawn_to_mean(gathered: &[DVec4], weight: f64) -> Vec<DVec3> {
    let mean = gathered.iter().sum::<DVec4>() / gathered.len() as f64;
    let of_rays = (mean.w - light(mean.truncate()).powi(2)).max(0.0);
    let noise = of_rays * weight * f64::from(net(1.0 / weight as f32));
    let squares = gathered.iter().map(|g| (light(g.truncate()) - light(mean.truncate())).powi(2));
    let variance = squares.sum::<f64>() / (gathered.len() as f64 - 1.0).max(1.0);
    let own = if variance > 0.0 { (1.0 - noise / variance).max(0.0) } else { 0.0 };
    gathered.iter().map(|g| mean.truncate().lerp(g.truncate(), own)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half of the rays of all meet a light of 2; of some patches none does, or every one.
    #[test]
    fn noise_is_drawn_to_the_mean_and_contacts_are_not() {
        let patch = |light: f64| DVec3::splat(light).extend(2.0 * light);
        let noisy: Vec<DVec4> = (0..16).map(|k| patch(1.0 + 0.1 * f64::from(k % 3 - 1))).collect();
        let drawn = drawn_to_mean(&noisy, 1.0 / 16.0);
        assert!(drawn.iter().all(|e| e.abs_diff_eq(drawn[0], 1e-12)) && (drawn[0].x - 1.0).abs() < 0.01, "{drawn:?}");
        let contact: Vec<DVec4> = (0..16).map(|k| patch(f64::from(k % 4) * 2.0 / 3.0)).collect();
        let drawn = drawn_to_mean(&contact, 1.0 / 16.0);
        assert!(drawn[0].x < 0.05 && drawn[3].x > 1.95, "{drawn:?}");
        // More rays of their own leave less to doubt.
        assert!(drawn_to_mean(&contact, 1.0 / 64.0)[0].x < drawn[0].x);
        assert_eq!(drawn_to_mean(&[patch(0.7)], 1.0), [DVec3::splat(0.7)]);
    }
}

//! Bounces between [`Groups`] of texels.

use super::{Radiosity, Solver, System, solve::single};
use crate::{
    error::Result,
    progress::{Observer, check},
    transport::{Groups, Transport},
};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::time::Instant;

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
        let mut x = groups.spread(&at_groups);
        let mut mapped = x.clone();
        let mut report = solved.report;
        // Rows of groups were copied.
        report.entries += self.entries() + self.map(&x, &mut mapped);
        std::mem::swap(&mut x, &mut mapped);
        check(observer)?;
        report.entries += self.map(&x, &mut mapped);
        report.seconds = start.elapsed().as_secs_f64();
        Ok(Radiosity { indirect: self.at_patches(&mapped), gathered: single(&self.radiosity(&x)), report })
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

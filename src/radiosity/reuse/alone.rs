//! Texels that share with too few, in narrow channels, on small charts, behind thin walls: they are given more rays of their
//! own.

use super::Gather;
use crate::{
    error::Result,
    progress::Observer,
    transport::{DARK, Row, Stats, sample},
};
use glam::{DVec3, Vec3};

/// Rays that such a texel has in the end, of each that its row has.
const TIMES: u32 = 4;

impl Gather<'_> {
    /// Asks receivers again whose `irradiance` is what their rows say; what the rays were.
    pub(super) fn add_rays(&self, alone: &[u32], irradiance: &mut [Vec3], observer: &dyn Observer) -> Result<Stats> {
        if alone.is_empty() {
            return Ok(Stats::default());
        }
        let rays = self.neighbours.transport.rays;
        let more = rays..rays.saturating_mul(TIMES);
        let share = more.len() as f32 / more.end as f32;
        let (told, stats) = sample(&self.neighbours, alone, more, |row| self.told(row), observer)?;
        for (&r, told) in alone.iter().zip(told) {
            let e = &mut irradiance[r as usize];
            *e = told.map_or(*e, |told| e.lerp(told, share));
        }
        Ok(stats)
    }

    /// What the rays of a row carry, but for those that met backs of which nothing is known; `None` if all did.
    fn told(&self, row: Row) -> Option<Vec3> {
        let radiosity = |column| self.columns.get(column as usize).map_or(DVec3::ZERO, |c| c.radiosity.as_dvec3());
        let known = 1.0 - row.sum(|column| if column == DARK { 1.0 } else { 0.0 });
        (known > 0.0).then(|| (row.sum(radiosity) / known).as_vec3())
    }
}

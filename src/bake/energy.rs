//! The balance of power: what is put in, absorbed, and lost to the outside.

use crate::{direct::Direct, patches::Patches, radiosity::Radiosity, report::EnergyReport, transport::Transport};
use glam::{DVec4, Vec3};

/// Sums over patches. Exact for face normals up to the noise of the rows; light that smooth shading adds or drops at
/// the receiver shows as imbalance.
pub(super) fn balance(
    patches: &Patches,
    transport: &Transport,
    direct: &Direct,
    sky: &[Vec3],
    radiosity: &Radiosity,
) -> EnergyReport {
    let power = |v: Vec3, area: f32| f64::from(v.element_sum()) * f64::from(area);
    let mut at_receivers = vec![DVec4::ZERO; transport.receivers.len()];
    transport.rows.map_into(&mut at_receivers, |row| {
        let [hits, cells] = row.split(transport.patches as u32);
        let from_sky = cells.sum(|c| sky[c as usize - transport.patches].as_dvec3()).as_vec3();
        // What meets no patch is gone: to the sky, or onto a back that nothing leaves.
        let gone = (1.0 - hits.sum(|_| 1.0) as f32).max(0.0);
        from_sky.extend(gone).as_dvec4()
    });
    let mut at_patches = vec![DVec4::ZERO; patches.len()];
    transport.interpolate(&at_receivers, &mut at_patches);
    let mut e = EnergyReport::default();
    for (p, at_patch) in at_patches.into_iter().enumerate() {
        let (from_sky, gone) = (at_patch.truncate().as_vec3(), at_patch.w as f32);
        // Enclosed surface neither gives nor takes.
        let area = patches.area[p] * patches.validity[p];
        let irradiance = direct.total(p) + radiosity.indirect[p];
        let reflected = patches.reflectance[p] * irradiance;
        let put_in = patches.exitance[p] + direct.lights[p] + direct.hidden_lights[p] + direct.sky_peaks[p] + from_sky;
        e.emitted += power(put_in, area);
        e.absorbed += power(irradiance - reflected, area);
        e.escaped += power((patches.exitance[p] + reflected) * gone, area);
    }
    e.imbalance = if e.emitted > 0.0 { (e.absorbed + e.escaped) / e.emitted - 1.0 } else { 0.0 };
    e
}

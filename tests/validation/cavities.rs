//! Bowls and wedges under the sky or the sun: the scattered light is the same everywhere. The sky's
//! outline is no longer than a great circle; that of a bowl's opening, which covers 1 - f of the projected hemisphere, than
//! twice that of a disc that does.

use crate::common::{
    bakes::{grey, options, spread},
    scenes::{Ball, rectangle},
    stage::{Chart, Stage},
};
use crate::{Case, Check, Outcome};
use glam::{DVec3, UVec2, Vec3, uvec2, vec3};
use luxel::{
    lightmaps::Content,
    scene::{LightKind, Sky},
};
use std::f32::consts::PI;
use std::f64::consts::TAU;

/// Uniform sky of radiance 1 through the opening.
///
/// The facets share the sphere's kernel only up to h^2: one texel may be off by facet^2 / 2 of H. The mean belongs to
/// the facets' own f' = 1 - opening / area, exactly, since all that leaves the opening comes from them.
pub fn sphere_cavity_sky(case: &Case) -> Outcome {
    let (f, rho) = (case.input("f")?, case.input("rho")?);
    let rays = 2048;
    let bowl = Ball::bowl(f, uvec2(case.facets(64), case.facets(32)), 1);
    let mut stage = Stage::new();
    stage.scene.sky = Sky::Uniform(Vec3::ONE);
    let material = stage.material(rho as f32, 0.0);
    let chart = bowl.build(&mut stage, material);
    let own = 1.0 - bowl.opening() / stage.area(chart);
    let shot = case.shoot(stage, rays)?;
    let h: Vec<f64> = shot.values(chart).iter().map(|e| grey(*e / PI)).collect();
    let (area_mean, _) = (shot.mean(&[chart]).1.x / f64::from(PI), 0);
    let law = |f: f64| (1.0 - f) / (1.0 - rho * f);
    // A row sees the opening with share 1 - f, which is worth 1 - rho H; the mean's errors are scattered on.
    let texel = (1.0 - rho * law(f)) * case.share(f, rays, TAU.min(2.0 * TAU * libm::sqrt(1.0 - f)));
    let sigma = texel / libm::sqrt(h.len() as f64) / (1.0 - rho * f);
    let shape = (law(own) - law(f)).abs();
    let expected = case.expects("H_over_piL")?;
    let pointwise = bowl.facet() * bowl.facet() / 2.0 * expected;
    let errors: Vec<f64> = h.iter().map(|h| (h - expected) / (texel + pointwise)).collect();
    let (mean, sd) = spread(&h);
    Ok(vec![
        case.check("H_over_piL", area_mean, sigma, shape)?,
        case.check("B_over_piL", rho * area_mean, rho * sigma, rho * shape)?,
        Check::many(&format!("H by texel, mean {mean:.5}, sd {sd:.5}"), &errors),
    ])
}

/// Sun on a bowl; the scattered light alone (everything that is not the sun's first hit).
///
/// Facets as above; sigma is read from the texels and scattered on.
pub fn crater_sun(case: &Case) -> Outcome {
    let f = 1.0 / (1.0 + (case.input("diameter_to_depth")? / 2.0) * (case.input("diameter_to_depth")? / 2.0));
    let (rho, elevation) = (case.input("rho")?, case.input("sun_elevation_deg")?.to_radians());
    let bowl = Ball::bowl(f, uvec2(case.facets(96), case.facets(24)), 1);
    let mut stage = Stage::new();
    let material = stage.material(rho as f32, 0.0);
    let sun = vec3(libm::cos(elevation) as f32, -libm::sin(elevation) as f32, 0.0);
    let strength = case.input("sun_normal_irradiance")? as f32;
    stage.light(LightKind::Directional { angle: 0.0 }, Vec3::ZERO, sun, strength);
    let chart = bowl.build(&mut stage, material);
    let own = 1.0 - bowl.opening() / stage.area(chart);
    let shot = case.shoot_with(stage, luxel::bake::Options { content: Content::Indirect, ..options(1024) })?;
    let h: Vec<f64> = shot.mapped(chart).iter().map(|e| grey(*e)).collect();
    let areas: Vec<f64> = shot.texels(chart).iter().map(|i| f64::from(shot.baked.patches.area[*i])).collect();
    let mean = h.iter().zip(&areas).map(|(h, a)| h * a).sum::<f64>() / areas.iter().sum::<f64>();
    let law = |f: f64| f * rho * f64::from(strength) * libm::sin(elevation) * (1.0 - f) / (1.0 - rho * f);
    let key = "H_scattered_everywhere_incl_shadow";
    let expected = case.expects(key)?;
    // The sources are the sunlit texels: a row sees them with a share between 0 and f, each worth at most rho S.
    // Between them and the rest run the rim and the shadow's border.
    let texel = rho * f64::from(strength) * case.share(f, 1024, 2.0 * TAU) / 2.0;
    let pointwise = bowl.facet() * bowl.facet() / 2.0 * expected;
    let errors: Vec<f64> = h.iter().map(|h| (h - expected) / (texel + pointwise)).collect();
    let sigma = texel / libm::sqrt(h.len() as f64) / (1.0 - rho * f);
    let (plain, sd) = spread(&h);
    Ok(vec![
        case.check("f", bowl_share(&bowl), 0.0, 1e-9)?,
        case.check(key, mean, sigma, (law(own) - law(f)).abs())?,
        Check::many(&format!("H by texel, mean {plain:.6}, sd {sd:.6}"), &errors),
    ])
}

/// Share of the sphere that a bowl keeps.
fn bowl_share(bowl: &Ball) -> f64 {
    (1.0 + libm::cos(bowl.polar[0])) / 2.0
}

/// Two planes of 1000 x 2000 m, in rectangles that grow away from the middle of the edge; read in the first metre.
///
/// What lies beyond 1000 m is sky instead of plane: at x metres from the edge that is less than x / 2000 of the view.
pub fn infinite_wedge_sky(case: &Case) -> Outcome {
    let (angle, rho) = (case.input("interior_angle_deg")?.to_radians(), case.input("rho")?);
    let mut stage = Stage::new();
    stage.scene.sky = Sky::Uniform(Vec3::ONE);
    let material = stage.material(rho as f32, 0.0);
    let across = [0.0, 1.0, 10.0, 100.0, 1000.0];
    let along = [-1000.0, -100.0, -10.0, -1.0, 1.0, 10.0, 100.0, 1000.0];
    let mut read: Vec<Chart> = Vec::new();
    let up = DVec3::new(libm::cos(angle), 0.0, libm::sin(angle));
    for (wall, away) in [(false, DVec3::X), (true, up)] {
        for x in across.windows(2) {
            for y in along.windows(2) {
                let o = (away * x[0] + DVec3::Y * y[0]).as_vec3();
                let (s, t) = ((away * (x[1] - x[0])).as_vec3(), vec3(0.0, (y[1] - y[0]) as f32, 0.0));
                let (s, t) = if wall { (t, s) } else { (s, t) };
                let near = x[0] == 0.0 && y[0] == -1.0;
                let n = case.facets(if near { 24 } else { 8 });
                let chart = rectangle(&mut stage, material, [o, s, t], UVec2::splat(n));
                read.extend(near.then_some(chart));
            }
        }
    }
    let shot = case.shoot(stage, 2048)?;
    let texels: Vec<f64> = read.iter().flat_map(|c| shot.values(*c)).map(|e| grey(e / PI)).collect();
    let expected = case.expects("H_over_piL")?;
    let f = (1.0 + libm::cos(angle)) / 2.0;
    let texel = (1.0 - rho * expected) * case.share(f, 2048, TAU);
    let sigma = texel / libm::sqrt(texels.len() as f64) / (1.0 - rho * f);
    let errors: Vec<f64> = texels.iter().map(|h| (h - expected) / (texel + 1e-3 * expected)).collect();
    let (mean, sd) = spread(&texels);
    Ok(vec![
        case.check("H_over_piL", mean, sigma, 1e-3 * expected)?,
        Check::many(&format!("H by texel, sd {sd:.5}"), &errors),
    ])
}

//! Closed rooms through a bake: furnaces, one emitter, a point light, an office.

use crate::common::{
    bakes::{Shot, grey, options, spread},
    exact,
    scenes::{Ball, Cuboid, FACES, Face, cuts_about, furnished, texels, unit_room},
    stage::{Chart, Stage},
    ways::Way,
};
use crate::{Case, Check, Outcome, Problem, numbers};
use glam::{DVec3, Vec2, Vec3, dvec3, uvec2, vec3};
use luxel::{error::Error, lightmaps::Content, scene::LightKind};

/// B at every texel of several closed scenes; rows of ray counts sum to 1, so there is no noise: 1e-3 is for single
/// precision and the solver's stopping.
pub fn furnace(case: &Case) -> Outcome {
    let (rho, m) = (case.input("rho")?, case.input("M")?);
    let ball = |smooth| Ball { smooth, ..Ball::whole(Vec3::ZERO, 1.0, uvec2(case.along(24), case.along(12)), true) };
    type Build<'a> = &'a dyn Fn(&mut Stage, u32) -> Vec<Chart>;
    let scenes: [(&str, Build); 4] = [
        ("cube", &|s, m| unit_room().all(s, m, case.along(8))),
        ("ball", &|s, m| vec![ball(false).build(s, m)]),
        ("smooth ball", &|s, m| vec![ball(true).build(s, m)]),
        ("blocks in a room", &|s, m| furnished(s, m, m, case.along(8))),
    ];
    let mut checks = Vec::new();
    for (name, build) in scenes {
        let mut stage = Stage::new();
        let material = stage.material(rho as f32, m as f32);
        build(&mut stage, material);
        let shot = match case.shoot(stage, 64) {
            // Closed forms take no smooth normals, direct no thousands of texels.
            Err(Problem::Refused(Error::Usage(_))) if case.way() != Way::default() && !checks.is_empty() => continue,
            shot => shot?,
        };
        let b = shot.baked.irradiance.iter().map(|e| m + rho * grey(*e));
        let expected = case.expects("")?;
        let off = |b: &f64| if b.is_nan() { f64::INFINITY } else { (b - expected).abs() };
        let got = b.max_by(|a, b| off(a).total_cmp(&off(b))).ok_or("a furnace has texels")?;
        checks.push(Check {
            what: format!("worst of {name}"),
            shape: 1e-3 * expected,
            ..case.check("", got, 0.0, 0.0)?
        });
    }
    Ok(checks)
}

/// Area mean over the texels of `charts` whose centres lie within `half` of `p`, and its standard error by spread.
/// Neighbours share 16 blocks of sample points, which is all the independence that texels at one place can claim.
fn around(shot: &Shot, charts: &[Chart], p: Vec3, half: f32, of: impl Fn(usize) -> f64) -> (f64, f64) {
    let near = |i: &usize| (shot.baked.patches.center[*i] - p).abs().max_element() <= half;
    let values: Vec<f64> = charts.iter().flat_map(|c| shot.texels(*c)).filter(near).map(of).collect();
    let (mean, sd) = spread(&values);
    (mean, sd / libm::sqrt(values.len().min(16) as f64))
}

/// Cube of `side` with each face cut about its centre (`half`), in charts of `density`; all charts of each face.
fn cut_cube(
    stage: &mut Stage,
    side: f32,
    half: f32,
    density: u32,
    least: u32,
    of: impl Fn(Face) -> u32,
) -> Vec<Vec<Chart>> {
    let cube = Cuboid::room(Vec3::ZERO, Vec3::splat(side));
    let cuts = cuts_about(0.0, side, &[side / 2.0], half);
    let size = |i: usize| cuts[i + 1] - cuts[i];
    let face = |f: &Face| {
        let cell = |i: usize, j: usize| Some((of(*f), texels(Vec2::new(size(i), size(j)), density as f32, least)));
        cube.cut(stage, *f, &cuts, &cuts, cell).into_iter().flatten().flatten().collect()
    };
    FACES.iter().map(face).collect()
}

/// Standard error of the mean over charts, each with its own noise, scattered on by 1 / (1 - rho).
fn error_of_mean(shot: &Shot, charts: &[Chart], rho: f64) -> f64 {
    let (area, _) = shot.mean(charts);
    let part = |c: &Chart| {
        let share = shot.mean(&[*c]).0 / area;
        let e = share * shot.error_of_mean(*c);
        e * e
    };
    libm::sqrt(charts.iter().map(part).sum()) / (1.0 - rho)
}

/// Centres are squares of side .04. Lumping whole faces (h = 1) moves means by .009, so texels of 1/n by h^2 of that.
pub fn cube_one_emitter(case: &Case) -> Outcome {
    let (rho, rho_top) = (case.input("rho_others")?, case.input("rho_top")?);
    let side = case.input("cube")? as f32;
    let n = case.along(24);
    let mut stage = Stage::new();
    let (top, other) = (stage.material(rho_top as f32, case.input("E_top")? as f32), stage.material(rho as f32, 0.0));
    let faces = cut_cube(&mut stage, side, 0.02, n, case.along(8).max(3), |f| if f == Face::Top { top } else { other });
    let shot = case.shoot(stage, 1024)?;
    let h = |i: usize| grey(shot.baked.irradiance[i]);
    let sides = [&faces[0][..], &faces[1], &faces[4], &faces[5]].concat();
    let shape = |key: &str| Ok::<f64, String>(0.009 / f64::from(n * n) + case.one_point(case.expects(key)?, n));
    let mut checks = Vec::new();
    for (key, charts) in [("mean_H_bottom", &faces[2]), ("mean_H_side", &sides), ("mean_H_top", &faces[3])] {
        checks.push(case.check(key, shot.mean(charts).1.x, error_of_mean(&shot, charts, rho), shape(key)?)?);
    }
    let half = side / 2.0;
    let (bottom, sigma) = around(&shot, &faces[2], vec3(half, 0.0, half), 0.02, h);
    checks.push(case.check("H_bottom_centre", bottom, sigma, shape("H_bottom_centre")?)?);
    let middles = [vec3(0.0, half, half), vec3(side, half, half), vec3(half, half, 0.0), vec3(half, half, side)];
    let at = middles.map(|p| around(&shot, &sides, p, 0.02, h));
    let sigma = libm::sqrt(at.iter().map(|a| a.1 * a.1).sum()) / 4.0;
    let side = at.iter().map(|a| a.0).sum::<f64>() / 4.0;
    checks.push(case.check("H_side_centre", side, sigma, shape("H_side_centre")?)?);
    Ok(checks)
}

/// Direct light at a texel may be its value at one point: what the midpoint rule costs is integrated here. The solver
/// may stop where the report's bound says. Centres are squares of side .1; texels of 1/6 m (1/12 m) move the indirect
/// centre by .1 (.025) of 112: h^2. Direct light of a texel of the square is that of few points, good to 1e-4.
pub fn point_light_in_cube(case: &Case) -> Outcome {
    let rho = case.input("rho_all")?;
    let (side, half) = (4.0, 0.05);
    let candela = 10_000.0 / (4.0 * std::f64::consts::PI);
    let mut stage = Stage::new();
    let material = stage.material(rho as f32, 0.0);
    stage.light(LightKind::Point { radius: 0.0 }, Vec3::splat(2.0), Vec3::ZERO, candela as f32);
    let density = case.along(12);
    let faces = cut_cube(&mut stage, side, half, density, case.along(8).max(3), |_| material);
    let shot = case.shoot_with(stage, luxel::bake::Options { content: Content::Indirect, ..options(1024) })?;
    let all = faces.concat();
    let (area, total) = shot.mean(&all);
    let mut indirect = vec![0.0; shot.baked.irradiance.len()];
    for c in &all {
        for (i, e) in shot.texels(*c).into_iter().zip(shot.mapped(*c)) {
            indirect[i] = grey(e);
        }
    }
    let mean_indirect = all
        .iter()
        .flat_map(|c| shot.texels(*c))
        .map(|i| indirect[i] * f64::from(shot.baked.patches.area[i]))
        .sum::<f64>()
        / area;
    let law = |p: DVec3| candela * 2.0 / libm::pow(p.length(), 3.0);
    let face = [dvec3(-2.0, -2.0, 2.0), DVec3::X * 4.0, DVec3::Y * 4.0];
    let midpoint = (exact::mean_over(face, 4 * density as usize, law) - 10_000.0 / 96.0).abs() / (1.0 - rho);
    let solver = shot.baked.report.solver.bound.unwrap_or(0.0);
    let sigma = error_of_mean(&shot, &all, rho);
    let tolerance = |key: &str| case.tolerance(key, 0.0);
    let check = |key: &str, tolerance: f64, got: f64, sigma: f64, shape: f64| -> Result<Check, String> {
        let expected = case.expects(key)?;
        let shape = shape + case.one_point(expected, 4 * density);
        Ok(Check { what: key.into(), got, expected, tolerance, sigma, shape })
    };
    let cell = [dvec3(-0.05, -0.05, 2.0), DVec3::X * 0.1, DVec3::Y * 0.1];
    // The square's mean is lower than its centre by this much.
    let flat = (exact::mean_over(cell, 16, law) - law(DVec3::Z * 2.0)).abs();
    let middles = [vec3(0.0, 2.0, 2.0), vec3(4.0, 2.0, 2.0), vec3(2.0, 0.0, 2.0), vec3(2.0, 4.0, 2.0)];
    let at = middles.map(|p| around(&shot, &all, p, half, |i| indirect[i]));
    let direct = middles.map(|p| around(&shot, &all, p, half, |i| grey(shot.baked.irradiance[i]) - indirect[i]));
    let mean = |a: &[(f64, f64)]| a.iter().map(|a| a.0).sum::<f64>() / 4.0;
    let centre_sigma = libm::sqrt(at.iter().map(|a| a.1 * a.1).sum()) / 4.0;
    let coarse = 0.025 / 112.0 * (12.0 / f64::from(density)).powi(2);
    Ok(vec![
        check("mean_E_total", tolerance("means")?, total.x, sigma, midpoint + solver)?,
        check("mean_E_indirect", tolerance("means")?, mean_indirect, sigma, midpoint + solver)?,
        check("E_direct_face_centre", tolerance("means")?, mean(&direct) + flat, 0.0, 1e-4 * candela)?,
        check("E_indirect_face_centre", tolerance("centre")?, mean(&at), centre_sigma, coarse * mean(&at) + solver)?,
    ])
}

/// A furnished room, half of it dark. One row's noise reaches the balance with its own area and nothing else, so
/// sigma is the areas' root sum of squares times the texels' noise.
pub fn energy_balance(case: &Case) -> Outcome {
    let tolerance = case.tolerance("", 1.0)?;
    let mut stage = Stage::new();
    let (wall, block) = (stage.material(0.7, 0.0), stage.material(0.4, 1.0));
    let n = case.along(32);
    let charts = furnished(&mut stage, wall, block, n);
    let shot = case.shoot(stage, 256)?;
    let [absorbed, emitted] = shot.power();
    let part = |c: &Chart| {
        let noise = shot.noise(*c).x;
        shot.texels(*c).iter().map(|i| noise * f64::from(shot.baked.patches.area[*i])).map(|e| e * e).sum::<f64>()
    };
    let sigma = libm::sqrt(charts.iter().map(part).sum()) / emitted;
    let energy = &shot.baked.report.energy;
    let check = |what: &str, got: f64, expected: f64, sigma: f64, shape: f64| Check {
        what: what.into(),
        got,
        expected,
        tolerance,
        sigma,
        shape,
    };
    let mut checks = vec![check("absorbed / emitted", absorbed / emitted, 1.0, sigma, case.one_point(1.0, n))];
    if case.way() == Way::default() {
        checks.push(check("reported imbalance", energy.imbalance, 0.0, sigma, 0.0));
        // The report sums over rgb; single precision areas.
        checks.push(check("reported power / 3 by texels", energy.emitted / 3.0 / emitted, 1.0, 0.0, 1e-5));
    }
    Ok(checks)
}

/// The office of both room families: paper's (x, y, z up) is our (x, z, y). Faces are cut about the points asked for,
/// squares of side .1 with 8 x 8 texels; elsewhere 4 texels a metre.
fn office(
    case: &Case,
    ceiling: &[[f32; 2]],
    floor: &[[f32; 2]],
    rays: u32,
) -> Result<(Shot, [Vec<Chart>; 4]), Problem> {
    let room = numbers(&case.inputs["room"])?;
    let rho = |key: &str| case.inputs["rho"][key].as_f64().ok_or_else(|| format!("inputs.rho.{key} is not a number"));
    let mut stage = Stage::new();
    let light = stage.material(0.0, 31.416);
    let [top, wall, bottom] = ["ceiling", "walls", "floor"].map(rho);
    let [top, wall, bottom] = [top?, wall?, bottom?].map(|rho| stage.material(rho as f32, 0.0));
    let size = vec3(room[0] as f32, room[2] as f32, room[1] as f32);
    let cuboid = Cuboid::room(Vec3::ZERO, size);
    let mut cut = |face: Face, points: &[[f32; 2]], material: u32, lamp: bool| -> Vec<Chart> {
        let cuts = |k: usize, length: f32| {
            let mut cuts = cuts_about(0.0, length, &points.iter().map(|p| p[k]).collect::<Vec<_>>(), 0.05);
            if lamp {
                cuts.extend([length / 2.0 - 0.25, length / 2.0 + 0.25]);
                cuts.sort_by(f32::total_cmp);
                cuts.dedup();
            }
            cuts
        };
        let (us, vs) = (cuts(0, size.x), cuts(1, size.z));
        let cell = |i: usize, j: usize| {
            let (low, high) = (Vec2::new(us[i], vs[j]), Vec2::new(us[i + 1], vs[j + 1]));
            let off = ((low + high) / 2.0 - Vec2::new(size.x, size.z) / 2.0).abs().max_element();
            let small = (high - low).max_element() < 0.11;
            let material = if lamp && off < 0.25 { light } else { material };
            Some((material, texels(high - low, 4.0, if small { 8 } else { 2 })))
        };
        cuboid.cut(&mut stage, face, &us, &vs, cell).into_iter().flatten().flatten().collect()
    };
    let (top, bottom) = (cut(Face::Top, ceiling, top, true), cut(Face::Bottom, floor, bottom, false));
    let mut plain =
        |f: Face, u: f32| cuboid.face(&mut stage, f, wall, uvec2(1, 1), texels(Vec2::new(u, size.y), 4.0, 2));
    let x_walls = vec![plain(Face::Left, size.z), plain(Face::Right, size.z)];
    let y_walls = vec![plain(Face::Back, size.x), plain(Face::Front, size.x)];
    Ok((case.shoot(stage, rays)?, [top, bottom, x_walls, y_walls]))
}

/// "x,y" of the expectations' keys.
fn place(key: &str) -> Result<[f32; 2], String> {
    let mut parts = key.split(',').map(str::parse::<f32>);
    match (parts.next(), parts.next()) {
        (Some(Ok(x)), Some(Ok(y))) => Ok([x, y]),
        _ => Err(format!("{key} is not a place")),
    }
}

/// Published to 5 %; a point is a square of side .1, whose mean differs by less than .1 %.
pub fn room_published(case: &Case) -> Outcome {
    let rows = case.expected["ceiling_radiosity"].as_array().ok_or("no ceiling_radiosity")?;
    let rows: Result<Vec<Vec<f64>>, String> = rows.iter().skip(1).map(numbers).collect();
    let rows = rows?;
    let points: Vec<[f32; 2]> = rows.iter().map(|r| [r[0] as f32, r[1] as f32]).collect();
    let (shot, [top, ..]) = office(case, &points, &[], 1024)?;
    let check = |(row, p): (&Vec<f64>, &[f32; 2])| {
        let rho = |i: usize| grey(shot.baked.patches.reflectance[i]);
        let b = |i: usize| grey(shot.baked.irradiance[i]) * rho(i);
        let (got, sigma) = around(&shot, &top, vec3(p[0], 3.0, p[1]), 0.051, b);
        let (expected, tolerance) = (row[2], case.tolerance("", row[2])?);
        Ok(Check {
            what: format!("B at {p:?}"),
            got,
            expected,
            tolerance,
            sigma,
            shape: 1e-3 * expected + case.one_point(expected, 12),
        })
    };
    Ok(rows.iter().zip(&points).map(check).collect::<Result<_, String>>()?)
}

/// Refined to .5 %; points as above. Means: texels of .25 m cost less than .1 %.
pub fn room_refined(case: &Case) -> Outcome {
    let named = |key: &str| -> Result<Vec<([f32; 2], f64)>, String> {
        let map = case.expected[key].as_object().ok_or_else(|| format!("no {key}"))?;
        map.iter().map(|(k, v)| Ok((place(k)?, v.as_f64().ok_or("not a number")?))).collect()
    };
    let (ceiling, floor) = (named("B_ceiling")?, named("H_floor")?);
    let places = |v: &[([f32; 2], f64)]| v.iter().map(|p| p.0).collect::<Vec<_>>();
    let (shot, [top, bottom, x_walls, y_walls]) = office(case, &places(&ceiling), &places(&floor), 2048)?;
    let [means, points] = ["means", "points_rel"].map(|k| case.tolerance(k, 1.0));
    let (means, points) = (means?, points?);
    let h = |i: usize| grey(shot.baked.irradiance[i]);
    let b = |i: usize| h(i) * grey(shot.baked.patches.reflectance[i]);
    let mut checks = Vec::new();
    let names = ["mean_H_ceiling_incl_light_patch", "mean_H_floor", "mean_H_xwall", "mean_H_ywall"];
    for (key, charts) in names.iter().zip([&top, &bottom, &x_walls, &y_walls]) {
        let (_, mean) = shot.mean(charts);
        // Noise of the largest chart, over the whole face; scattered on by the room's mean reflectance of .5.
        let largest = charts.iter().max_by_key(|c| shot.texels(**c).len()).ok_or("a face has charts")?;
        let (area, _) = shot.mean(charts);
        let sigma = shot.error_of_mean(*largest) * libm::sqrt(shot.mean(&[*largest]).0 / area) / 0.5;
        let expected = case.expects(key)?;
        let shape = 1e-3 * expected + case.one_point(expected, 12);
        checks.push(Check { what: (*key).into(), got: mean.x, expected, tolerance: means, sigma, shape });
    }
    for (p, expected) in &ceiling {
        let (got, sigma) = around(&shot, &top, vec3(p[0], 3.0, p[1]), 0.051, b);
        let (tolerance, shape) = (points * expected, 1e-3 * expected + case.one_point(*expected, 12));
        checks.push(Check { what: format!("B_ceiling {p:?}"), got, expected: *expected, tolerance, sigma, shape });
    }
    for (p, expected) in &floor {
        let (got, sigma) = around(&shot, &bottom, vec3(p[0], 0.0, p[1]), 0.051, h);
        let (tolerance, shape) = (points * expected, 1e-3 * expected + case.one_point(*expected, 12));
        checks.push(Check { what: format!("H_floor {p:?}"), got, expected: *expected, tolerance, sigma, shape });
    }
    Ok(checks)
}

//! Bounces between groups of texels, against bounces between texels.

use super::{
    bright::{Rooms, room_with_a_bright_spot},
    *,
};
use crate::common::scenes::rectangle;
use luxel::{
    progress::Silent,
    radiosity::{Radiosity, Solver},
    transport::Groups,
};

/// Reflectance .8: what is reflected again and again is most of the light.
#[test]
fn groups_of_texels_bounce_as_texels_do() {
    let mut rooms = Rooms::new(room_with_a_bright_spot(0.8, 24), 64);
    let groups = rooms.transport.groups.as_ref().map_or(0, Groups::len);
    assert!(groups < rooms.patches.len() / 10, "{groups} groups of {}", rooms.patches.len());
    let by_groups = rooms.indirect(&rooms.direct, None);
    rooms.transport.groups = None;
    let by_texels = rooms.indirect(&rooms.direct, None);
    let mean = by_texels.iter().sum::<f64>() / by_texels.len() as f64;
    let square = by_groups.iter().zip(&by_texels).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / by_texels.len() as f64;
    assert!(square.sqrt() < 0.004 * mean, "{} of {mean}", square.sqrt());
}

/// Two plates half a texel apart send light to and fro until it gets out at their rims, where it falls off within a texel.
#[test]
fn in_a_slit_groups_bounce_as_texels_do() {
    let mut stage = Stage::new();
    let (lit, other) = (stage.material(0.8, 1.0), stage.material(0.8, 0.0));
    rectangle(&mut stage, lit, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(24));
    rectangle(&mut stage, other, [vec3(0.0, 0.02, 0.0), Vec3::X, Vec3::Z], UVec2::splat(24));
    let mut rooms = Rooms::new(stage, 64);
    assert!(rooms.transport.groups.is_some());
    let by_groups = rooms.indirect(&rooms.direct, None);
    rooms.transport.groups = None;
    let by_texels = rooms.indirect(&rooms.direct, None);
    let off = by_groups.iter().zip(&by_texels).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
    assert!(off < 0.005, "{off}");
}

/// Every solver, on a room with a box in it: groups are few enough for the dense one.
#[test]
fn all_solvers_agree_on_groups() {
    let mut stage = Stage::new();
    let (wall, block) =
        (stage.rgb(vec3(0.8, 0.5, 0.2), Vec3::ZERO, false), stage.rgb(Vec3::splat(0.3), Vec3::ONE, true));
    furnished(&mut stage, wall, block, 12);
    let rooms = Rooms::new(stage, 64);
    let [first, others @ ..] = Solver::ALL.map(|solver| {
        let options = radiosity::Options { solver, bounces: None };
        let (sky, gathered) = (&rooms.sky, rooms.gathered);
        let found = Radiosity::solve(&rooms.transport, &rooms.patches, &rooms.direct, sky, gathered, &options, &Silent);
        let found = found.expect("a solution");
        assert!(found.report.converged, "{}", found.report.name);
        found.indirect
    });
    let mean = first.iter().map(|e| grey(*e)).sum::<f64>() / first.len() as f64;
    for (found, solver) in others.iter().zip(&Solver::ALL[1..]) {
        let off = found.iter().zip(&first).map(|(a, b)| (grey(*a) - grey(*b)).abs()).fold(0.0, f64::max);
        assert!(off < 1e-3 * mean, "{}: {off} of {mean}", solver.name());
    }
}

/// In a closed room in which everything shines and reflects alike, every row sums to 1: E = M / (1 - rho), exactly.
#[test]
fn a_furnace_of_groups_is_even() {
    let mut stage = Stage::new();
    let wall = stage.material(0.75, 1.0);
    unit_room().all(&mut stage, wall, 13);
    let rooms = Rooms::new(stage, 16);
    assert!(rooms.transport.groups.is_some());
    let indirect = rooms.indirect(&rooms.direct, None);
    let off = indirect.iter().map(|e| (e / 4.0 - 1.0).abs()).fold(0.0, f64::max);
    assert!(off < 1e-3, "{off}");
}

/// A sheet stands on a floor, between texels of one chart.
#[test]
fn no_group_reaches_through_a_sheet() {
    let mut stage = Stage::new();
    let grey = stage.rgb(Vec3::splat(0.5), Vec3::ZERO, true);
    rectangle(&mut stage, grey, [Vec3::ZERO, Vec3::Z, Vec3::X], UVec2::splat(16));
    rectangle(&mut stage, grey, [vec3(0.5, 0.0, 0.0), Vec3::Z, Vec3::Y], UVec2::splat(16));
    let rooms = Rooms::new(stage, 16);
    let Some(groups) = &rooms.transport.groups else { panic!("no groups") };
    let floor = |p: u32| rooms.patches.center[p as usize].y < 1e-3 && (p as usize) < rooms.patches.fronts;
    let mut parted = 0;
    for members in (0..groups.len()).map(|g| groups.members(g)).filter(|m| m.iter().all(|&p| floor(p))) {
        let beyond = members.iter().filter(|&&p| rooms.patches.center[p as usize].x > 0.5).count();
        assert!(beyond == 0 || beyond == members.len(), "{beyond} of {} are beyond the sheet", members.len());
        parted += usize::from(members.len() == 8);
    }
    // Squares of 4 x 4 texels of the page, of which the sheet cuts those in one column.
    assert!(parted >= 6, "{parted}");
}

//! Bounces between groups of texels, against bounces between texels.

use super::{
    bright::{Rooms, room_with_a_bright_spot},
    *,
};
use crate::common::scenes::rectangle;
use luxel::transport::Groups;

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

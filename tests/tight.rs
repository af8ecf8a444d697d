//! Rays from inside closed meshes, as `tools/tight.rs` shoots them by the hundred million.

#[path = "../tools/tight/closed.rs"]
mod closed;

#[test]
fn closed_meshes_let_no_ray_out() {
    let scenes = closed::scenes();
    let count = 100_000u64.div_ceil(scenes.len() as u64);
    for (name, scene) in &scenes {
        assert_eq!(closed::escaped(scene, count), 0, "{name}");
    }
}

//! Lamps and emissive surfaces in different units: a mistake that exporters make for their users.

use luxel::{
    math::luminance,
    scene::{LightKind, Scene, World},
};

/// Lumens that an exporter takes for a watt.
const LUMENS: f32 = 683.0;
/// Lamps that outshine every surface by more than this share of [`LUMENS`] are suspicious.
const SHARE: f32 = 0.15;

/// A warning where the strongest lamp outshines the strongest emissive surface about as much as lumens outnumber watts.
pub fn differ(scene: &Scene) -> Option<String> {
    let punctual = scene.lights.iter().filter(|l| !matches!(l.kind, LightKind::Directional { .. }));
    let lamp = punctual.map(|l| luminance(l.intensity)).fold(0.0, f32::max);
    let surface = brightest(scene);
    let times = lamp / surface;
    (surface > 0.0 && times > SHARE * LUMENS).then(|| {
        format!(
            "lamps are up to {times:.0} times as strong as emissive surfaces: Blender's \"Standard\" lighting multiplies lamps by \
             {LUMENS} lm/W and leaves emission as it is\n  if that is so, export with \"Unitless\", or use --light-scale {:.6}",
            1.0 / LUMENS
        )
    })
}

/// Intensity (W/sr) head on of the strongest emissive surface of one instance and material.
fn brightest(scene: &Scene) -> f32 {
    let world = World::new(scene);
    let mut most = 0.0f32;
    for instance in 0..scene.instances.len() {
        for primitive in &world.mesh(instance).primitives {
            let Some(material) = scene.materials.get(primitive.material as usize).filter(|m| m.emits()) else {
                continue;
            };
            let area = |t: u32| 0.5 * world.cross(instance, &world.corners(instance, t)).length();
            let area: f32 = primitive.triangles.clone().map(area).sum();
            most = most.max(luminance(material.emission) * area);
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DAffine3, Vec3};
    use luxel::scene::{Bake, Instance, Light, Material, Mesh, Primitive};

    /// A triangle of half a square metre with radiance 2, a lamp of so many candela.
    fn scene(candela: f32) -> Scene {
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::ZERO; 3],
            triangles: vec![[0, 1, 2]],
            primitives: vec![Primitive { triangles: 0..1, vertices: 0..3, ..Primitive::default() }],
            ..Mesh::default()
        };
        let instance =
            Instance { name: "a".into(), node: 0, mesh: 0, transform: DAffine3::IDENTITY, texels_per_meter: None };
        let lamp = Light {
            name: "lamp".into(),
            node: Some(1),
            kind: LightKind::Point { radius: 0.0 },
            position: Vec3::Z,
            direction: Vec3::NEG_Z,
            intensity: Vec3::splat(candela),
            range: f32::INFINITY,
            bake: Bake::Full,
        };
        let glow = Material { emission: Vec3::splat(2.0), ..Material::default() };
        Scene {
            meshes: vec![mesh],
            instances: vec![instance],
            materials: vec![glow],
            lights: vec![lamp],
            ..Scene::default()
        }
    }

    #[test]
    fn lumens_beside_watts_are_told() {
        assert!(differ(&scene(683.0)).is_some_and(|w| w.contains("683 times") && w.contains("0.001464")));
        for scene in [scene(50.0), scene(0.0), Scene { materials: vec![Material::default()], ..scene(683.0) }] {
            assert_eq!(differ(&scene), None);
        }
    }
}

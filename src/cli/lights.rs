//! The sky and the sun of the command line, and light for a scene that has none.

use super::values::{SkyWish, SunWish};
use glam::Vec3;
use luxel::{
    error::Result,
    pixels::read_hdr,
    scene::{Bake, Light, LightKind, MAX_LIGHT, Material, Scene, Sky, SkyMap},
};

/// Adds what the command line wishes to `scene`; returns what the user should know.
pub fn add(scene: &mut Scene, sky: Option<&SkyWish>, sun: Option<&SunWish>) -> Result<Vec<String>> {
    let mut warnings = Vec::new();
    if let Some(wish) = sky {
        scene.sky = load(wish, &mut warnings)?;
    }
    scene.lights.extend(sun.map(shining));
    if !has_light(scene) {
        scene.sky = Sky::Uniform(Vec3::ONE);
        let typed = if sky.is_some() { ", and the sky of --sky is black" } else { "" };
        let instead = "it is baked under a white sky of radiance 1 (see --sky, --sun)";
        warnings.push(format!("the scene has no light{typed}; {instead}"));
    }
    if !scene.instances.is_empty() && used(scene).all(|m| m.unlit) {
        warnings.push("nothing is lit: all materials are unlit (KHR_materials_unlit)".into());
    }
    Ok(warnings)
}

fn load(wish: &SkyWish, warnings: &mut Vec<String>) -> Result<Sky> {
    let (file, scale, rotation) = match wish {
        SkyWish::Uniform(radiance) => return Ok(Sky::Uniform(*radiance)),
        SkyWish::Picture(file, scale, rotation) => (file, *scale, rotation.to_radians()),
    };
    let hdr = read_hdr(file)?;
    let (bad, mut radiance, mut capped) = (hdr.repaired, hdr.radiance, 0);
    for c in &mut radiance {
        *c *= scale;
        if c.max_element() > MAX_LIGHT {
            (*c, capped) = (c.min(Vec3::splat(MAX_LIGHT)), capped + 1);
        }
    }
    if bad > 0 {
        warnings.push(format!("{}: {bad} pixels are negative or not finite; they are taken as black", file.display()));
    }
    if capped > 0 {
        warnings.push(format!(
            "{}: {capped} pixels are brighter than {MAX_LIGHT:e}: they are capped there",
            file.display()
        ));
    }
    Ok(Sky::Map(SkyMap { width: hdr.size.x, height: hdr.size.y, radiance, rotation }))
}

fn shining(sun: &SunWish) -> Light {
    let (azimuth, elevation) = (sun.azimuth.to_radians(), sun.elevation.to_radians());
    let flat = libm::cos(elevation);
    let towards = glam::DVec3::new(flat * libm::sin(azimuth), libm::sin(elevation), flat * libm::cos(azimuth));
    Light {
        name: "--sun".into(),
        node: None,
        kind: LightKind::Directional { angle: sun.angle.to_radians() },
        position: Vec3::ZERO,
        direction: (-towards).as_vec3().normalize(),
        intensity: Vec3::splat(sun.lux),
        range: f32::INFINITY,
        bake: Bake::Full,
    }
}

fn has_light(scene: &Scene) -> bool {
    let shines = |l: &Light| l.bake != Bake::None && l.intensity.max_element() > 0.0;
    scene.sky.shines() || scene.lights.iter().any(shines) || used(scene).any(Material::emits)
}

/// Materials of triangles.
fn used(scene: &Scene) -> impl Iterator<Item = &Material> {
    let meshes = scene.instances.iter().filter_map(|i| scene.meshes.get(i.mesh as usize));
    let primitives = meshes.flat_map(|m| &m.primitives).filter(|p| !p.triangles.is_empty());
    primitives.filter_map(|p| scene.materials.get(p.material as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sun(azimuth: f64, elevation: f64) -> Light {
        shining(&SunWish { azimuth, elevation, lux: 2.0, angle: 0.53 })
    }

    #[test]
    fn the_sun_stands_where_it_is_told() {
        let half = 0.5f32.sqrt();
        for (azimuth, elevation, towards) in [
            (0.0, 0.0, Vec3::Z),
            (90.0, 0.0, Vec3::X),
            (180.0, 0.0, Vec3::NEG_Z),
            (-90.0, 0.0, Vec3::NEG_X),
            (33.0, 90.0, Vec3::Y),
            (90.0, 45.0, Vec3::new(half, half, 0.0)),
        ] {
            let light = sun(azimuth, elevation);
            assert!((light.direction + towards).length() < 1e-6, "{azimuth}, {elevation}: {}", light.direction);
            assert_eq!((light.intensity, light.node), (Vec3::splat(2.0), None));
            assert_eq!(light.kind, LightKind::Directional { angle: 0.53f32.to_radians() });
        }
    }

    /// Four columns, two rows: column c of the upper row has radiance c + 1, of the lower row c + 5.
    fn map(rotation: f32) -> Sky {
        let radiance = (1..=8).map(|i| Vec3::splat(i as f32)).collect();
        Sky::Map(SkyMap { width: 4, height: 2, radiance, rotation: rotation.to_radians() })
    }

    #[test]
    fn the_picture_of_the_sky_lies_as_documented() {
        // A little to the left and up of the six axes, since they lie on edges of the four columns and two rows.
        let up = 0.1 * Vec3::Y;
        let looks = [
            (Vec3::NEG_Z + up - 0.1 * Vec3::X, 2.0), // the centre's left neighbour
            (Vec3::NEG_Z + up + 0.1 * Vec3::X, 3.0), // the centre's right neighbour: u grows towards +X
            (Vec3::X + up - 0.1 * Vec3::Z, 3.0),
            (Vec3::X + up + 0.1 * Vec3::Z, 4.0),
            (Vec3::Z + up + 0.1 * Vec3::X, 4.0),
            (Vec3::Z + up - 0.1 * Vec3::X, 1.0),
            (Vec3::NEG_X + up - 0.1 * Vec3::Z, 2.0),
            (Vec3::NEG_X + up + 0.1 * Vec3::Z, 1.0),
            (Vec3::Y + 0.1 * Vec3::new(1.0, 0.0, -1.0), 3.0),
            (Vec3::NEG_Y + 0.1 * Vec3::new(1.0, 0.0, -1.0), 7.0),
        ];
        for (direction, expected) in looks {
            assert_eq!(map(0.0).radiance(direction.normalize()).x, expected, "{direction}");
            // Right-hand rule about +Y: a quarter turn takes what stood at -Z to -X, and +X to -Z.
            let turned = glam::Quat::from_rotation_y(90f32.to_radians()) * direction;
            assert_eq!(map(90.0).radiance(turned.normalize()).x, expected, "{direction} turned to {turned}");
        }
    }

    #[test]
    fn a_dark_scene_gets_a_white_sky_and_a_warning() {
        let mut scene = Scene::default();
        assert_eq!(add(&mut scene, None, None).unwrap().len(), 1);
        assert!(matches!(scene.sky, Sky::Uniform(Vec3::ONE)));
        let black = SkyWish::Uniform(Vec3::ZERO);
        assert!(add(&mut Scene::default(), Some(&black), None).unwrap()[0].contains("--sky is black"));
        let mut scene = Scene { lights: vec![Light { bake: Bake::None, ..sun(0.0, 90.0) }], ..Scene::default() };
        assert_eq!(add(&mut scene, None, None).unwrap().len(), 1);
    }

    #[test]
    fn a_lit_scene_keeps_its_sky() {
        let mut scene = Scene::default();
        let wish = SunWish { azimuth: 0.0, elevation: 50.0, lux: 1.0, angle: 0.0 };
        assert!(add(&mut scene, None, Some(&wish)).unwrap().is_empty());
        assert!(matches!(scene.sky, Sky::Black) && scene.lights.len() == 1);
    }
}

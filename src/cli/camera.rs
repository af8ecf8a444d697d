//! The preview's camera: the one that was wished for, the file's, or one that shows much of the scene.

use super::values::CameraWish;
use glam::{DVec3, Vec3};
use luxel::{
    error::{Error, Result},
    preview::{self, Cast},
    scene::{Camera, Scene},
};

/// Vertical field of view (radians) of a camera given by eye and target.
const FOV: f32 = 0.9;

/// The camera that is wished for or that the file has; `None`: one must be found ([`find`]).
pub fn choose(scene: &Scene, wish: Option<&CameraWish>) -> Result<Option<Camera>> {
    match wish {
        None => Ok(scene.cameras.first().cloned()),
        Some(CameraWish::At(eye, target)) => {
            let forward = (*target - *eye).normalize().as_vec3();
            Ok(Some(preview::at((*eye - scene.origin).as_vec3(), forward, FOV)))
        }
        Some(CameraWish::Named(name)) => match scene.cameras.iter().find(|c| c.name == *name) {
            Some(camera) => Ok(Some(camera.clone())),
            None => Err(Error::Usage(unknown(name, &scene.cameras))),
        },
    }
}

/// A camera for a scene that has none.
pub fn find(scene: &Scene, cast: &Cast, aspect: f32) -> Camera {
    let (low, high) = bounds(scene);
    preview::frame(cast, low, high, aspect)
}

fn unknown(name: &str, cameras: &[Camera]) -> String {
    let names = cameras.iter().map(|c| format!("`{}`", c.name)).collect::<Vec<_>>().join(", ");
    let known = if names.is_empty() { "it has none".into() } else { format!("it has {names}") };
    format!("--camera: the scene has no camera `{name}`; {known}; eye and target are written X,Y,Z,X,Y,Z")
}

/// The box around all instances, in the scene's space.
fn bounds(scene: &Scene) -> (Vec3, Vec3) {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for instance in &scene.instances {
        let Some(mesh) = scene.meshes.get(instance.mesh as usize) else { continue };
        for p in mesh.triangles.iter().flatten().filter_map(|&v| mesh.positions.get(v as usize)) {
            let p = instance.transform.transform_point3(p.as_dvec3());
            (low, high) = (low.min(p), high.max(p));
        }
    }
    if low.x <= high.x { (low.as_vec3(), high.as_vec3()) } else { (Vec3::NEG_ONE, Vec3::ONE) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Camera {
        Camera { name: name.into(), ..preview::at(Vec3::ZERO, Vec3::X, 1.0) }
    }

    #[test]
    fn wishes_come_first() {
        let scene = Scene { cameras: vec![named("a"), named("b")], origin: DVec3::X, ..Scene::default() };
        assert_eq!(choose(&scene, None).unwrap().unwrap().name, "a");
        assert_eq!(choose(&scene, Some(&CameraWish::Named("b".into()))).unwrap().unwrap().name, "b");
        let error = choose(&scene, Some(&CameraWish::Named("c".into()))).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("`a`, `b`"), "{error}");
        let wish = CameraWish::At(DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 2.0, 9.0));
        let camera = choose(&scene, Some(&wish)).unwrap().unwrap();
        assert_eq!((camera.eye, camera.forward), (Vec3::new(0.0, 2.0, 3.0), Vec3::Z));
        assert!(choose(&Scene::default(), None).unwrap().is_none());
    }
}

//! Small scenes built by hand.

use glam::{DAffine3, DVec3, Vec2, Vec3};
use luxel::scene::{Instance, Material, Mesh, Primitive, Scene};

/// A mesh of one primitive from positions, uv and triangles.
pub fn mesh(name: &str, positions: Vec<Vec3>, uv: Vec<Vec2>, triangles: Vec<[u32; 3]>) -> Mesh {
    let primitive = Primitive {
        source: 0,
        triangles: 0..triangles.len() as u32,
        vertices: 0..positions.len() as u32,
        material: 0,
        uv_sets: if uv.is_empty() { 0 } else { 0b10 },
    };
    Mesh {
        name: name.into(),
        source: 0,
        normals: vec![Vec3::ZERO; positions.len()],
        uvs: if uv.is_empty() { vec![] } else { vec![vec![], uv] },
        colors: vec![],
        positions,
        triangles,
        primitives: vec![primitive],
    }
}

/// A square of edge 1 in the plane z = 0 whose uv fill `min..max`.
pub fn square(name: &str, min: [f32; 2], max: [f32; 2]) -> Mesh {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
    let (min, max) = (Vec2::from(min), Vec2::from(max));
    let uv = corners.map(|c| min + (max - min) * c).to_vec();
    mesh(name, corners.map(|c| c.extend(0.0)).to_vec(), uv, vec![[0, 1, 2], [0, 2, 3]])
}

/// A cube of edge 1, four vertices a face, no uv.
pub fn cube() -> Mesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [0.0, 1.0] {
            let n = positions.len() as u32;
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let mut p = [0.0; 3];
                (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, u, v);
                positions.push(Vec3::from(p));
            }
            let quad = if side > 0.0 { [[0, 1, 2], [0, 2, 3]] } else { [[0, 2, 1], [0, 3, 2]] };
            triangles.extend(quad.map(|t: [u32; 3]| t.map(|v| v + n)));
        }
    }
    mesh("mesh \"Cube\"", positions, vec![], triangles)
}

/// A sphere of radius 1 in `n` rings, its poles degenerate.
pub fn sphere(n: u32) -> Mesh {
    let at = |i: u32, j: u32| {
        let (polar, azimuth) = (std::f32::consts::PI * i as f32 / n as f32, std::f32::consts::PI * j as f32 / n as f32);
        let (s, c) = (libm::sinf(polar), libm::cosf(polar));
        Vec3::new(s * libm::cosf(azimuth), c, s * libm::sinf(azimuth))
    };
    let row = 2 * n + 1;
    let positions = (0..=n).flat_map(|i| (0..row).map(move |j| at(i, j))).collect();
    let quad = |i: u32, j: u32| {
        let a = i * row + j;
        [[a, a + 1, a + row], [a + 1, a + row + 1, a + row]]
    };
    let triangles = (0..n).flat_map(|i| (0..2 * n).flat_map(move |j| quad(i, j))).collect();
    mesh("mesh \"Sphere\"", positions, vec![], triangles)
}

/// `n` separate triangles, no two in one plane: as many charts.
pub fn confetti(n: u32) -> Mesh {
    let corner = |i: u32, k: u32| {
        let turn = 2.4 * i as f32 + 2.0 * k as f32;
        Vec3::new(libm::cosf(turn), libm::sinf(turn), 3.0 * i as f32 + 0.1 * k as f32)
    };
    let positions = (0..n).flat_map(|i| (0..3).map(move |k| corner(i, k))).collect();
    mesh("mesh \"Confetti\"", positions, vec![], (0..n).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// Meshes placed in a row; each instance is (mesh, scale).
pub fn scene(meshes: Vec<Mesh>, instances: &[(u32, DVec3)]) -> Scene {
    let place = |(i, &(mesh, scale)): (usize, &(u32, DVec3))| Instance {
        name: format!("node {i}"),
        node: i as u32,
        mesh,
        transform: DAffine3::from_translation(DVec3::X * 10.0 * i as f64) * DAffine3::from_scale(scale),
        texels_per_meter: None,
    };
    Scene {
        meshes,
        instances: instances.iter().enumerate().map(place).collect(),
        materials: vec![Material::default()],
        ..Scene::default()
    }
}

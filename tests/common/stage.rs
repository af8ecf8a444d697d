//! [`Stage`]: a scene under construction in which every surface knows its texels.
//!
//! Each surface is a mesh of its own with one chart, a rectangle of whole texels. TEXCOORD_1 holds the charts of all
//! surfaces on one square page whose edge is a power of two, so that texel borders are exact in single precision.
//! Charts keep two empty texels on every side. The default unwrapper may be used on the same scene.

use glam::{Affine2, DAffine3, UVec2, Vec2, Vec3};
use luxel::scene::{Instance, Light, LightKind, Material, Mesh, Primitive, Scene, Texture, TextureRef, Wrap};
use std::f32::consts::PI;

/// Empty texels on each side of a chart.
const GUTTER: u32 = 2;

/// Index of a surface: of its chart, its mesh and its instance.
pub type Chart = usize;

/// A surface before it is laid out.
#[derive(Default)]
pub struct Surface {
    pub positions: Vec<Vec3>,
    /// Empty: face normals.
    pub normals: Vec<Vec3>,
    /// Texels from the chart's corner.
    pub uv: Vec<Vec2>,
    pub triangles: Vec<[u32; 3]>,
    /// Size of the chart in texels.
    pub size: UVec2,
    /// Turns the winding around.
    pub flip: bool,
}

#[derive(Default)]
pub struct Stage {
    pub scene: Scene,
    /// Sizes of the charts in texels.
    pub sizes: Vec<UVec2>,
    uv: Vec<Vec<Vec2>>,
}

impl Stage {
    pub fn new() -> Self {
        Stage::default()
    }

    /// A one-sided grey Lambertian: reflectance `rho`, exitance `m` (W/m^2).
    pub fn material(&mut self, rho: f32, m: f32) -> u32 {
        self.rgb(Vec3::splat(rho), Vec3::splat(m), false)
    }

    /// A Lambertian: reflectance `rho`, exitance `m` (W/m^2).
    pub fn rgb(&mut self, rho: Vec3, m: Vec3, double_sided: bool) -> u32 {
        let emission = m / PI;
        self.add(Material { base_color: rho.extend(1.0), emission, double_sided, ..Material::default() })
    }

    pub fn add(&mut self, material: Material) -> u32 {
        self.scene.materials.push(material);
        self.scene.materials.len() as u32 - 1
    }

    pub fn light(&mut self, kind: LightKind, position: Vec3, direction: Vec3, intensity: f32) {
        self.scene.lights.push(Light {
            name: "light".into(),
            node: None,
            kind,
            position,
            direction: direction.normalize_or_zero(),
            intensity: Vec3::splat(intensity),
            range: f32::INFINITY,
            bake: luxel::scene::Bake::Full,
        });
    }

    /// Adds a surface: a mesh, its instance and its chart.
    pub fn surface(&mut self, name: &str, material: u32, mut s: Surface) -> Chart {
        let chart = self.sizes.len();
        if s.normals.is_empty() {
            s.normals = vec![Vec3::ZERO; s.positions.len()];
        }
        if s.flip {
            s.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        }
        let primitives = vec![Primitive {
            source: 0,
            triangles: 0..s.triangles.len() as u32,
            vertices: 0..s.positions.len() as u32,
            material,
            uv_sets: 2,
        }];
        self.uv.push(s.uv);
        self.sizes.push(s.size);
        self.scene.meshes.push(Mesh {
            name: format!("mesh {chart} {name:?}"),
            positions: s.positions,
            normals: s.normals,
            uvs: Vec::new(),
            colors: Vec::new(),
            source: chart as u32,
            triangles: s.triangles,
            primitives,
        });
        self.scene.instances.push(Instance {
            name: format!("node {chart} {name:?}"),
            node: chart as u32,
            mesh: chart as u32,
            transform: DAffine3::IDENTITY,
            texels_per_meter: None,
        });
        chart
    }

    /// A grid of `cells` quads whose vertices `position(i, j)` gives; the front is where i x j points, or `flip`.
    /// Its chart is `texels` large, i to the right and j down. Triangles without area are left out.
    pub fn grid(
        &mut self,
        name: &str,
        material: u32,
        [cells, texels]: [UVec2; 2],
        flip: bool,
        position: impl Fn(u32, u32) -> Vec3,
        normal: Option<&dyn Fn(u32, u32) -> Vec3>,
    ) -> Chart {
        let mut s = Surface { size: texels, flip, ..Surface::default() };
        for j in 0..=cells.y {
            for i in 0..=cells.x {
                s.positions.push(position(i, j));
                s.normals.extend(normal.map(|n| n(i, j)));
                s.uv.push(UVec2::new(i, j).as_vec2() / cells.as_vec2() * texels.as_vec2());
            }
        }
        for j in 0..cells.y {
            for i in 0..cells.x {
                let at = |i: u32, j: u32| j * (cells.x + 1) + i;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let p = |v: u32| s.positions[v as usize];
                s.triangles.extend([[a, b, c], [a, c, d]].into_iter().filter(|t| {
                    let [a, b, c] = t.map(p);
                    a != b && b != c && c != a
                }));
            }
        }
        self.surface(name, material, s)
    }

    /// Lays out the charts: fills TEXCOORD_1 of every mesh; page edge and corner of each chart in texels.
    pub fn lay_out(&mut self) -> (u32, Vec<UVec2>) {
        let (edge, corners) = (4..14).find_map(|k| Some((1u32 << k, self.packed(1 << k)?))).expect("charts fit a page");
        for ((mesh, uv), corner) in self.scene.meshes.iter_mut().zip(&self.uv).zip(&corners) {
            mesh.uvs.resize(2, Vec::new());
            mesh.uvs[1] = uv.iter().map(|p| (*p + corner.as_vec2()) / edge as f32).collect();
        }
        (edge, corners)
    }

    /// Gives a surface the texture coordinates of its chart, [0, 1] across it, as TEXCOORD_0.
    pub fn paint(&mut self, chart: Chart) {
        let size = self.sizes[chart].as_vec2();
        self.scene.meshes[chart].uvs = vec![self.uv[chart].iter().map(|p| *p / size).collect()];
    }

    /// A texture of linear texels, rows from the top, read without a filter from TEXCOORD_0.
    pub fn picture(&mut self, size: UVec2, texel: impl Fn(u32, u32) -> [u8; 4]) -> TextureRef {
        let rgba = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
        self.scene.textures.push(Texture::new(size, rgba, false, [Wrap::Clamp; 2], true));
        TextureRef { texture: self.scene.textures.len() as u32 - 1, set: 0, transform: Affine2::IDENTITY }
    }

    /// Shelves in the order of the surfaces; `None` if `edge` is too small.
    fn packed(&self, edge: u32) -> Option<Vec<UVec2>> {
        let (mut at, mut shelf) = (UVec2::splat(GUTTER), 0);
        self.sizes
            .iter()
            .map(|size| {
                if at.x + size.x + GUTTER > edge {
                    at = UVec2::new(GUTTER, at.y + shelf + 2 * GUTTER);
                    shelf = 0;
                }
                let corner = at;
                at.x += size.x + 2 * GUTTER;
                shelf = shelf.max(size.y);
                ((corner + size + GUTTER).max_element() <= edge).then_some(corner)
            })
            .collect()
    }

    /// World area of a surface, from its triangles.
    pub fn area(&self, chart: Chart) -> f64 {
        let (mesh, transform) = (&self.scene.meshes[chart], self.scene.instances[chart].transform);
        let p = |v: u32| transform.transform_point3(mesh.positions[v as usize].as_dvec3());
        mesh.triangles.iter().map(|t| t.map(p)).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    }
}

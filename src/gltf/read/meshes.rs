//! A document's mesh to triangles: all primitives in one set of arrays, strips and fans made into triangles.
//!
//! Primitive vertices keep the file's order: vertex v of the primitive is `vertices.start + v` of the mesh.

use super::{
    accessors::Reader,
    extensions::{DRACO, extension, refused},
    materials::Materials,
    source::{Source, label},
    warnings::Warnings,
};
use crate::{
    error::{Error, Result},
    scene::{Mesh, Primitive},
};
use glam::{Vec2, Vec3, Vec4};
use gltf::json::{
    self, Accessor, Index,
    mesh::{Mode, Semantic},
    validation::Checked,
};
use std::ops::Range;

/// Texture coordinate sets that are read.
const MAX_SETS: u32 = 8;
/// Vertices and triangles that the meshes of a scene may have: primitives that share accessors get copies, so a small
/// file could ask for any number of them.
const MAX_VERTICES: usize = 1 << 27;
const MAX_TRIANGLES: usize = 1 << 26;

/// What the meshes of a scene have so far.
#[derive(Default)]
pub(super) struct Total {
    vertices: usize,
    triangles: usize,
}

/// Mesh `index` of the document; `None`, with a warning, if it has no triangle. Nothing of it is read if it makes `total`
/// too large.
pub(super) fn read(
    source: &Source,
    index: usize,
    materials: &mut Materials,
    total: &mut Total,
    warnings: &mut Warnings,
) -> Result<Option<Mesh>> {
    let from = source.part(&source.meshes, index, "mesh", "mesh")?;
    let name = label("mesh", index, from.name.as_deref());
    let mut mesh = Mesh { name, source: index as u32, ..Mesh::default() };
    let part = |(i, primitive)| Part { source, primitive, place: format!("{}, primitive {i}", mesh.name) };
    let parts: Vec<Part> = from.primitives.iter().enumerate().map(part).collect();
    parts.iter().try_for_each(|part| total.add(part))?;
    for (i, part) in parts.iter().enumerate() {
        part.append(i, &mut mesh, materials, warnings)?;
    }
    if mesh.triangles.is_empty() {
        // What has primitives is told of each of them.
        if parts.is_empty() {
            warnings.about(mesh.name, "has no triangles and is left out");
        }
        return Ok(None);
    }
    let vertices = mesh.positions.len();
    mesh.uvs.iter_mut().filter(|s| !s.is_empty()).for_each(|s| s.resize(vertices, Vec2::ZERO));
    if !mesh.colors.is_empty() {
        mesh.colors.resize(vertices, Vec4::ONE);
    }
    Ok(Some(mesh))
}

impl Total {
    /// Counts what a primitive says it has.
    fn add(&mut self, part: &Part) -> Result<()> {
        let (vertices, triangles) = part.claim()?;
        self.vertices = self.vertices.saturating_add(vertices);
        self.triangles = self.triangles.saturating_add(triangles);
        for (count, most, what) in
            [(self.vertices, MAX_VERTICES, "vertices"), (self.triangles, MAX_TRIANGLES, "triangles")]
        {
            if count > most {
                let problem = format!("here the scene has more than {most} {what}");
                let remedy = "leave nodes out (--exclude), or split the scene into several files";
                return Err(Error::invalid(part.source.file, &part.place, problem, remedy));
            }
        }
        Ok(())
    }
}

/// A primitive of the document.
struct Part<'s, 'a> {
    source: &'s Source<'a>,
    primitive: &'s json::mesh::Primitive,
    place: String,
}

impl Part<'_, '_> {
    fn append(&self, source: usize, mesh: &mut Mesh, materials: &mut Materials, warnings: &mut Warnings) -> Result<()> {
        let Checked::Valid(mode) = self.primitive.mode else {
            return Err(self.source.invalid(&self.place, "its mode is unknown"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            warnings.about(&self.place, "consists of points or lines and is left out");
            return Ok(());
        }
        let Some(position) = self.attribute(Semantic::Positions) else {
            warnings.about(&self.place, "has no positions and is left out");
            return Ok(());
        };
        self.check_draco(mesh.source as usize, source, position)?;
        let positions = self.positions(position)?;
        let triangles = self.triangles(mode, positions.len(), warnings)?;
        if triangles.is_empty() {
            warnings.about(&self.place, "has no triangles and is left out");
            return Ok(());
        }
        let (start, first) = (mesh.positions.len(), mesh.triangles.len() as u32);
        let end = start + positions.len();
        mesh.positions.extend(positions);
        mesh.normals.extend(self.normals(end - start, warnings)?);
        let uv_sets = self.uvs(mesh, start..end, warnings)?;
        self.colors(mesh, start..end, warnings)?;
        mesh.triangles.extend(triangles.iter().map(|t| t.map(|v| v + start as u32)));
        let material = match self.primitive.material {
            Some(m) => materials.get(m.value(), &self.place, warnings)?,
            None => {
                warnings.about(&mesh.name, "has no material on some of it: taken as grey 0.8");
                materials.without()
            }
        };
        let vertices = start as u32..end as u32;
        let triangles = first..mesh.triangles.len() as u32;
        let primitive = Primitive { source: source as u32, triangles, vertices, material, uv_sets };
        materials.check_sets(material, |set| primitive.has_uv(set), &mesh.name, warnings);
        mesh.primitives.push(primitive);
        Ok(())
    }

    /// Vertices and triangles that it says it has, as far as a file of this size could hold them.
    fn claim(&self) -> Result<(usize, usize)> {
        let Some(position) = self.attribute(Semantic::Positions) else { return Ok((0, 0)) };
        let count = |index: Index<Accessor>| Ok(Reader::new(self.source, index.value(), &self.place)?.claim());
        let vertices = count(position)?;
        let corners = self.primitive.indices.map_or(Ok(vertices), count)?;
        Ok(match self.primitive.mode {
            Checked::Valid(Mode::Triangles) => (vertices, corners / 3),
            Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => (vertices, corners.saturating_sub(2)),
            _ => (0, 0),
        })
    }

    fn attribute(&self, semantic: Semantic) -> Option<Index<Accessor>> {
        self.primitive.attributes.get(&Checked::Valid(semantic)).copied()
    }

    /// Attribute `semantic`, which must have `count` elements.
    fn reader(&self, semantic: Semantic, count: usize) -> Result<Option<Reader<'_, '_>>> {
        let Some(index) = self.attribute(semantic) else { return Ok(None) };
        let reader = Reader::new(self.source, index.value(), &self.place)?;
        if reader.count() != count {
            let problem = format!("accessor {index} has {} elements for {count} vertices", reader.count());
            return Err(self.source.invalid(&self.place, problem));
        }
        Ok(Some(reader))
    }

    /// A compressed primitive can be read only if its plain form is there too.
    fn check_draco(&self, mesh: usize, primitive: usize, position: Index<Accessor>) -> Result<()> {
        let value = self.source.value("meshes", mesh).get("primitives").and_then(|p| p.get(primitive));
        let plain = self.source.accessors.get(position.value()).is_none_or(|a| a.buffer_view.is_some());
        if !plain && value.is_some_and(|v| extension(v, DRACO).is_some()) {
            return Err(refused(self.source.file, DRACO, &self.place));
        }
        Ok(())
    }

    fn positions(&self, accessor: Index<Accessor>) -> Result<Vec<Vec3>> {
        let reader = Reader::new(self.source, accessor.value(), &self.place)?;
        let positions: Vec<Vec3> = reader.floats()?.into_iter().map(Vec3::from_array).collect();
        match positions.iter().position(|p| !p.is_finite()) {
            Some(v) => {
                let problem = format!("vertex {v} has a position that is not finite");
                Err(self.source.invalid(format!("{}, accessor {accessor}", self.place), problem))
            }
            None => Ok(positions),
        }
    }

    fn normals(&self, count: usize, warnings: &mut Warnings) -> Result<Vec<Vec3>> {
        let Some(reader) = self.reader(Semantic::Normals, count)? else { return Ok(vec![Vec3::ZERO; count]) };
        // Double precision: the square of a small or large component must not vanish or overflow.
        let unit = |n: [f32; 3]| Vec3::from_array(n).as_dvec3().normalize_or_zero().as_vec3();
        let normals: Vec<Vec3> = reader.floats()?.into_iter().map(unit).collect();
        if normals.contains(&Vec3::ZERO) {
            warnings.about(&self.place, "has normals without direction: the face's own is used there");
        }
        Ok(normals)
    }

    fn uvs(&self, mesh: &mut Mesh, vertices: Range<usize>, warnings: &mut Warnings) -> Result<u32> {
        let mut sets = 0;
        for set in 0..MAX_SETS {
            let Some(reader) = self.reader(Semantic::TexCoords(set), vertices.len())? else { continue };
            let mut uvs: Vec<Vec2> = reader.floats()?.into_iter().map(Vec2::from_array).collect();
            if uvs.iter().any(|uv| !uv.is_finite()) {
                warnings.about(&self.place, "has texture coordinates that are not finite: taken as 0");
                uvs.iter_mut().filter(|uv| !uv.is_finite()).for_each(|uv| *uv = Vec2::ZERO);
            }
            let at = set as usize;
            mesh.uvs.resize(mesh.uvs.len().max(at + 1), Vec::new());
            mesh.uvs[at].resize(vertices.start, Vec2::ZERO);
            mesh.uvs[at].extend(uvs);
            sets |= 1 << set;
        }
        Ok(sets)
    }

    fn colors(&self, mesh: &mut Mesh, vertices: Range<usize>, warnings: &mut Warnings) -> Result<()> {
        let Some(reader) = self.reader(Semantic::Colors(0), vertices.len())? else { return Ok(()) };
        let mut colors: Vec<Vec4> = if reader.is_vec(3) {
            reader.floats()?.into_iter().map(|c| Vec3::from_array(c).extend(1.0)).collect()
        } else {
            reader.floats()?.into_iter().map(Vec4::from_array).collect()
        };
        if colors.iter().any(|c| !c.is_finite()) {
            warnings.about(&self.place, "has vertex colours that are not finite: taken as white");
            colors.iter_mut().filter(|c| !c.is_finite()).for_each(|c| *c = Vec4::ONE);
        }
        mesh.colors.resize(vertices.start, Vec4::ONE);
        mesh.colors.extend(colors);
        Ok(())
    }

    fn triangles(&self, mode: Mode, vertices: usize, warnings: &mut Warnings) -> Result<Vec<[u32; 3]>> {
        let order: Vec<u32> = match self.primitive.indices {
            Some(accessor) => {
                let order = Reader::new(self.source, accessor.value(), &self.place)?.indices()?;
                if let Some(v) = order.iter().find(|v| **v as usize >= vertices) {
                    let problem = format!("names vertex {v}, but there are {vertices}");
                    return Err(self.source.invalid(format!("{}, accessor {accessor}", self.place), problem));
                }
                order
            }
            None => (0..vertices as u32).collect(),
        };
        if mode == Mode::Triangles && !order.len().is_multiple_of(3) {
            warnings.about(&self.place, "ends with an incomplete triangle, which is left out");
        }
        Ok(match mode {
            Mode::TriangleStrip => order.windows(3).enumerate().map(strip).collect(),
            Mode::TriangleFan => {
                order.get(1..).unwrap_or_default().windows(2).map(|w| [w[0], w[1], order[0]]).collect()
            }
            _ => order.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
        })
    }
}

/// Triangle i of a strip: every other one is wound the other way.
fn strip((i, w): (usize, &[u32])) -> [u32; 3] {
    if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] }
}

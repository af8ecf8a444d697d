//! [`Handler`]: what Bevy's glTF loader calls on its way through a file.

use crate::{
    LightmapProblem,
    data::{Baked, NAME, Page, Problem},
    page,
};
use bevy::{
    asset::{LoadContext, RenderAssetUsages},
    gltf::{
        GltfLoaderSettings,
        extensions::{ErasedGltfExtensionHandler, GltfExtensionHandler},
    },
    mesh::MeshVertexAttribute,
    pbr::Lightmap,
    platform::collections::HashMap,
    prelude::*,
};
use gltf::Node;
use percent_encoding::percent_decode_str;
use tracing::warn;

/// Lights one file; Bevy clones it for each.
#[derive(Clone, Default)]
pub struct Handler {
    usages: RenderAssetUsages,
    read: bool,
    baked: Baked,
    pages: Vec<Handle<Image>>,
    problem: Option<Problem>,
}

impl GltfExtensionHandler for Handler {
    fn dyn_clone(&self) -> Box<dyn ErasedGltfExtensionHandler> {
        Box::new(self.clone())
    }

    fn on_root(&mut self, _: &mut LoadContext<'_>, _: &gltf::Gltf, settings: &GltfLoaderSettings) {
        self.usages = settings.load_materials;
    }

    /// The only place that hands out buffers and may wait for files. All primitives come before all nodes, so that nothing
    /// is bound to a lightmap that is not whole.
    async fn on_gltf_primitive(
        &mut self,
        load_context: &mut LoadContext<'_>,
        document: &gltf::Gltf,
        _: &gltf::Mesh<'_>,
        _: &gltf::Primitive<'_>,
        buffers: &[Vec<u8>],
        _: &HashMap<Box<str>, MeshVertexAttribute>,
        _: bool,
        _: bool,
        _: &mut Option<Mesh>,
    ) {
        if self.read {
            return;
        }
        self.read = true;
        if let Err(problem) = self.load(load_context, document, buffers).await {
            let file = load_context.path().to_string();
            warn!("{NAME}: {file}: {problem}; the scene is shown without its lightmap");
            self.problem = Some(problem);
        }
    }

    /// The meshes of a node are children of its entity; there is one for each primitive.
    fn on_gltf_node(&mut self, _: &mut LoadContext<'_>, node: &Node<'_>, entity: &mut EntityWorldMut<'_>) {
        let Some(&(page, uv_rect)) = self.baked.places.get(&node.index()) else { return };
        let lightmap = Lightmap { image: self.pages[page].clone(), uv_rect, bicubic_sampling: false };
        let children: Vec<Entity> = entity.get::<Children>().into_iter().flatten().copied().collect();
        entity.world_scope(|world| {
            for child in children {
                if world.get::<Mesh3d>(child).is_some() {
                    world.entity_mut(child).insert(lightmap.clone());
                }
            }
        });
    }

    fn on_spawn_light_directional(&mut self, _: &mut LoadContext<'_>, node: &Node<'_>, light: &mut EntityWorldMut<'_>) {
        self.switch_off(node, light);
    }

    fn on_spawn_light_point(&mut self, _: &mut LoadContext<'_>, node: &Node<'_>, light: &mut EntityWorldMut<'_>) {
        self.switch_off(node, light);
    }

    fn on_spawn_light_spot(&mut self, _: &mut LoadContext<'_>, node: &Node<'_>, light: &mut EntityWorldMut<'_>) {
        self.switch_off(node, light);
    }

    fn on_scene_completed(&mut self, _: &mut LoadContext<'_>, _: &gltf::Scene<'_>, root: Entity, world: &mut World) {
        if let Some(problem) = &self.problem {
            world.entity_mut(root).insert(LightmapProblem(problem.clone()));
        }
    }
}

impl Handler {
    async fn load(
        &mut self,
        load_context: &mut LoadContext<'_>,
        document: &gltf::Gltf,
        buffers: &[Vec<u8>],
    ) -> Result<(), Problem> {
        let baked = Baked::read(document)?;
        let mut images = Vec::new();
        for (index, page) in baked.pages.iter().enumerate() {
            let image = match bytes(page, load_context, document, buffers).await {
                Ok(bytes) => page::image(&bytes, page, self.usages),
                Err(problem) => Err(problem),
            };
            images.push(image.map_err(|problem| format!("page {index} {problem}"))?);
        }
        let label = |(index, image)| load_context.add_labeled_asset(format!("{NAME}/Page{index}"), image);
        self.pages = images.into_iter().enumerate().map(label).collect();
        self.baked = baked;
        Ok(())
    }

    /// A light's entity is its own, beside meshes and children of its node.
    fn switch_off(&self, node: &Node<'_>, light: &mut EntityWorldMut<'_>) {
        if self.baked.lights.contains(&node.index()) {
            light.insert(Visibility::Hidden);
        }
    }
}

/// The bytes of a page, from the file or from beside it.
async fn bytes(
    page: &Page,
    load_context: &mut LoadContext<'_>,
    document: &gltf::Gltf,
    buffers: &[Vec<u8>],
) -> Result<Vec<u8>, Problem> {
    if let Some(uri) = &page.uri {
        let missing = |error: &dyn std::fmt::Display| format!("({uri}) cannot be read: {error}");
        let path = percent_decode_str(uri).decode_utf8().map_err(|error| missing(&error))?;
        let path = load_context.path().resolve_embed_str(&path).map_err(|error| missing(&error))?;
        return load_context.read_asset_bytes(path).await.map_err(|error| missing(&error));
    }
    let view = page.buffer_view.and_then(|index| document.views().nth(index));
    let bytes = view.and_then(|view| {
        let end = view.offset().checked_add(view.length())?;
        buffers.get(view.buffer().index())?.get(view.offset()..end)
    });
    bytes.map(<[u8]>::to_vec).ok_or_else(|| "has to be in a bufferView of the file or at a uri".into())
}

//! Shows the lightmaps of luxel (`LUXEL_lightmap`) in Bevy.
//!
//! ```no_run
//! use bevy::prelude::*;
//!
//! App::new().add_plugins((DefaultPlugins, luxel_bevy::LuxelPlugin)).run();
//! ```
//!
//! From then on every glTF file that Bevy loads shows its lightmap: meshes of lit nodes get Bevy's `Lightmap`, lights that
//! are in the map are hidden. If anything about the lightmap is wrong, the scene is as it would be without this plugin,
//! and one line of the log says why.

mod data;
mod handler;
mod page;

use bevy::{
    gltf::extensions::{ErasedGltfExtensionHandler, GltfExtensionHandlers},
    pbr::Lightmap,
    prelude::*,
};
use handler::Handler;

/// Reads lightmaps of glTF files. Comes after `GltfPlugin`, which is one of `DefaultPlugins`.
pub struct LuxelPlugin;

impl Plugin for LuxelPlugin {
    fn build(&self, app: &mut App) {
        // Scenes are spawned by reflection.
        app.register_type::<Lightmap>().register_type::<LightmapProblem>();
        let handlers = app.world_mut().get_resource_or_init::<GltfExtensionHandlers>();
        // Nobody loads anything yet, so the lock is free.
        let mut handlers = handlers.0.try_write().expect("plugins are added before files are loaded");
        handlers.push(Box::new(Handler::default()) as Box<dyn ErasedGltfExtensionHandler>);
    }
}

/// Why a scene is shown without its lightmap; stands on the scene's root.
#[derive(Component, Reflect, Clone, Default, Debug, PartialEq)]
#[reflect(Component, Default)]
pub struct LightmapProblem(pub String);

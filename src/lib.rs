//! luxel bakes global illumination into glTF scenes: a precomputed radiosity lightmap for every static surface.
//!
//! ```text
//! gltf::read -> Scene -> Tracer -> Atlas -> Patches -> Direct -> Transport -> Radiosity -> Lightmaps -> gltf::write
//! ```
//!
//! Each module is a room named after the one type that leaves it; a room imports only rooms listed above it.
//! [`bake::bake`] is the whole pipeline; [`chart`] holds its efforts against each other. Neither touches
//! a file: [`gltf`] holds the two doors.
//! [`preview`], [`render`] and [`inspect`] are for the eye.
//!
//! Units: metres, radiometric quantities without spectral weight; the lightmap stores irradiance E. Linear Rec. 709.

pub mod error;
pub mod files;
pub mod memory;
pub mod processor;
pub mod progress;
pub mod report;

pub mod math;
pub mod pixels;

pub mod scene;
pub mod trace;

pub mod atlas;
pub mod patches;

pub mod direct;
pub mod transport;

pub mod radiosity;

pub mod lightmaps;

pub mod audit;

pub mod gltf;

pub mod bake;

pub mod preview;

pub mod render;

pub mod inspect;

pub mod chart;

//! What the integration tests share: building scenes by hand, baking them, reading texels back.
#![allow(dead_code, reason = "each test binary uses a part of it")]

pub mod bakes;
pub mod exact;
pub mod gltf;
pub mod scenes;
pub mod stage;
pub mod ways;

//! Pictures in and out, LDR and HDR. The only place that knows the crates `image` and `exr`.

pub mod exr;
mod hdr;
mod ldr;
mod png;

pub use hdr::{Hdr, read_hdr};
pub use ldr::{Header, Ldr, decode, measure};
pub use png::encode_png;

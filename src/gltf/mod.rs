//! The two doors: `read` gives a [`Document`] and a [`crate::scene::Scene`], [`write`] binds lightmaps to the document.

mod document;
mod write;

pub use document::Document;
pub use write::{WriteOptions, write, write_flat};

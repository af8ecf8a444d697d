//! The two doors: [`read()`] gives a [`Document`] and a [`crate::scene::Scene`], [`write()`] binds lightmaps to the document.

mod document;
mod read;
mod uri;
mod write;

pub use document::{Document, External};
pub use read::{Bound, Input, ReadOptions, Record, bound, check_lights, open, read, read_scene, record};
pub use write::{Remarks, WriteOptions, check, write, write_flat};

//! How a bake tells its caller where it is, and how the caller stops it.

use crate::error::{Error, Result};

/// Watches a bake. Called from many threads.
pub trait Observer: Sync {
    /// Rooms that begin from here on belong to an attempt with so many rays a texel.
    fn attempt(&self, rays: u32) {
        let _ = rays;
    }
    /// A room begins; it will advance by `total` units in all (0: unknown).
    fn begin(&self, room: &'static str, total: u64) {
        let _ = (room, total);
    }
    /// Some units are done.
    fn advance(&self, units: u64) {
        let _ = units;
    }
    /// One line for the user, before anything takes long.
    fn plan(&self, line: &str) {
        let _ = line;
    }
    /// True once the user wants to stop.
    fn cancelled(&self) -> bool {
        false
    }
}

/// An observer that does not care.
pub struct Silent;

impl Observer for Silent {}

/// [`Error::Interrupted`] once the user wants to stop.
pub fn check(observer: &dyn Observer) -> Result<()> {
    if observer.cancelled() { Err(Error::Interrupted) } else { Ok(()) }
}

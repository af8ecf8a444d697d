//! Ctrl-C ends the program at once, and leaves no half of a file.
//!
//! While files are being written, which is short, signals go by: temporary files exist only then, and for an instant when
//! a folder is tried at the beginning.

use super::console;
use std::sync::{Mutex, MutexGuard, PoisonError, TryLockError};

/// Held while files are written, and by who ends the program: then no file is begun any more.
static WRITING: Mutex<()> = Mutex::new(());

/// Exit code of an interrupted program.
const INTERRUPTED: i32 = 130;

/// Begins to listen for Ctrl-C and requests to terminate.
pub fn listen() {
    let handler = || match WRITING.try_lock() {
        Err(TryLockError::WouldBlock) => console::note("the files are being written; this does not take long"),
        _held => {
            console::note("interrupted");
            std::process::exit(INTERRUPTED)
        }
    };
    // Without a handler Ctrl-C ends the program as it would any other.
    let _ = ctrlc::set_handler(handler);
}

/// Signals go by until this is dropped.
pub fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

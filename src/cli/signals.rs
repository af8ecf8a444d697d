//! Ctrl-C ends the program at once, and leaves no half of a file.
//!
//! While files are being written, which is short, signals go by: temporary files exist only then.

use super::console;
use luxel::{error::Result, files};
use std::{
    path::Path,
    sync::{Mutex, MutexGuard, PoisonError, TryLockError, mpsc},
    thread,
    time::Duration,
};

/// Held while files are written, and by who ends the program: then no file is begun any more.
static WRITING: Mutex<()> = Mutex::new(());

/// Exit code of an interrupted program.
const INTERRUPTED: i32 = 130;

/// Begins to listen for Ctrl-C and requests to terminate.
pub fn listen() {
    let handler = || match WRITING.try_lock() {
        Err(TryLockError::WouldBlock) => say("the files are being written; this does not take long"),
        _held => {
            say("interrupted");
            std::process::exit(INTERRUPTED)
        }
    };
    // Without a handler Ctrl-C ends the program as it would any other.
    let _ = ctrlc::set_handler(handler);
}

/// Nobody may be reading stderr: then what is said is not waited for.
fn say(line: &'static str) {
    let (said, heard) = mpsc::channel();
    thread::spawn(move || {
        console::note(line);
        said.send(())
    });
    let _ = heard.recv_timeout(Duration::from_millis(200));
}

/// Finds out whether a file can be written there, which begins one.
pub fn probe(file: &Path) -> Result<()> {
    let _writing = writing();
    files::probe(file)
}

/// Signals go by until this is dropped.
pub fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

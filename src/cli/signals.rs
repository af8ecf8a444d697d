//! Ctrl-C: the first asks the bake to stop, the second ends the program at once, and neither leaves half a file.
//!
//! While files are being written, which is short, signals wait: temporary files exist only then.

use super::console;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};

static STOP: AtomicBool = AtomicBool::new(false);
static WRITING: AtomicBool = AtomicBool::new(false);

/// Exit code of an interrupted program.
const INTERRUPTED: i32 = 130;

/// Begins to listen for Ctrl-C and requests to terminate.
pub fn listen() {
    let handler = || {
        let again = STOP.swap(true, SeqCst);
        if WRITING.load(SeqCst) {
            console::note("the files are being written; this does not take long");
        } else if again {
            std::process::exit(INTERRUPTED);
        } else {
            console::note("stopping; once more to end at once");
        }
    };
    // Without a handler Ctrl-C ends the program as it would any other.
    let _ = ctrlc::set_handler(handler);
}

/// True once the user wants to stop.
pub fn stopped() -> bool {
    STOP.load(SeqCst)
}

/// From here on signals wait for the program's end.
pub fn begin_writing() {
    WRITING.store(true, SeqCst);
}

//! Ctrl-C: the first asks a bake to stop, the second ends the program at once, and neither leaves half a file.
//!
//! While files are being written, which is short, signals wait: temporary files exist only then, and for an instant when
//! a folder is tried at the beginning.

use super::console;
use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, Ordering::SeqCst},
};

static STOP: AtomicBool = AtomicBool::new(false);
/// Locked while the program ends, too: then no file is begun any more.
static WRITING: Mutex<bool> = Mutex::new(false);

/// Exit code of an interrupted program.
const INTERRUPTED: i32 = 130;

/// Begins to listen for Ctrl-C and requests to terminate; who asks [`stopped`] now and then can tidy up.
pub fn listen() {
    on_signal(|| STOP.swap(true, SeqCst));
}

/// Likewise, where there is nothing to tidy up: the first ends the program.
pub fn listen_once() {
    on_signal(|| true);
}

/// `enough` tells whether the program is to end at once.
fn on_signal(enough: impl Fn() -> bool + Send + 'static) {
    let handler = move || {
        let enough = enough();
        let writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        if *writing {
            console::note("the files are being written; this does not take long");
        } else if enough {
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
    *WRITING.lock().unwrap_or_else(PoisonError::into_inner) = true;
}

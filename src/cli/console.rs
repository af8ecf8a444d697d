//! Lines for the user. A closed pipe ends the talk, never the program.

use super::signals;
use luxel::{
    error::{Error, Result},
    files,
};
use serde::Serialize;
use std::io::{ErrorKind, Write};
use std::path::Path;

/// A line on stderr, or several. Names come from files: they must not steer the terminal.
pub fn note(line: &str) {
    let tame = line.replace(|c: char| c.is_control() && c != '\n', "\u{fffd}");
    let _ = writeln!(std::io::stderr().lock(), "{tame}");
}

/// What was done, and is as it should be.
pub fn information(text: &str) {
    note(&format!("note: {text}"));
}

/// What the user should know.
pub fn warning(text: &str) {
    note(&format!("warning: {text}"));
}

/// Why it failed, and what to do.
pub fn error(error: &Error) {
    note(&format!("error: {error}"));
}

/// The result: `text` on stdout, or its JSON there or in a file beside it.
pub fn tell(told: &impl Serialize, file: Option<&Path>, on_stdout: bool, text: impl FnOnce() -> String) -> Result<()> {
    let json = || {
        let json = serde_json::to_string_pretty(told).map(|text| text + "\n");
        json.map_err(|e| Error::writing(file.unwrap_or(Path::new("-")), e.into()))
    };
    if let Some(file) = file {
        let json = json()?;
        let _writing = signals::writing();
        files::write_whole(file, |out| out.write_all(json.as_bytes()))?;
    }
    let text = if on_stdout { json()? } else { text() };
    print(&text)
}

/// The result, on stdout.
pub fn print(text: &str) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::writing(Path::new("standard output"), e)),
        _ => Ok(()),
    }
}

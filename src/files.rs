//! Files are read whole, if they are files at all, and appear whole or not at all: written beside their target, then
//! renamed.

use crate::error::{Error, Result};
use std::{
    fs::File,
    io::{self, BufWriter, Read, Write},
    path::{Path, PathBuf},
};

/// Bytes of the largest file that is read: what a GLB can hold.
const MAX_BYTES: u64 = 1 << 32;

/// The bytes of an ordinary file (a device or a pipe could go on for ever).
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let read = || {
        let found = std::fs::metadata(path)?;
        if !found.is_file() {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "is not an ordinary file"));
        }
        let mut bytes = Vec::new();
        if found.len() <= MAX_BYTES {
            bytes.reserve(found.len() as usize);
            File::open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
        }
        if found.len().max(bytes.len() as u64) > MAX_BYTES {
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, "is larger than 4 GB"));
        }
        Ok(bytes)
    };
    read().map_err(|e| Error::reading(path, e))
}

/// Writes the file `path` by `fill`; nothing changes on disk if anything fails.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let attempt = || {
        let mut file = temporary(path)?;
        let mut out = BufWriter::new(file.as_file_mut());
        fill(&mut out)?;
        out.flush()?;
        drop(out);
        file.persist(path).map_err(|e| e.error)
    };
    attempt().map(drop).map_err(|e| Error::writing(path, e))
}

/// Finds out whether a file can be made beside `path`, before anything takes long.
pub fn probe(path: &Path) -> Result<()> {
    temporary(path).map(drop).map_err(|e| Error::writing(path, e))
}

/// The folder of `path`; `.` for a bare name.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The file's place, whatever links and dots lead to it and whether it exists yet or not; its folder must exist.
pub fn place(path: &Path) -> Result<PathBuf> {
    if let Ok(place) = path.canonicalize() {
        return Ok(place);
    }
    let place = folder(path)
        .canonicalize()
        .map_err(|e| Error::writing(path, unusable(folder(path), &e.to_string(), e.kind())))?;
    Ok(place.join(path.file_name().unwrap_or_default()))
}

/// True if the name ends in one of these, in any case.
pub fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    let own = path.extension().and_then(|e| e.to_str());
    own.is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
}

/// A file without a name, in the folder of `path` to be.
pub(crate) fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".luxel-");
    // A temporary file is private by default; this one becomes an ordinary file, subject to the umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder(path)).map_err(|e| {
        // The reason names the temporary file, which means nothing to anybody.
        unusable(folder(path), e.to_string().split(" at path ").next().unwrap_or_default(), e.kind())
    })
}

fn unusable(folder: &Path, reason: &str, kind: io::ErrorKind) -> io::Error {
    io::Error::new(kind, format!("the folder {} cannot be used: {reason}", folder.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_whole(&path, |w| w.write_all(b"old")).unwrap();
        let failed = write_whole(&path, |w| {
            w.write_all(b"new")?;
            Err(io::Error::other("full"))
        });
        assert_eq!(failed.unwrap_err().exit_code(), 1);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_no_files() {
        assert!(read(Path::new("/dev/zero")).unwrap_err().to_string().contains("/dev/zero: is not an ordinary file"));
    }

    #[test]
    fn a_missing_folder_is_found_out_early() {
        let dir = tempfile::tempdir().unwrap();
        assert!(probe(&dir.path().join("a.txt")).is_ok());
        let missing = dir.path().join("none/a.txt");
        for error in [probe(&missing).unwrap_err(), place(&missing).map(drop).unwrap_err()] {
            assert!(error.to_string().contains("none cannot be used: "), "{error}");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_was_written() {
        use std::os::unix::fs::PermissionsExt;
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_whole(&path, |w| w.write_all(b"x")).unwrap();
        let plain = dir.path().join("b.txt");
        std::fs::write(&plain, b"x").unwrap();
        let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&plain));
    }
}

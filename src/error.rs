//! What can go wrong, by who has to act: each error says where it is and what to do about it.

use std::path::{Path, PathBuf};

/// Every way in which luxel fails. [`Error::exit_code`] is the program's.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The input file is broken: `place` names the file's part (mesh, primitive, accessor ...).
    #[error("{}: {place}: {problem}\n  {remedy}", file.display())]
    Invalid {
        /// The input file.
        file: PathBuf,
        /// The part of it, for example `mesh 3 "Wall", primitive 0`.
        place: String,
        /// What is wrong there.
        problem: String,
        /// What the user can do.
        remedy: String,
    },
    /// The input is valid, but uses something luxel does not read; `remedy` names the tool that converts it.
    #[error("{}: {feature} is not supported\n  {remedy}", file.display())]
    Unsupported {
        /// The input file.
        file: PathBuf,
        /// The extension or format.
        feature: String,
        /// What the user can do.
        remedy: String,
    },
    /// An option, or a combination of options, makes no sense.
    #[error("{0}")]
    Usage(String),
    /// A file cannot be read or written.
    #[error("{}: {source}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The system's reason.
        source: std::io::Error,
        /// True for an input file, which is the user's mistake rather than the machine's.
        input: bool,
    },
    /// What is to be done needs more memory than there is.
    #[error("this needs about {need_mb} MB, the machine has {free_mb} MB free\n  {remedy}")]
    Memory {
        /// Estimated need, in MB.
        need_mb: u64,
        /// Free memory, in MB.
        free_mb: u64,
        /// Which option to change.
        remedy: String,
    },
    /// The user stopped the bake.
    #[error("interrupted: nothing was written")]
    Interrupted,
}

/// Result with luxel's [`Error`].
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// 1 failed, 2 wrong usage, 3 input missing, invalid or unsupported, 130 interrupted.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Invalid { .. } | Error::Unsupported { .. } | Error::Io { input: true, .. } => 3,
            Error::Usage(_) => 2,
            Error::Io { .. } | Error::Memory { .. } => 1,
            Error::Interrupted => 130,
        }
    }

    /// [`Error::Invalid`] with everything said.
    pub fn invalid(
        file: &Path,
        place: impl Into<String>,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Error::Invalid { file: file.into(), place: place.into(), problem: problem.into(), remedy: remedy.into() }
    }

    /// [`Error::Unsupported`] with everything said.
    pub fn unsupported(file: &Path, feature: impl Into<String>, remedy: impl Into<String>) -> Self {
        Error::Unsupported { file: file.into(), feature: feature.into(), remedy: remedy.into() }
    }

    /// An input file that cannot be read.
    pub fn reading(file: &Path, source: std::io::Error) -> Self {
        Error::Io { file: file.into(), source, input: true }
    }

    /// An output file that cannot be written.
    pub fn writing(file: &Path, source: std::io::Error) -> Self {
        Error::Io { file: file.into(), source, input: false }
    }
}

//! Errors of loading MuJoCo's library.

use std::path::PathBuf;

/// Environment variable with the path of the library or its folder.
pub(crate) const VARIABLE: &str = "MOTORIUM_MUJOCO";

/// File name of the library.
pub(crate) const FILE: &str = "libmujoco.so.3.17.0";

/// MuJoCo's library cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LibraryError {
    /// The library was not found.
    #[error(
        "MuJoCo's library `{}` was not found; install it with `pip install mujoco==3.17.0` into the Python of your \
         path, or set {} to the library or its folder",
        FILE,
        VARIABLE
    )]
    Missing,
    /// The environment variable does not point to the library.
    #[error(
        "{} is set to `{}`, which does not contain `{}`; install it with `pip install mujoco==3.17.0`",
        VARIABLE, path.display(), FILE
    )]
    Elsewhere {
        /// Value of the environment variable.
        path: PathBuf,
    },
    /// The library cannot be loaded.
    #[error("MuJoCo's library `{}` cannot be loaded: {reason}", path.display())]
    Unusable {
        /// Path of the library.
        path: PathBuf,
        /// Message of the system's loader.
        reason: String,
    },
    /// The library has an unsupported version.
    #[error(
        "MuJoCo's library `{}` has version {found}, expected 3.17.0, the only version whose memory layout is supported; \
         install it with `pip install mujoco==3.17.0`",
        path.display()
    )]
    Version {
        /// Path of the library.
        path: PathBuf,
        /// Version that the library reports.
        found: String,
    },
}

//! Errors of loading MuJoCo's library.

use std::path::PathBuf;

/// Environment variable with the path of the library or its folder.
pub(crate) const VARIABLE: &str = "MOTORIUM_MUJOCO";

/// File name of the library.
pub(crate) const FILE: &str = "libmujoco.so.3.17.0";

/// An error in loading MuJoCo's library.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LibraryError {
    /// The library was not found.
    #[error(
        "MuJoCo's library `{}` was not found; install it by `pip install mujoco==3.17.0` into the Python of your \
         path, or set {} to the library or its folder",
        FILE,
        VARIABLE
    )]
    Missing,
    /// The variable does not name the library.
    #[error(
        "{} is `{}`, where there is no `{}`; `pip install mujoco==3.17.0` installs it",
        VARIABLE, path.display(), FILE
    )]
    Elsewhere {
        /// Value of the variable.
        path: PathBuf,
    },
    /// The library cannot be loaded.
    #[error("MuJoCo's library `{}` cannot be loaded: {reason}", path.display())]
    Unusable {
        /// Path of the library.
        path: PathBuf,
        /// Message from the system's loader.
        reason: String,
    },
    /// The library has an unsupported version.
    #[error(
        "MuJoCo's library `{}` is of version {found}, expected 3.17.0, whose memory layout motorium knows; \
         `pip install mujoco==3.17.0` installs it",
        path.display()
    )]
    Version {
        /// Path of the library.
        path: PathBuf,
        /// Reported version.
        found: String,
    },
}

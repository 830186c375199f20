//! Readers and writers of robot files, and their options.

pub(crate) mod colours;
pub(crate) mod format;
pub(crate) mod lines;
pub mod mjcf;
pub(crate) mod options;
pub(crate) mod packages;
pub(crate) mod urdf;

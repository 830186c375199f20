//! Robots ready to use: loading by name or path, settings from graph files, draft profiles.

pub(crate) mod digest;
pub(crate) mod draft;
pub(crate) mod drawn;
pub(crate) mod end_effector;
pub(crate) mod installed;
pub(crate) mod joint_subset;
pub(crate) mod load;
pub(crate) mod mesh_references;
pub(crate) mod meshes;
pub(crate) mod postures;
pub(crate) mod setting_error;
pub(crate) mod settings;
pub(crate) mod source;

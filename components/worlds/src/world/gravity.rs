//! Gravity of a world file.

use std::path::Path;

use super::WorldFileError;
use super::file::read;
use super::{EARTH, World};

/// Returns the gravity of a [world file](World::file) \[m/s2\]. The default is 9.81 m/s2 downwards.
///
/// # Errors
///
/// [`WorldFileError`], if the file cannot be read as a world.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("moon.xml");
/// std::fs::write(&path, r#"<mujoco><option gravity="0 0 -1.62"/></mujoco>"#)?;
/// assert_eq!(motorium_worlds::gravity_of_file(&path)?, [0.0, 0.0, -1.62]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn gravity_of_file(path: &Path) -> Result<[f64; 3], WorldFileError> {
    let read = read(path)?;
    let World { gravity, .. } = read.world;
    Ok(if read.states_gravity { gravity } else { EARTH })
}

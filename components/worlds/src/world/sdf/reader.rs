//! State of the SDF reader.

use std::cell::RefCell;
use std::path::Path;

use motorium_robots::{ModelWarning, Position};

use crate::World;

/// Reads the elements of an SDF file into a world.
pub(super) struct Reader<'p> {
    pub(super) path: &'p Path,
    pub(super) world: World,
    pub(super) warnings: RefCell<Vec<ModelWarning>>,
    /// Position of the first `<bounce>` with a restitution above 0.
    pub(super) first_bounce: Option<Position>,
}

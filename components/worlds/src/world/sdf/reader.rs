//! The state of a reader of SDF.

use std::cell::RefCell;
use std::path::Path;

use motorium_robots::{ModelWarning, Position};

use crate::World;

/// Reads the elements of a file into a world.
pub(super) struct Reader<'p> {
    pub(super) path: &'p Path,
    pub(super) world: World,
    pub(super) warnings: RefCell<Vec<ModelWarning>>,
    /// The first collision that rebounds.
    pub(super) first_bounce: Option<Position>,
}

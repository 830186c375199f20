//! The parts of one solve.

use super::{ActiveSetSettings, Work};
use crate::{Problem, Solution};

/// One solve.
pub(super) struct Run<'a> {
    pub(super) problem: &'a Problem,
    pub(super) settings: ActiveSetSettings,
    pub(super) work: &'a mut Work,
    pub(super) solution: &'a mut Solution,
}

//! The data of one solve.

use super::settings::ActiveSetSettings;
use super::work::Work;
use crate::{Problem, Solution};

/// One solve.
pub(super) struct Run<'a> {
    pub(super) problem: &'a Problem,
    pub(super) settings: ActiveSetSettings,
    pub(super) work: &'a mut Work,
    pub(super) solution: &'a mut Solution,
}

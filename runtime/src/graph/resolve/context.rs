//! The environment in which a graph is resolved.

use std::cell::OnceCell;
use std::path::Path;

use super::siblings::{Home, Homeless, Siblings};
use crate::graph::machine::Machine;
use crate::graph::source::Sources;
use crate::worker::Registry;

/// The file, the registry and the machine for which a graph is resolved.
pub(in crate::graph) struct Context<'c> {
    /// The graph file.
    pub(super) file: &'c Path,
    /// All texts; relative paths refer to the folder of their file.
    pub(super) sources: &'c Sources,
    /// Kinds of components, and robots.
    pub(super) registry: &'c Registry,
    /// The machine on which the graph will run.
    pub(super) machine: &'c Machine,
    /// Other programs that host kinds and were queried.
    siblings: Siblings,
    /// Gravity of the world file, in TOML notation; empty until the file is read, `None` if the gravity is
    /// unavailable.
    pub(super) gravity: OnceCell<Option<[String; 3]>>,
}

impl<'c> Context<'c> {
    pub(in crate::graph) fn new(
        file: &'c Path,
        sources: &'c Sources,
        registry: &'c Registry,
        machine: &'c Machine,
    ) -> Self {
        Self { file, sources, registry, machine, siblings: Siblings::default(), gravity: OnceCell::new() }
    }

    /// Returns the program that hosts a kind.
    pub(super) fn home(&self, kind: &str) -> Result<Home<'c>, Homeless> {
        self.siblings.home(kind, self.registry)
    }
}

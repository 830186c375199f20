//! A component between its table and its plan.

use crate::declare::{Declaration, Direction, Placement, PortDeclaration, RobotReference};
use crate::graph::defaults;
use crate::graph::model::ComponentTable;
use crate::graph::read::good_or;
use crate::graph::source::Span;
use crate::graph::values::Schedule;
use crate::plan::Program;

/// A partially resolved component.
pub(super) struct Draft<'g, 'i> {
    /// Its name.
    pub(super) name: &'g str,
    /// Position of its name.
    pub(super) place: Span,
    /// Its table in the file.
    pub(super) table: &'g ComponentTable<'i>,
    /// The robot it works on.
    pub(super) robot: Option<RobotReference>,
    /// The robots it works on, from `robots`.
    pub(super) robots: Vec<RobotReference>,
    /// Its period, clock and folder.
    pub(super) placement: Placement,
    /// Its program.
    pub(super) program: Option<Program>,
    /// Its `config` table.
    pub(super) config: serde_json::Value,
    /// Its declaration; `None` if the query failed, which has been reported.
    pub(super) declaration: Option<Declaration>,
    /// Wall time of its declaration, ns.
    pub(super) declare_ns: u64,
}

impl Draft<'_, '_> {
    /// Returns its kind or its program, for messages.
    pub(super) fn what(&self) -> String {
        match &self.program {
            Some(Program::Builtin { kind } | Program::Sibling { kind, .. }) => format!("`{kind}`"),
            Some(Program::Exec { path }) => format!("`{}`", path.display()),
            None => format!("component `{}`", self.name),
        }
    }

    /// Returns its scheduling class: from the file, or else as declared.
    pub(super) fn schedule(&self) -> Schedule {
        let declared = self.declaration.as_ref().is_some_and(|declared| declared.not_real_time.is_some());
        let default = if declared { Schedule::Normal } else { defaults::SCHEDULE };
        good_or(&self.table.schedule, default)
    }

    /// Returns its declared ports of one direction, in order of declaration.
    pub(super) fn ports(&self, direction: Direction) -> impl Iterator<Item = &PortDeclaration> {
        self.declaration.iter().flat_map(|d| &d.ports).filter(move |port| port.direction == direction)
    }

    /// Returns `true` if it declares that it is an actuator.
    pub(super) fn is_actuator(&self) -> bool {
        self.declaration.as_ref().is_some_and(|declaration| declaration.actuator)
    }
}

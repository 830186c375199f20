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
    /// Name of the component.
    pub(super) name: &'g str,
    /// Position of the component's name in the file.
    pub(super) place: Span,
    /// Table of the component in the file.
    pub(super) table: &'g ComponentTable<'i>,
    /// Robot on which the component works, from `robot`.
    pub(super) robot: Option<RobotReference>,
    /// Robots on which the component works, from `robots`.
    pub(super) robots: Vec<RobotReference>,
    /// Placement of the component in the graph: period, clock and folder.
    pub(super) placement: Placement,
    /// Program that runs the component.
    pub(super) program: Option<Program>,
    /// The `config` table of the component.
    pub(super) config: serde_json::Value,
    /// Declaration of the component; `None` if the query failed. The error has then been reported.
    pub(super) declaration: Option<Declaration>,
    /// Wall time of the component's declaration, ns.
    pub(super) declare_ns: u64,
}

impl Draft<'_, '_> {
    /// Returns the kind or the program of the component, for messages.
    pub(super) fn what(&self) -> String {
        match &self.program {
            Some(Program::Builtin { kind } | Program::Sibling { kind, .. }) => format!("`{kind}`"),
            Some(Program::Exec { path }) => format!("`{}`", path.display()),
            None => format!("component `{}`", self.name),
        }
    }

    /// Returns the scheduling class of the component: from the file, or else as declared.
    pub(super) fn schedule(&self) -> Schedule {
        let declared = self.declaration.as_ref().is_some_and(|declared| declared.not_real_time.is_some());
        let default = if declared { Schedule::Normal } else { defaults::SCHEDULE };
        good_or(&self.table.schedule, default)
    }

    /// Returns the component's declared ports of one direction, in order of declaration.
    pub(super) fn ports(&self, direction: Direction) -> impl Iterator<Item = &PortDeclaration> {
        self.declaration.iter().flat_map(|d| &d.ports).filter(move |port| port.direction == direction)
    }

    /// Returns `true` if the component declares that it is an actuator.
    pub(super) fn is_actuator(&self) -> bool {
        self.declaration.as_ref().is_some_and(|declaration| declaration.actuator)
    }
}

//! The events of a run.

use super::Status;
use crate::plan::Plan;
use crate::region::Latch;

/// An event of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// The run's services exist; its components are being started.
    Created {
        /// The run's name.
        run: &'a str,
        /// The plan.
        plan: &'a Plan,
    },
    /// The requests that the system denied, in one line.
    Lost(&'a str),
    /// Every port is connected; the first step is due.
    Started,
    /// A line a component printed.
    Output {
        /// The component.
        component: &'a str,
        /// The line.
        line: &'a str,
    },
    /// A component failed.
    Failed {
        /// The component.
        component: &'a str,
        /// Index of the step at which it failed.
        tick: u64,
        /// The reason.
        reason: &'a str,
        /// The consequence.
        consequence: &'a str,
    },
    /// A restarted component steps again.
    Restarted {
        /// The component.
        component: &'a str,
        /// Time from its end to its first step, ns.
        after_ns: u64,
    },
    /// The graph goes to its safe state.
    SafeStop {
        /// The reason.
        reason: &'a str,
    },
    /// The actuators are in their safe state.
    Safe {
        /// Time from the detection of the cause to the last actuator's safe state, ns.
        after_ns: u64,
    },
    /// Not all actuators reached their safe state.
    NotSafe {
        /// Actuators without a process.
        dead: &'a [&'a str],
        /// Living ones that did not report their safe state in time.
        late: &'a [&'a str],
        /// Those in their safe state.
        safe: &'a [&'a str],
    },
    /// The actuators stay in their safe state until `motorium resume`; the run goes on.
    Stopped {
        /// The kind of the stop.
        latch: Latch,
        /// Who stopped them.
        cause: &'a str,
    },
    /// The stop was released: the actuators come back to their commands.
    Resumed,
    /// A component loses more of its steps than the graph allows.
    LosesSteps {
        /// The component.
        component: &'a str,
        /// Share of its steps that it lost in the last second.
        share: f64,
    },
    /// In lockstep: a step has not ended, and simulated time stands still.
    Waiting {
        /// The component.
        component: &'a str,
        /// Index of the step.
        tick: u64,
        /// Time since its beginning, ns.
        for_ns: u64,
    },
    /// The run ends, but not as the graph asks.
    Warning(&'a str),
    /// The status of the graph.
    Status(&'a Status),
}

//! The output `diagnostics` of `control.qp`.

use std::time::Instant;

use motorium::declare::ClockKind;
use motorium::prelude::*;
use motorium::state::{ControlDiagnostics, MAX_TASKS};
use motorium_qp::Side;

use crate::inverse_dynamics::ConstraintName;

/// Output of [`ControlDiagnostics`]. While it is not wired, no statistics are computed and no time is
/// measured.
pub(super) struct DiagnosticsOutput {
    output: Output<ControlDiagnostics>,
    /// `true` in real time. In lockstep a measured time would differ from run to run.
    timed: bool,
    began: Option<Instant>,
    solve_ns: u64,
}

impl DiagnosticsOutput {
    pub(super) fn declare(declare: &mut Declare) {
        let doc = "task residuals, active constraints, slack and solver statistics of each step";
        declare.output::<ControlDiagnostics>("diagnostics", doc);
    }

    pub(super) fn configure(setup: &mut Setup) -> Result<Self, ConfigureError> {
        let timed = setup.clock().kind() == ClockKind::Realtime;
        Ok(Self { output: setup.output("diagnostics")?, timed, began: None, solve_ns: 0 })
    }

    /// Starts a step with zero solver time.
    pub(super) fn begin_step(&mut self) {
        self.solve_ns = 0;
    }

    /// Starts measuring the solver time.
    pub(super) fn begin_solve(&mut self) {
        self.began = (self.timed && self.output.is_wired()).then(Instant::now);
    }

    /// Stops measuring the solver time.
    pub(super) fn end_solve(&mut self) {
        self.solve_ns += self.began.take().map_or(0, |began| began.elapsed().as_nanos() as u64);
    }

    /// Publishes the message completed by `write`, if the output is wired. Initially the message contains the
    /// solver time, a zero residual per task of `tasks`, and zeros.
    pub(super) fn publish(
        &mut self,
        tasks: usize,
        write: impl FnOnce(&mut ControlDiagnostics),
    ) -> Result<(), StepError> {
        if !self.output.is_wired() {
            return Ok(());
        }
        let mut message = self.output.loan()?;
        message.status = ControlDiagnostics::UNSOLVED;
        (message.iterations, message.undecided, message.solve_time) = (0, 0, self.solve_ns);
        (message.contact_slack, message.joint_slack) = (0.0, 0.0);
        message.set_count(tasks.min(MAX_TASKS));
        message.residual_mut().fill(0.0);
        message.clear_active();
        write(&mut message);
        message.publish()
    }
}

fn sign(side: Side) -> i32 {
    match side {
        Side::Lower => ControlDiagnostics::LOWER,
        Side::Upper => ControlDiagnostics::UPPER,
    }
}

/// Adds a constraint; `point` is the index of a point of a contact among the points of all contacts.
pub(super) fn push_name(
    message: &mut ControlDiagnostics,
    name: ConstraintName,
    point: impl Fn(usize, usize) -> usize,
) {
    let (constraint, index, side) = match name {
        ConstraintName::Base { axis } => (ControlDiagnostics::BASE, axis, 0),
        ConstraintName::Motion { contact, axis } => (ControlDiagnostics::MOTION, 6 * contact + axis, 0),
        ConstraintName::Torque { joint, side } => (ControlDiagnostics::TORQUE, joint, sign(side)),
        ConstraintName::Friction { contact, point: index } => {
            (ControlDiagnostics::FRICTION, point(contact, index), 0)
        }
        ConstraintName::Force { contact, point: index, side } => {
            (ControlDiagnostics::FORCE, point(contact, index), sign(side))
        }
        ConstraintName::Wrench { contact } => (ControlDiagnostics::FRICTION, point(contact, 0), 0),
        ConstraintName::Velocity { velocity: joint, side } | ConstraintName::Acceleration { joint, side } => {
            (ControlDiagnostics::JOINT, joint, sign(side))
        }
        ConstraintName::Limit { row, side } => (ControlDiagnostics::ROW, row, sign(side)),
        ConstraintName::Task { row } => (ControlDiagnostics::ROW, row, 0),
    };
    message.push_active(constraint, index, side);
}

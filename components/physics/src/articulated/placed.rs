//! Placed articulations in the articulated engine: contacts see their velocity, but no impulse changes it.

use motorium_robots::Kinematics;

use super::{JointEvents, JointSpaceIntegrator, Part};
use crate::robot::{Articulation, State};

impl Part {
    /// Returns the kinematics at the start of a step. For a placed articulation, this is the state from which
    /// it arrives at its placed state.
    pub(super) fn start<'a>(&'a self, own: &'a Articulation) -> &'a Kinematics {
        if own.placed { &self.kinematics } else { &own.kinematics }
    }

    /// Begins a step of a placed articulation from the next state, which still equals the state at the start.
    pub(super) fn begin_placed(&mut self, own: &Articulation, state: &State) {
        let (q, v) = (&state.q_next[own.q()], &state.v_next[own.v()]);
        self.kinematics.update_with_velocity(&own.model, q, v);
        self.momentum = None;
    }

    /// Begins an integration step with the velocity of the next state, which no impulse changes.
    pub(super) fn hold_velocity(&mut self, own: &Articulation, state: &State) {
        self.integrator.hold(&state.v_next[own.v()]);
        (self.pending, self.settled) = (false, true);
    }

    /// Ends an integration step.
    pub(super) fn finish_placed(&mut self, own: &Articulation, state: &mut State) -> JointEvents {
        let State { q_next, v_next, .. } = state;
        let next = (&mut q_next[own.q()], &mut v_next[own.v()]);
        JointSpaceIntegrator::finish_held(&own.model, next, self.h);
        JointEvents::default()
    }
}

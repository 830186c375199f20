//! Articulations that are moved from outside instead of by forces and drives.
//!
//! Every step of a placed articulation ends in its placed state to the bit. During the step its links move
//! along the placed velocity and arrive at the placed configuration, so contacts see the same motion as if
//! its drives had moved it there.

use crate::robot::{Articulation, Robot};
use crate::{JointCommand, ResetError};

impl Articulation {
    /// Returns `true` if the articulation is [placed](crate::Simulator::place), so that no force moves it.
    pub fn is_placed(&self) -> bool {
        self.placed
    }
}

impl Robot {
    /// Sets the state of one articulation, which no force moves from then on. Returns `true` if its drives
    /// moved it before.
    pub(crate) fn place(&mut self, articulation: usize, q: &[f64], v: &[f64]) -> Result<bool, ResetError> {
        let own = &mut self.articulations[articulation];
        let expected = (own.q().len(), own.v().len());
        if (q.len(), v.len()) != expected {
            return Err(ResetError::Length { positions: q.len(), velocities: v.len(), expected });
        }
        ResetError::check(&own.model, q, v, own.joints().start)?;
        let begins = !own.placed;
        if begins {
            own.placed = true;
            self.commands[own.drives()].fill(JointCommand::default());
            self.state.clear_efforts(own.drives());
        }
        self.state.q[own.q()].copy_from_slice(q);
        self.state.v[own.v()].copy_from_slice(v);
        own.refresh(&mut self.state);
        Ok(begins)
    }

    /// Returns an articulation to its drives. Returns `false` if they moved it already.
    pub(crate) fn release(&mut self, articulation: usize) -> bool {
        core::mem::take(&mut self.articulations[articulation].placed)
    }

    /// Moves the next state of placed articulations back to the start of a step of `dt` \[s\], from which
    /// they arrive at their placed state.
    pub(crate) fn step_back(&mut self, dt: f64) {
        let Self { articulations, state, .. } = self;
        for own in articulations.iter().filter(|own| own.placed) {
            let (v, v_next) = (&state.v[own.v()], &mut state.v_next[own.v()]);
            v_next.iter_mut().zip(v).for_each(|(back, v)| *back = -dt * v);
            own.model.integrate(&state.q[own.q()], v_next, &mut state.q_next[own.q()]);
            v_next.copy_from_slice(v);
        }
    }

    /// Ends a step of placed articulations in their placed state.
    pub(crate) fn arrive(&mut self) {
        let Self { articulations, state, .. } = self;
        for own in articulations.iter().filter(|own| own.placed) {
            state.q_next[own.q()].copy_from_slice(&state.q[own.q()]);
            state.v_next[own.v()].copy_from_slice(&state.v[own.v()]);
            state.tau_next[own.drives()].fill(0.0);
        }
    }
}

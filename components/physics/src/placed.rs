//! Articulations whose motion the caller prescribes, instead of forces and drives.
//!
//! Every step of a placed articulation ends in exactly its placed state. During the step, its links move from
//! their poses after the last step to the placed configuration. Contacts therefore see the same motion as if
//! drives had moved the links.
//!
//! The placed velocity may not match this motion, for example after a discontinuity or if the same state is
//! placed again. In this case, the links approach the placed configuration along the placed velocity.

use crate::robot::{Articulation, Robot};
use crate::{JointSetpoint, ResetError};

impl Articulation {
    /// Returns `true` if the articulation with this index is [placed](crate::Simulator::place_at), so that no
    /// force moves it.
    pub fn is_placed(&self) -> bool {
        self.placed
    }
}

impl Robot {
    /// Sets the state of one articulation, which no force moves from then on. Returns `true` if its drives
    /// moved it before.
    pub(crate) fn place_at(&mut self, articulation: usize, q: &[f64], v: &[f64]) -> Result<bool, ResetError> {
        let own = &mut self.articulations[articulation];
        let expected = (own.q().len(), own.v().len());
        if (q.len(), v.len()) != expected {
            return Err(ResetError::Length { positions: q.len(), velocities: v.len(), expected });
        }
        ResetError::check(&own.model, q, v, own.joints().start)?;
        let begins = !own.placed;
        if begins {
            own.placed = true;
            self.commands[own.drives()].fill(JointSetpoint::default());
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

    /// Sets the next state of placed articulations to the start of a step of `dt` \[s\], with the velocity
    /// that moves them from there to their placed configuration. If the placed velocity agrees with the mean
    /// velocity of this motion, they start at the end of the last step with the mean velocity. Otherwise they
    /// start where the placed velocity leads to the placed configuration.
    pub(crate) fn step_back(&mut self, dt: f64) {
        let Self { articulations, state, .. } = self;
        for own in articulations.iter().filter(|own| own.placed) {
            let (q, v, last) = (&state.q[own.q()], &state.v[own.v()], &state.q_last[own.q()]);
            let (q_next, v_next) = (&mut state.q_next[own.q()], &mut state.v_next[own.v()]);
            own.model.difference(last, q, v_next);
            v_next.iter_mut().for_each(|mean| *mean /= dt);
            if is_continuous(v_next, v) {
                q_next.copy_from_slice(last);
                continue;
            }
            v_next.iter_mut().zip(v).for_each(|(back, v)| *back = -dt * v);
            own.model.integrate(q, v_next, q_next);
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

/// Largest difference of the mean velocity of a continuous motion from the velocity at its end, as a fraction
/// of the latter.
const CONTINUOUS: f64 = 0.5;

/// Returns `true` if a motion of mean velocity `mean` may end with velocity `v`.
fn is_continuous(mean: &[f64], v: &[f64]) -> bool {
    let squares = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(|x| x * x).sum::<f64>();
    let apart = squares(&mut mean.iter().zip(v).map(|(mean, v)| mean - v));
    apart <= CONTINUOUS * CONTINUOUS * squares(&mut v.iter().copied())
}

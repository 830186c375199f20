//! Computation of the velocity at the end of an integration step, on which drives, friction, stops and
//! external impulses depend.

use motorium_robots::{MassFactor, Model};
use nalgebra::DMatrix;

use super::events::JointEvents;
use super::laws::{Drive, Friction, Laws, Mode, START};
use crate::JointSetpoint;
use crate::joint::JointProperties;

/// The mass matrix is singular: the joint with this index in `v` moves no inertia.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the mass matrix is singular: the joint at index {0} of the velocity moves no inertia")]
pub struct Singular(pub usize);

/// Quantities at the start of a step.
pub(super) struct Start<'a> {
    /// Positions of the joints.
    pub(super) q: &'a [f64],
    /// Complete velocity vector; the entries of a floating base come first.
    pub(super) v: &'a [f64],
    /// Length of the step \[s\].
    pub(super) h: f64,
    pub(super) mass: &'a DMatrix<f64>,
    /// C(q, v) v + g(q), minus external forces.
    pub(super) bias: &'a [f64],
}

/// Workspace of the active-set iteration.
#[derive(Clone, Debug)]
pub(super) struct ImplicitSolver {
    modes: Vec<Mode>,
    laws: Vec<Laws>,
    system: DMatrix<f64>,
    pub(super) factor: MassFactor,
    /// True for entries whose velocity is fixed by a mode.
    pub(super) held: Vec<bool>,
    /// Generalized external impulse (nv).
    pub(super) impulse: Vec<f64>,
    /// True for joints whose acceleration limit changed their effort in the last step.
    restrained: Vec<bool>,
}

/// Maximum number of sweeps of the relaxation, the fallback if the active set cycles.
const SWEEPS: usize = 200;

/// Number of mode guesses before the fallback to relaxation. The first guess is nearly always confirmed.
pub(super) const GUESSES: usize = 24;

/// Number of further guesses with secants of the drives ([`ImplicitSolver::confirm_secants`]) in a step with
/// contacts. The relaxation would keep the contact impulses of the last guess, which do not fit its
/// velocities, and add energy.
pub(super) const SECANT_GUESSES: usize = 200;

impl ImplicitSolver {
    pub(super) fn new(model: &Model) -> Self {
        let n = model.nv();
        Self {
            modes: vec![START; n],
            laws: Vec::with_capacity(n),
            system: DMatrix::zeros(n, n),
            factor: MassFactor::new(model),
            held: vec![false; n],
            impulse: vec![0.0; n],
            restrained: vec![false; model.joint_count()],
        }
    }

    pub(super) fn restrained(&self) -> &[bool] {
        &self.restrained
    }

    pub(super) fn forget(&mut self) {
        self.modes.fill(START);
    }

    pub(super) fn modes(&self) -> &[Mode] {
        &self.modes
    }

    pub(super) fn set_modes(&mut self, modes: &[Mode]) -> bool {
        let fits = modes.len() == self.modes.len();
        if fits {
            self.modes.copy_from_slice(modes);
        }
        fits
    }

    /// Begins a step: computes the laws of all joints, with the acceleration limits of `commands` if it is
    /// `restrained`. In a midpoint step, `middle` contains the positions at
    /// the midpoint.
    pub(super) fn begin(
        &mut self,
        (joints, commands, bounds): (&[JointProperties], &[JointSetpoint], &[[f64; 2]]),
        (start, restrained): (&Start<'_>, bool),
        middle: Option<&[f64]>,
    ) {
        let offset = start.v.len() - joints.len();
        self.laws.clear();
        self.laws.resize(offset, Laws::FREE);
        for (i, (joint, command)) in joints.iter().zip(commands).enumerate() {
            let laws = Laws::new(joint, command, bounds[i], (start.q[i], start.h));
            let mut laws = match middle {
                Some(middle) => laws.midway(joint, [start.q[i], middle[i]], start.h),
                None => laws,
            };
            if restrained && command.max_acceleration.is_finite() {
                let now = (start.q[i], start.v[offset + i]);
                laws.restrain(command.end_velocities(now, [joint.lower, joint.upper], start.h));
            }
            let mode = &mut self.modes[offset + i];
            if mode.drive.is_restrained() && !laws.has_window() {
                mode.drive = Drive::Linear;
            }
            self.laws.push(laws);
            match (joint.friction > 0.0, mode.friction) {
                (true, Friction::None) => mode.friction = Friction::Stick,
                (false, _) => mode.friction = Friction::None,
                _ => {}
            }
        }
    }

    /// Fixes all velocities, so that impulses do not change them.
    pub(super) fn hold(&mut self) {
        self.held.fill(true);
        self.impulse.fill(0.0);
    }

    /// Returns `true` if the end velocity `x`, with the external impulses, confirms the modes. Otherwise sets
    /// the modes that `x` implies.
    pub(super) fn confirm(&mut self, start: &Start<'_>, x: &mut [f64]) -> bool {
        // A velocity fixed by a mode stays exact.
        for ((laws, mode), x) in self.laws.iter().zip(&self.modes).zip(x.iter_mut()) {
            if let Some(velocity) = laws.fixed(mode) {
                *x = velocity;
            }
        }
        let mut settled = true;
        for (i, (laws, mode)) in self.laws.iter().zip(&mut self.modes).enumerate() {
            let (constant, slope) = laws.force(mode);
            // The holding force is only needed for a fixed velocity.
            let missing = if laws.fixed(mode).is_some() {
                let outside = start.bias[i] - self.impulse[i] / start.h;
                inertial(start, x, i) / start.h + outside - (constant - slope * x[i])
            } else {
                0.0
            };
            let explained = laws.explain(mode, x[i], missing);
            settled &= explained == *mode;
            *mode = explained;
        }
        settled
    }

    /// Returns `true` if the end velocity `x` confirms the modes, up to a small error of the drive efforts.
    /// Otherwise replaces each saturated drive by a viscous one with the same effort at `x`.
    ///
    /// The branches of drives that saturate against contacts may cycle. The potential of the viscous drive is
    /// nowhere below the saturated drive's and touches it at `x`, so every guess lowers the convex objective
    /// of the step, as in iteratively reweighted least squares.
    pub(super) fn confirm_secants(&mut self, start: &Start<'_>, x: &mut [f64]) -> bool {
        let mut settled = true;
        for i in 0..x.len() {
            let (laws, mode) = (&mut self.laws[i], self.modes[i]);
            let mut missing = 0.0;
            if let Some(velocity) = laws.fixed(&mode) {
                x[i] = velocity;
            }
            let (constant, slope) = laws.force(&mode);
            if laws.fixed(&mode).is_some() {
                let outside = start.bias[i] - self.impulse[i] / start.h;
                missing = inertial(start, x, i) / start.h + outside - (constant - slope * x[i]);
            }
            let mut next = Mode { drive: mode.drive, ..laws.explain(&mode, x[i], missing) };
            settled &= next == mode;
            settled &= laws.take_secant(&mut next.drive, x[i]);
            self.modes[i] = next;
        }
        settled
    }

    /// Returns from secants of the drives to the branches of their laws at the end velocity `x`.
    pub(super) fn leave_secants(&mut self, x: &[f64]) {
        for ((laws, mode), x) in self.laws.iter().zip(&mut self.modes).zip(x) {
            if mode.drive == Drive::Secant {
                mode.drive = laws.drive_mode(Drive::Linear, *x);
            }
        }
    }

    /// Ends a step: computes the efforts of the drives (one per joint) at the end velocity `x`.
    pub(super) fn finish(&mut self, start: &Start<'_>, x: &[f64], tau: &mut [f64]) -> JointEvents {
        let mut events = JointEvents::default();
        let offset = x.len() - tau.len();
        for (joint, (laws, tau)) in self.laws[offset..].iter().zip(tau).enumerate() {
            let (i, at) = (offset + joint, x[offset + joint]);
            (*tau, self.restrained[joint]) = laws.restrained_drive(at, || {
                let outside = start.bias[i] - self.impulse[i] / start.h;
                let friction = if at == 0.0 { 0.0 } else { laws.friction.copysign(at) };
                inertial(start, x, i) / start.h + outside - laws.passive_force(at) + friction
            });
            let x = &at;
            events.saturated += usize::from(laws.is_saturated(*x));
            events.at_limit += usize::from(*x == laws.slowest || *x == laws.fastest);
        }
        events
    }

    /// Computes the end velocity `x` (nv) for the current modes, without external impulses. Joints with a
    /// fixed velocity are eliminated from the linear system.
    pub(super) fn solve_modes(&mut self, start: &Start<'_>, x: &mut [f64]) -> Result<(), Singular> {
        self.system.copy_from(start.mass);
        for (i, (laws, mode)) in self.laws.iter().zip(&self.modes).enumerate() {
            let (constant, slope) = laws.force(mode);
            self.system[(i, i)] += start.h * slope;
            x[i] = start.h * (constant - start.bias[i]);
        }
        // Column by column, because the matrix is stored in column-major order.
        for (column, v) in start.mass.as_slice().chunks_exact(start.v.len()).zip(start.v) {
            for (x, entry) in x.iter_mut().zip(column) {
                *x += entry * v;
            }
        }
        for (i, (laws, mode)) in self.laws.iter().zip(&self.modes).enumerate() {
            let fixed = laws.fixed(mode);
            self.held[i] = fixed.is_some();
            let Some(velocity) = fixed else { continue };
            for (j, x) in x.iter_mut().enumerate() {
                *x -= self.system[(j, i)] * velocity;
                self.system[(i, j)] = 0.0;
                self.system[(j, i)] = 0.0;
            }
            self.system[(i, i)] = 1.0;
            x[i] = velocity;
        }
        self.factor.factor(&self.system).map_err(|singular| Singular(singular.index))?;
        self.factor.solve(x);
        self.impulse.fill(0.0);
        Ok(())
    }

    /// Relaxes the joints by Gauss-Seidel and solves each one exactly. This is slower than the active set,
    /// but always converges because the problem is convex. External impulses keep their last values. The next
    /// step starts with fresh modes.
    pub(super) fn relax(&mut self, start: &Start<'_>, x: &mut [f64]) {
        for _ in 0..SWEEPS {
            let mut change = 0.0_f64;
            for (i, laws) in self.laws.iter().enumerate() {
                let inertia = start.mass[(i, i)];
                let rest = inertial(start, x, i) - inertia * x[i] + start.h * start.bias[i] - self.impulse[i];
                let next = laws.solve_alone(inertia, rest, start.h);
                change = change.max((next - x[i]).abs());
                x[i] = next;
            }
            if change < 1e-12 {
                break;
            }
        }
        self.modes.fill(START);
    }
}

/// Returns row `i` of `M (x - v)`. M is symmetric.
fn inertial(start: &Start<'_>, x: &[f64], i: usize) -> f64 {
    let n = x.len();
    let row = &start.mass.as_slice()[i * n..][..n];
    x.iter().zip(start.v).zip(row).map(|((x, v), entry)| entry * (x - v)).sum()
}

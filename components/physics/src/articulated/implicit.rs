//! The end velocity of an integration step: drives, friction, stops and external impulses that all depend on it.

use motorium_robots::{MassFactor, Model};
use nalgebra::DMatrix;

use super::JointEvents;
use super::laws::{Friction, Laws, Mode, START};
use crate::JointCommand;
use crate::joint::JointProperties;

/// A mass matrix that is singular at this index of `v`: the joint moves no inertia.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the mass matrix is singular at velocity {0}: it moves no inertia")]
pub struct Singular(pub usize);

/// The start of a step.
pub(super) struct Start<'a> {
    /// Positions of the joints.
    pub(super) q: &'a [f64],
    /// The whole velocity, that of a floating base first.
    pub(super) v: &'a [f64],
    /// Length of the step \[s\].
    pub(super) h: f64,
    pub(super) mass: &'a DMatrix<f64>,
    /// C(q, v) v + g(q), less external forces.
    pub(super) bias: &'a [f64],
}

/// Impulses from outside the robot that depend on its end velocity: contacts.
pub(crate) trait ExternalImpulses {
    /// Corrects the end velocity `x` (nv) that drives, friction and stops alone lead to: adds the generalized impulse
    /// (nv) to `impulse`, which is zero, and its effect to `x`. `factor` is that of the matrix from velocities to
    /// impulses; a mode fixes the velocity of `held` entries (nv), which no impulse changes.
    fn apply(&mut self, factor: &MassFactor, held: &[bool], x: &mut [f64], impulse: &mut [f64]);
}

/// No external impulses.
pub(crate) struct NoImpulses;

impl ExternalImpulses for NoImpulses {
    fn apply(&mut self, _: &MassFactor, _: &[bool], _: &mut [f64], _: &mut [f64]) {}
}

/// Workspace of the active-set iteration.
#[derive(Clone, Debug)]
pub(super) struct ImplicitSolver {
    modes: Vec<Mode>,
    laws: Vec<Laws>,
    system: DMatrix<f64>,
    factor: MassFactor,
    /// Entries whose velocity a mode fixes.
    held: Vec<bool>,
    /// Generalized external impulse.
    impulse: Vec<f64>,
}

/// Largest number of sweeps of the relaxation, which takes over when the active set cycles.
const SWEEPS: usize = 200;

/// Guesses of the modes before the relaxation takes over. Nearly always the first is confirmed.
const GUESSES: usize = 24;

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
        }
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

    /// The end velocity into `x` (nv), the drive efforts into `tau` (one per joint).
    pub(super) fn solve(
        &mut self,
        (joints, commands, bounds): (&[JointProperties], &[JointCommand], &[[f64; 2]]),
        start: &Start<'_>,
        impulses: &mut impl ExternalImpulses,
        x: &mut [f64],
        tau: &mut [f64],
    ) -> Result<JointEvents, Singular> {
        let offset = start.v.len() - joints.len();
        self.laws.clear();
        self.laws.resize(offset, Laws::FREE);
        for (i, (joint, command)) in joints.iter().zip(commands).enumerate() {
            self.laws.push(Laws::new(joint, command, bounds[i], (start.q[i], start.h)));
            let mode = &mut self.modes[offset + i];
            match (joint.friction > 0.0, mode.friction) {
                (true, Friction::None) => mode.friction = Friction::Stick,
                (false, _) => mode.friction = Friction::None,
                _ => {}
            }
        }
        let mut settled = false;
        for _ in 0..GUESSES {
            self.solve_modes(start, impulses, x)?;
            settled = true;
            for (i, (laws, mode)) in self.laws.iter().zip(&mut self.modes).enumerate() {
                let (constant, slope) = laws.force(mode);
                // What holds a velocity counts only where one is held.
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
            if settled {
                break;
            }
        }
        if !settled {
            self.relax(start, x);
        }
        let mut events = JointEvents::default();
        for ((laws, x), tau) in self.laws.iter().zip(x.iter()).skip(offset).zip(tau) {
            *tau = laws.drive(*x);
            events.saturated += usize::from(laws.is_saturated(*x));
            events.at_limit += usize::from(*x == laws.slowest || *x == laws.fastest);
        }
        Ok(events)
    }

    /// The linear system of the current modes: joints with a fixed velocity leave it.
    fn solve_modes(
        &mut self,
        start: &Start<'_>,
        impulses: &mut impl ExternalImpulses,
        x: &mut [f64],
    ) -> Result<(), Singular> {
        self.system.copy_from(start.mass);
        for (i, (laws, mode)) in self.laws.iter().zip(&self.modes).enumerate() {
            let (constant, slope) = laws.force(mode);
            self.system[(i, i)] += start.h * slope;
            x[i] = start.h * (constant - start.bias[i]);
        }
        // Column by column, which is how the matrix lies in memory.
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
        impulses.apply(&self.factor, &self.held, x, &mut self.impulse);
        // A velocity that a mode fixes stays exact.
        for ((laws, mode), x) in self.laws.iter().zip(&self.modes).zip(x) {
            if let Some(velocity) = laws.fixed(mode) {
                *x = velocity;
            }
        }
        Ok(())
    }

    /// Gauss-Seidel on the joints, each solved exactly: slower than the active set, but it always converges because the
    /// problem is convex. External impulses stay as they were last. The next step starts with fresh modes.
    fn relax(&mut self, start: &Start<'_>, x: &mut [f64]) {
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

/// Row `i` of `M (x - v)`. M is symmetric.
fn inertial(start: &Start<'_>, x: &[f64], i: usize) -> f64 {
    let n = x.len();
    let row = &start.mass.as_slice()[i * n..][..n];
    x.iter().zip(start.v).zip(row).map(|((x, v), entry)| entry * (x - v)).sum()
}

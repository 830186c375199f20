//! Dynamic movement primitives: [discrete](DiscreteDmp), [rhythmic](RhythmicDmp), [for
//! orientations](OrientationDmp), and with a [sampled forcing term](SampledDmp) that reproduces a
//! demonstration to rounding.
//!
//! A critically damped spring pulls each dimension `y` to its goal `g`. A learned forcing term that decays
//! with a phase shapes the path. With the duration `T`, the progress `p = t / T` and the phase in closed form
//! `s = exp(-a_s p)`, the [variants](Variant) are (`K = D^2 / 4`, so that both roots are `-D / 2`):
//!
//! - [`Classic`](Variant::Classic): `T^2 y'' = K (g - y) - D T y' + f`, with
//!   `f = s sum(psi_i w_i) / sum(psi_i)`.
//! - [`GoalSafe`](Variant::GoalSafe): `T^2 y'' = K (g - y) - D T y' - K (g - y0) s + K f`, with the same `f`.
//! - [`QuinticGoal`](Variant::QuinticGoal): `T^2 y'' = K (g(t) - y) + D T (g'(t) - y') + T^2 g''(t) + f`,
//!   with `f = (s - s(1)) / (1 - s(1)) sum(psi_i w_i) / sum(psi_i)` until the end, then 0, and `g(t)` the
//!   quintic from the start state to rest at `g`.
//! - [`FinalVelocity`](Variant::FinalVelocity): the equation of `QuinticGoal`, but `g(t)` passes `g` with a
//!   given velocity and continues at this velocity.
//!
//! `f` may be scaled with the displacement ([`Scaling`]). By default, `f` is not scaled, so there is no
//! division by `g - y0`.
//!
//! **Arrival.** Without forcing, `QuinticGoal` follows the minimum-jerk movement and is at the goal, at rest,
//! exactly at `T`. At `T`, `Classic` misses the goal by `(1 + D/2) exp(-D/2)` times the displacement, 5e-5
//! for `D = 25`. `GoalSafe` misses the goal by the remainder of the phase, a few percent for the default
//! decay: allow time to settle, or use a larger decay. A fitted `QuinticGoal` misses the goal by the fit
//! error at the end, which then decays with the roots `-D / 2T`.
//!
//! **Changes during the movement.** Goal and duration may change at any step. A [`Coupling`] adds an
//! acceleration `T^2 C` (away from [obstacles](ObstacleAvoidance), [yielding](Yielding) to a force) and lets
//! the phase [wait](PhaseStop) for a delayed robot. `C` and the phase rate apply to every variant.
//!
//! **Integration.** The spring is advanced by its exact solution for an input that is linear within the step.
//! Without forcing and with a fixed goal, the result does not depend on the step width.
//!
//! References: Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, *Dynamical movement primitives*, Neural
//! Computation 25, 2013. Pastor, Hoffmann, Asfour, Schaal, *Learning and generalization of motor skills by
//! learning from demonstration*, ICRA 2009. Muelling, Kober, Kroemer, Peters, *Learning to select and
//! generalize striking movements in robot table tennis*, IJRR 32, 2013. Ude, Nemec, Petric, Morimoto,
//! *Orientation in Cartesian space dynamic movement primitives*, ICRA 2014. Koutras, Doulgeri, *A correct
//! formulation for the orientation dynamic movement primitives*, CoRL 2019. Ginesi, Sansonetto, Fiorini,
//! *Overcoming some drawbacks of dynamic movement primitives*, Robotics and Autonomous Systems 144, 2021.

mod coupling;
mod demonstration;
mod discrete;
mod exponential;
mod fit;
mod kernels;
mod model;
mod obstacle;
mod orientation;
mod quintic;
mod rhythmic;
mod sampled;
mod scaling;
mod settings;
mod spring;

pub use coupling::{Coupling, PhaseStop, Yielding};
pub use demonstration::{Demonstration, DemonstrationError};
pub use discrete::{DiscreteDmp, MoveError, REPLANNING_TIME};
pub use fit::{FitError, Regression};
pub use kernels::{Gate, Kernels};
pub use model::{DmpModel, StoredModel};
pub use obstacle::ObstacleAvoidance;
pub use orientation::{OrientationDmp, orientation_demonstration};
pub use quintic::{Jet, Quintic};
pub use rhythmic::{PeriodError, RhythmicDmp, RhythmicModel, RhythmicSettings, StoredRhythmicModel};
pub use sampled::{SampledDmp, SampledError, SampledModel};
pub use settings::{ModelError, Scaling, Settings, Variant};
pub use spring::{CriticalSpring, Stride};

//! Dynamic movement primitives: discrete ones here, [rhythmic](RhythmicDmp), [of orientations](OrientationDmp), and
//! [with a forcing term of samples](SampledDmp) that give a demonstration back to rounding.
//!
//! A spring, critically damped, draws each dimension `y` to its goal `g`; a learned forcing term that fades with a
//! phase shapes the way there. With the duration `T`, the progress `p = t / T` and the phase in closed form
//! `s = exp(-a_s p)`, the [variants](Variant) are (`K = D^2 / 4`, so that both roots are `-D / 2`):
//!
//! | variant | equation |
//! |---|---|
//! | [`Classic`](Variant::Classic) | `T^2 y'' = K (g - y) - D T y' + f`, with `f = s sum(psi_i w_i) / sum(psi_i)` |
//! | [`GoalSafe`](Variant::GoalSafe) | `T^2 y'' = K (g - y) - D T y' - K (g - y0) s + K f`, with the same `f` |
//! | [`QuinticGoal`](Variant::QuinticGoal) | `T^2 y'' = K (g(t) - y) + D T (g'(t) - y') + T^2 g''(t) + f`, with `f = (s - s(1)) / (1 - s(1)) sum(psi_i w_i) / sum(psi_i)` until the end, then 0, and `g(t)` the quintic from the start state to rest at `g` |
//! | [`FinalVelocity`](Variant::FinalVelocity) | as `QuinticGoal`, but `g(t)` meets `g` with a given velocity and goes on with it |
//!
//! `f` may be scaled with the displacement ([`Scaling`]); by default it is not, so nothing is ever divided by `g - y0`.
//!
//! **Arrival.** Without forcing, `QuinticGoal` follows the minimum-jerk movement and is at the goal, at rest, exactly at
//! `T`. `Classic` is off by `(1 + D/2) exp(-D/2)` of the displacement there, 5e-5 for `D = 25`; `GoalSafe` by what is
//! left of the slow phase, some percent for the default decay: give it time to settle, or a larger decay. A fitted
//! `QuinticGoal` is off by the fit error at the end, which then dies out with the roots `-D / 2T`.
//!
//! **What happens on the way.** The goal and the duration may change at any step. A [`Coupling`] adds an acceleration
//! `T^2 C` (away from [obstacles](ObstacleAvoidance), [yielding](Yielding) to a force) and lets the phase
//! [wait](PhaseStop) for a robot that is held up. `C` and the phase rate go to every variant alike.
//!
//! **Integration.** The spring is not integrated step by step with an error but advanced exactly for an input that is
//! linear within the step; without forcing (and a fixed goal) the result does not depend on the step at all.
//!
//! References: Ijspeert, Nakanishi, Hoffmann, Pastor, Schaal, *Dynamical movement primitives*, Neural Computation 25, 2013.
//! Pastor, Hoffmann, Asfour, Schaal, *Learning and generalization of motor skills by learning from demonstration*, ICRA 2009.
//! Muelling, Kober, Kroemer, Peters, *Learning to select and generalize striking movements in robot table tennis*, IJRR 32,
//! 2013. Ude, Nemec, Petric, Morimoto, *Orientation in Cartesian space dynamic movement primitives*, ICRA 2014. Koutras,
//! Doulgeri, *A correct formulation for the orientation dynamic movement primitives*, CoRL 2019. Ginesi, Sansonetto, Fiorini,
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

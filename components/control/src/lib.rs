//! Optimisation-based control for motorium: tasks, limits, differential inverse kinematics.
//!
//! Each control tick is one small quadratic program in the joint velocity `v`:
//!
//! ```text
//! minimise   sum_tasks 1/2 |W (A v - b)|^2 + 1/2 damping |v|^2
//! subject to lower <= v <= upper          (every limit, intersected)
//! ```
//!
//! - [`tasks`] are costs: a frame reaches a pose, the centre of mass reaches a point, an axis points at a
//!   point, the joints keep a posture. Most tasks work with velocities and accelerations; a [`formulation`]
//!   turns them into costs. Tasks are combined by weights or in [levels](DifferentialIk::levels) of strict
//!   priority.
//! - [`limits`] are bounds: joint position and velocity limits.
//! - [`DifferentialIk`] combines tasks and limits into the program, and a solver of [`motorium_qp`] computes
//!   `v`.
//! - [`SetpointIntegrator`] integrates `v` into a position setpoint that stays within the limits.
//! - [`FeedForward`] computes the efforts of gravity and inertia that a joint drive adds to its feedback.
//!
//! [`inverse_dynamics`] computes joint torques instead of velocities, for robots with contacts and floating
//! bases.
//!
//! The library works on a [`motorium_robots::Model`], without clock, topics or threads. Construction
//! allocates all memory; a tick does not allocate. [`QpController`], the component `control.qp`, connects the
//! library to topics. The modules [`checks`] and [`measured`] are shared with the components of other
//! controllers.
//!
//! # Example
//!
//! ```
//! use motorium_control::{
//!     DifferentialIk, SetpointIntegrator, RobotState,
//!     limits::{PositionLimit, VelocityLimit},
//!     tasks::{CartesianTask, PostureTask},
//! };
//! use motorium_robots::{Kinematics, load};
//!
//! let panda = load("panda", std::path::Path::new("."))?;
//! let model = &panda.model;
//! let home = panda.profile.as_ref().expect("a catalogue robot has a profile").home(model)?;
//! let tool = model.frame("panda_hand_tcp")?;
//!
//! let mut kinematics = Kinematics::new(model);
//! let mut cartesian = CartesianTask::new(model, tool);
//! let mut posture = PostureTask::new(model, home.as_slice());
//! let (position, velocity) = (PositionLimit::default(), VelocityLimit::default());
//! let mut ik = DifferentialIk::new(model);
//! let mut setpoint = SetpointIntegrator::new(model, home.as_slice());
//!
//! kinematics.update(model, home.as_slice());
//! let mut target = kinematics.pose(model, tool);
//! target.translation.x += 0.1;
//! cartesian.set_target(target);
//!
//! let dt = 0.001;
//! for _ in 0..3000 {
//!     kinematics.update(model, setpoint.position());
//!     let state = RobotState { model, kinematics: &kinematics, q: setpoint.position() };
//!     ik.assemble(&state, &mut [&mut cartesian, &mut posture], &[&position, &velocity], dt);
//!     setpoint.integrate(ik.solve()?, dt);
//! }
//! assert!(cartesian.position_error() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[macro_use]
mod defaults;

pub mod checks;
mod component;
mod conflict;
mod contact;
mod cost;
mod feed_forward;
pub mod formulation;
mod gains;
mod goals;
mod ik;
pub mod inverse_dynamics;
mod levels;
pub mod limits;
mod mixture;
mod relaxation;
mod setpoint;
mod stacks;
mod state;
pub mod tasks;

pub use component::*;
pub use feed_forward::FeedForward;
pub use gains::{GainsError, check_gains};
pub use goals::{GoalError, GoalRecord, GoalSummary, GoalTolerance};
pub use ik::{DifferentialIk, IkConflict, IkError, IkRows, IkSettings};
pub use limits::{
    AccelerationConfig, AllObjects, CentreOfMassLimitConfig, CollisionConfig, FrameLimitConfig, LevelGround,
    LimitsConfig, OfWorld, SupportConfig, SupportedPoint, WorldObjects,
};
pub use mixture::Mixture;
pub use setpoint::SetpointIntegrator;
pub use stacks::{StackSample, TaskStack, run_stack};
pub use state::{MotionState, RobotState};
pub use tasks::{
    Admittance, AdmittanceConfig, AdmittanceSettings, AxesConfig, CapturePointConfig, CartesianConfig,
    CartesianImpedanceConfig, CentreOfMassConfig, ConstraintConfig, ContactWrenchConfig, GazeConfig,
    JointImpedanceConfig, LimitConfig, ManipulabilityConfig, ManipulabilityRows, MinimumConfig, MinimumOf,
    MomentumConfig, PostureConfig, RelativeConfig, RigidRotationConfig, RollingConfig, SharesConfig,
    TaskConfig, UnicycleConfig,
};

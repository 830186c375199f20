//! Physics for motorium: simulated robots and worlds.
//!
//! A [`Simulator`] simulates robots in a [`World`]. Three engines are available. [`ArticulatedSimulator`]
//! uses motorium's own dynamics and contact solver and supports robots with a fixed or a floating base.
//! [`RapierSimulator`] uses the rapier engine and supports robots with a fixed base. [`MujocoSimulator`] uses
//! the MuJoCo library, where it is installed, and supports all robots. The engines share state, commands,
//! limits, collision model and set-up: each is a [`Simulation`] over an [`Engine`]. A [`Batch`] steps many
//! worlds on all cores. All of these form a plain library that does not need the runtime.
//!
//! [`ArticulatedPhysics`] (`physics.articulated`), [`RapierPhysics`] (`physics.rapier`) and [`MujocoPhysics`]
//! (`physics.mujoco`) are the components of a graph; only these components depend on the runtime.

mod air;
mod articulated;
mod batch;
mod build;
mod capabilities;
mod component;
mod connection;
mod contact;
mod error;
mod joint;
mod library_error;
mod mujoco;
mod options;
mod placed;
mod properties;
pub mod randomise;
mod rapier;
mod rays;
mod robot;
mod rotors;
mod shapes;
mod simulation;
mod simulator;
mod surface;

pub use articulated::{
    Articulated, ArticulatedSimulator, JointEvents, JointSpaceIntegrator, LinkForce, Singular,
};
pub use batch::Batch;
pub use build::{BuildError, BuildWarning};
pub use capabilities::Capabilities;
pub use component::{
    ActuatorConfig, ArticulatedPhysics, MujocoPhysics, PhysicsComponent, PhysicsConfig, PhysicsEngine,
    PushConfig, RapierPhysics, SpringConfig, SurfaceConfig, kinds,
};
pub use connection::{ConnectError, Connection, ConnectionKind};
pub use error::{ResetError, StepError};
pub use joint::JointProperties;
pub use library_error::LibraryError;
pub use motorium_drive::JointSetpoint;
pub use motorium_worlds::{
    Conveyor, Copies, Grain, Ground, Object, ObjectShape, Softness, Terrain, TerrainLayer, World, WorldError,
};
pub use mujoco::{Mujoco, MujocoSimulator};
pub use options::{Integrator, Options};
pub use properties::Properties;
pub use rapier::{Enclose, Rapier, RapierSimulator};
pub use robot::{Articulation, Robot, RobotSetup};
pub use rotors::RotorDrive;
pub use simulation::{Engine, Simulation};
pub use simulator::{Contact, ForeignState, ObjectId, RayHit, SavedState, Simulator, StepReport};
pub use surface::Surface;

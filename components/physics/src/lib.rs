//! Physics for motorium: simulated robots and worlds.
//!
//! A [`Simulator`] is a robot in a [`World`]; [`Rapier`] is one, on the rapier engine. All that is a plain library,
//! usable without the runtime. [`RapierPhysics`] makes it a component of a graph, and is the only part that knows the
//! runtime.

pub mod articulated;
mod component;
mod rapier;
mod simulator;
mod world;

pub use component::{RapierConfig, RapierPhysics};
pub use rapier::{BuildError, BuildWarning, Contacts, Enclose, Options, Rapier};
pub use simulator::{Contact, JointCommand, ObjectId, ResetError, Simulator, StepError, StepReport};
pub use world::{Ground, Object, ObjectShape, World, WorldError};

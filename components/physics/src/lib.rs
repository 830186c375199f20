//! Physics for motorium: simulated robots and worlds.
//!
//! A [`Simulator`] is a robot in a [`World`]; [`Rapier`] is one, on the rapier engine. Everything here is a plain
//! library, usable without the runtime.

pub mod articulated;
mod rapier;
mod simulator;
mod world;

pub use rapier::{BuildError, BuildWarning, Contacts, Enclose, Options, Rapier};
pub use simulator::{Contact, JointCommand, ObjectId, ResetError, Simulator, StepError, StepReport};
pub use world::{Ground, Object, ObjectShape, World, WorldError};

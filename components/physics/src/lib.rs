//! Physics for motorium: simulated robots and worlds.
//!
//! A [`Simulator`] is a robot in a [`World`]. [`Rapier`] moves robots with a fixed base, contacts by the rapier engine;
//! [`Floating`] moves those whose base moves freely, contacts by our own solver. All that is a plain library, usable
//! without the runtime. [`RapierPhysics`] makes it a component of a graph, and is the only part that knows the runtime.

pub mod articulated;
mod build;
mod component;
mod contact;
mod floating;
mod options;
mod rapier;
mod simulator;
mod world;

pub use build::{BuildError, BuildWarning};
pub use component::{RapierConfig, RapierPhysics};
pub use floating::{Floating, LinkForce, RotorDrive};
pub use options::{Contacts, Options};
pub use rapier::{Enclose, Rapier};
pub use simulator::{Contact, JointCommand, ObjectId, ResetError, Simulator, StepError, StepReport};
pub use world::{Ground, Object, ObjectShape, World, WorldError};

//! Learners of the weights of movements, without the runtime.
//!
//! - [`Power`]: policy search by weighted exploration, for weights of a motion library or of a movement primitive.
//! - [`perception`]: from the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis with them, as numbers.

pub mod experiments;
pub mod perception;
mod power;

pub use power::{Power, PowerSettings};

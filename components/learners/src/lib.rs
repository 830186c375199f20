//! Learners of the weights of movements, without the runtime.
//!
//! - [`Power`]: policy search by weighted exploration, for weights of a motion library or of a movement
//!   primitive.
//! - [`CrossEntropy`]: black-box search by whole generations, whose candidates can be tried at the same time.
//! - [`perception`]: from the picture of a letter to the movement that writes it.
//! - [`experiments`]: experiments of a thesis with them, as numbers.

mod cross_entropy;
pub mod experiments;
pub mod perception;
mod power;

pub use cross_entropy::{CrossEntropy, CrossEntropySettings};
pub use power::{Power, PowerSettings};

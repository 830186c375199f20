//! Function approximators without the runtime.
//!
//! - [`networks`]: neural networks with seeded training on the CPU.

pub mod networks;

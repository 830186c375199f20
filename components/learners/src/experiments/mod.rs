//! Experiments with the motion library and its learners, after Delhaisse, *Learning and control of humanoid
//! robots* (PhD thesis, 2019), chapter 3. They return numbers; `motorium reproduce` draws them.
//!
//! - [`search`]: policy search on weights of a library and of radial kernels.
//! - [`body`]: libraries of a full body and of its parts, and composed movements.
//! - [`perception`]: letters written from their pictures, against the nearest picture known.

pub mod body;
pub mod perception;
pub mod search;

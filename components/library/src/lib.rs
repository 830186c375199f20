//! Dynamic motion library: movements represented by weights of a few eigenforces.
//!
//! A movement is the response of a spring ([`SampledSpring`]) to a vector of forces `f`, one for each sample
//! of each degree of freedom (DoF). The forces of many movements are the columns of a matrix `F = U S V^T`.
//! Its left singular vectors are the **eigenforces**, ordered by explained variance. A movement is then
//!
//! | | |
//! |---|---|
//! | recognised | `w = U_n^T f`; `w` identifies the movement, `\|f - U_n w\| / \|f\|` is its novelty |
//! | generated | `f = U_n w`, followed by the spring from any start, to any goal, in any duration |
//! | blended | `w = sum a_k w_k`, with start and goal blended alike, since the model is linear |
//!
//! - [`MotionLibrary`]: built from [`Recordings`], with a rank chosen by [`Truncation`], in a [`Metric`].
//! - [`MotionLibrary::split`], [`merge_parts`], [`merge_independent`], [`merge_movements`]: split a library
//!   into parts of the body and merge parts, without the recordings.
//! - [`RecursiveLibrary`]: adds a movement or a block of movements to an existing library.
//! - [`Recogniser`], [`Generator`]: allocation-free recognition and generation for a control loop.
//! - [`Basis`]: eigenforces, Fourier functions and radial kernels for comparison; [`evaluate`] computes their
//!   errors, and [`CrossValidation`] repeats the comparison over several splits.
//! - [`file`]: the file format. [`Recordings::read`]: recordings from JSON, JSONL and CSV. [`letters`]:
//!   synthetic letters.
//!
//! **Metric.** The eigenforces of `F` minimise the residual *force*. A residual force early in a movement
//! shifts the whole path; a residual force near the end shifts only a small part of the path.
//! [`Metric::Position`] therefore uses the singular vectors `u` of the responses `P = G F`, with forces
//! `G^-1 u`, which minimises the residual *position*.
//!
//! Source: Delhaisse, *Learning and control of humanoid robots* (PhD thesis, 2019), chapter 3 and appendix A:
//! eigenforces, split and merge, recursive decomposition. The response-weighted metric and the exact sampled
//! spring are additions of this crate. The crate does not depend on the runtime.

mod balance;
mod basis;
pub mod cross_validation;
mod data;
mod evaluate;
pub mod file;
mod generate;
mod layout;
pub mod letters;
mod merge;
mod motion_library;
mod movement;
mod recognise;
mod recursive;
mod scatter;
mod split;
mod spring;
pub mod statistics;
mod trace;
mod trajectory;
mod truncation;

pub use basis::{Basis, kernel_error, kernel_functions};
pub use cross_validation::CrossValidation;
pub use data::DataError;
pub use evaluate::{BALANCED, Evaluation, PathError, compare, evaluate, nearest_neighbour_rate, path_errors};
pub use generate::{GenerateError, Generator, Superposition};
pub use layout::{Layout, LayoutError, Part};
pub use merge::{MergeError, merge_independent, merge_movements, merge_parts};
pub use motion_library::{BuildError, Entry, LibraryParts, Metric, MotionLibrary};
pub use movement::{Frame, Movement};
pub use recognise::{Recognised, Recogniser};
pub use recursive::RecursiveLibrary;
pub use scatter::RecursiveScatter;
pub use spring::{DAMPING, Interpolation, SampledSpring, SpringError};
pub use trace::{Trace, TraceErrors};
pub use trajectory::{Recordings, Trajectory};
pub use truncation::Truncation;

//! Mathematics: Lie groups and twists, and small dense arithmetic for the inner loops. Three-vectors,
//! rotations, symmetric matrices and spatial vectors are plain numbers, so that a whole recursion compiles
//! into straight-line code.

mod axial;
pub(crate) mod degrees;
pub mod lie;
mod parry;
mod spatial;
mod three;
mod trigonometry;
pub(crate) mod twist;
mod wide;

pub(crate) use axial::Turn;
pub(crate) use parry::{v3, vector};
pub(crate) use spatial::{ArticulatedInertia, RigidInertia, Spatial};
pub(crate) use three::S3;
pub use three::{M3, V3};
pub(crate) use trigonometry::{LANES, sin_cos, sin_cos_abreast};
pub(crate) use wide::{Work, fused, widest};

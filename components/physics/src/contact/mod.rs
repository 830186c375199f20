//! Contact of a robot and of free objects with the ground, fixed objects and one another.
//!
//! Three steps, each with a file: convex [solids](solid) know their surface and the points with which they touch others
//! first; [detection](detect) finds where those come near another surface; [impulses](impulses) finds what pushes there,
//! so that nothing comes closer than touching and friction stays in its cone.

mod detect;
mod impulses;
mod objects;
mod pieces;
mod solid;

pub(crate) use detect::{Detector, Touch};
pub(crate) use impulses::{Impulses, Response};
pub(crate) use objects::Objects;
pub(crate) use pieces::{Owner, Piece, list, may_touch};

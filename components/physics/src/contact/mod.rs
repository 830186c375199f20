//! Contact of a robot and of free objects with the ground, fixed objects and each other.
//!
//! [Colliders](colliders) are the solids of the [collision model](motorium_robots::CollisionModel) with their
//! surface properties. [Features](features) are the points of a shape that touch other shapes first.
//! [Detection](detect) finds where features come near another surface ([pair by pair](narrow)), the
//! [triangles of a mesh](surfaces) or the [terrain](terrain). Detection inspects only [near
//! pairs](near_pairs) whose [bounds](bounds) do not rule out contact. If the motion of the [joints](calm)
//! rules out all contacts, no pair is inspected. [Impulses](impulses) sets up the problem of the impulses at
//! these points, so that surfaces do not overlap and friction stays in its [cone](cone). A [scene] owns all
//! of these.

mod answer;
mod axes;
mod bounds;
mod boxes;
mod calm;
mod colliders;
mod cone;
#[cfg(test)]
mod cone_tests;
mod connections;
mod detect;
mod features;
mod hulls;
mod impulses;
mod islands;
mod narrow;
mod near_pairs;
mod newton;
mod newton_room;
mod normals;
mod objects;
mod outermost;
mod pair;
mod parties;
mod patch;
mod point;
mod properties;
mod scene;
mod site;
mod sums;
mod surface;
mod surfaces;
mod sweeps;
mod terrain;

pub(crate) use colliders::{Collider, Colliders, Member, Owner};
pub(crate) use impulses::{ImpulseTarget, MovedByImpulses};
pub(crate) use scene::{ContactScene, SceneState};
pub(crate) use sums::ImpulseSums;

//! Everything solid, in convex pieces, and which may touch which.

use motorium_robots::{Model, Shape};
use nalgebra::Isometry3;

use super::solid::Solid;
use crate::{BuildWarning, World};

/// What a piece is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// The world: the ground, fixed objects, links that do not move.
    World,
    /// The moving base of the robot.
    Base,
    /// A body of the robot.
    Body(usize),
    /// An object that moves.
    Object(usize),
}

impl Owner {
    /// It is part of the moving robot.
    pub(crate) fn is_robot(self) -> bool {
        matches!(self, Self::Base | Self::Body(_))
    }
}

/// One convex piece of something solid.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    /// Robot link, object, or `ground`.
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) solid: Solid,
    /// Frame of the solid in that of its owner.
    pub(crate) placement: Isometry3<f64>,
    pub(crate) friction: f64,
    pub(crate) restitution: f64,
}

/// Lists all pieces: robot first, then objects, then the ground. `movable` is the index of each object that moves among
/// those that do.
pub(crate) fn list(
    model: &Model,
    world: &World,
    friction: f64,
    movable: &[Option<usize>],
    warnings: &mut Vec<BuildWarning>,
) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut robot = |owner: Owner, shape: &Shape| match Solid::of_geometry(&shape.geometry) {
        Ok(Some(solid)) => pieces.push(Piece {
            name: shape.link.clone(),
            owner,
            solid,
            placement: shape.placement,
            friction,
            restitution: 0.0,
        }),
        Ok(None) => warnings.push(BuildWarning::MeshIgnored { link: shape.link.clone() }),
        Err(error) => warnings
            .push(BuildWarning::MeshUnreadable { link: shape.link.clone(), reason: error.to_string() }),
    };
    let base = model.base();
    let of_base = if base.floating { Owner::Base } else { Owner::World };
    base.shapes.iter().for_each(|shape| robot(of_base, shape));
    base.world_shapes.iter().for_each(|shape| robot(Owner::World, shape));
    for (index, body) in model.bodies().iter().enumerate() {
        body.shapes.iter().for_each(|shape| robot(Owner::Body(index), shape));
    }
    for (object, movable) in world.objects.iter().zip(movable) {
        pieces.push(Piece {
            name: object.name.clone(),
            owner: movable.map_or(Owner::World, Owner::Object),
            solid: Solid::of_object(&object.shape),
            placement: if movable.is_some() { Isometry3::identity() } else { object.pose() },
            friction: object.friction,
            restitution: object.restitution,
        });
    }
    if let Some(ground) = &world.ground {
        pieces.push(Piece {
            name: "ground".to_owned(),
            owner: Owner::World,
            solid: Solid::HalfSpace,
            placement: Isometry3::translation(0.0, 0.0, ground.height),
            friction: ground.friction,
            restitution: ground.restitution,
        });
    }
    pieces
}

/// Whether two pieces can touch by construction: not those of one thing, nor, on the robot, links that share a joint or a
/// parent, or any when the robot does not touch itself.
pub(crate) fn may_touch(model: &Model, a: Owner, b: Owner, self_collision: bool) -> bool {
    let body = |owner: Owner| if let Owner::Body(index) = owner { Some(index) } else { None };
    let parent = |owner: Owner| body(owner).and_then(|index| model.bodies()[index].parent);
    if a == b {
        return false;
    }
    if !(a.is_robot() && b.is_robot()) {
        return true;
    }
    let carries = |a: Owner, b: Owner| body(b).is_some() && parent(b) == body(a);
    let siblings = body(a).is_some() && body(b).is_some() && parent(a) == parent(b);
    self_collision && !carries(a, b) && !carries(b, a) && !siblings
}

//! Every solid surface of the simulation, and which may touch which.

use motorium_robots::{Model, Shape};
use nalgebra::Isometry3;
use rapier3d_f64::geometry::{ColliderHandle, SharedShape};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::{PairFilterContext, PhysicsHooks};
use rapier3d_f64::prelude::SolverFlags;

use super::shapes;
use crate::{BuildWarning, World};

/// What a surface is fixed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    /// The fixed base of the robot.
    Base,
    /// A moving body of the robot.
    Body(usize),
    /// An object of the world.
    Object(usize),
    /// The ground plane.
    Ground,
}

/// One convex piece of something solid.
#[derive(Clone)]
pub(super) struct Surface {
    /// Robot link, object, or `ground`.
    pub(super) name: String,
    pub(super) owner: Owner,
    pub(super) shape: SharedShape,
    /// Frame of the shape in that of its owner.
    pub(super) placement: Isometry3<f64>,
    pub(super) friction: f64,
    pub(super) restitution: f64,
    /// Radius of the sphere about the shape's origin that holds it; infinite for the ground.
    pub(super) radius: f64,
}

/// Lists all surfaces: robot first, then objects, then the ground.
pub(super) fn list(
    model: &Model,
    world: &World,
    friction: f64,
    warnings: &mut Vec<BuildWarning>,
) -> Vec<Surface> {
    let mut surfaces = Vec::new();
    let mut robot = |owner: Owner, shape: &Shape| match shapes::of_geometry(&shape.geometry) {
        Some((solid, frame)) => surfaces.push(Surface {
            name: shape.link.clone(),
            owner,
            radius: radius(&solid),
            shape: solid,
            placement: shape.placement * frame,
            friction,
            restitution: 0.0,
        }),
        None => warnings.push(BuildWarning::MeshIgnored { link: shape.link.clone() }),
    };
    for shape in model.base_shapes() {
        robot(Owner::Base, shape);
    }
    for (index, body) in model.bodies().iter().enumerate() {
        for shape in &body.shapes {
            robot(Owner::Body(index), shape);
        }
    }
    for (index, object) in world.objects.iter().enumerate() {
        let (shape, placement) = shapes::of_object(&object.shape);
        surfaces.push(Surface {
            name: object.name.clone(),
            owner: Owner::Object(index),
            radius: radius(&shape),
            shape,
            placement,
            friction: object.friction,
            restitution: object.restitution,
        });
    }
    if let Some(ground) = &world.ground {
        surfaces.push(Surface {
            name: "ground".to_owned(),
            owner: Owner::Ground,
            shape: SharedShape::halfspace(Vector::Z),
            placement: Isometry3::translation(0.0, 0.0, ground.height),
            friction: ground.friction,
            restitution: ground.restitution,
            radius: f64::INFINITY,
        });
    }
    surfaces
}

fn radius(shape: &SharedShape) -> f64 {
    let sphere = shape.compute_local_bounding_sphere();
    sphere.center().length() + sphere.radius()
}

/// Which pairs of surfaces may touch.
#[derive(Clone, Debug)]
pub(super) struct PairTable {
    count: usize,
    allowed: Vec<bool>,
}

impl PairTable {
    /// All pairs but those that cannot collide by construction: surfaces of one body, two that never move, and, on the
    /// robot, links that share a joint or a parent.
    pub(super) fn new(surfaces: &[Surface], model: &Model, world: &World, self_collision: bool) -> Self {
        let count = surfaces.len();
        let mut table = Self { count, allowed: vec![false; count * count] };
        let still = |owner: Owner| match owner {
            Owner::Base | Owner::Ground => true,
            Owner::Body(_) => false,
            Owner::Object(index) => !world.objects[index].is_dynamic(),
        };
        let parent = |body: Option<usize>| body.and_then(|index| model.bodies()[index].parent);
        for i in 0..count {
            for j in 0..i {
                let (a, b) = (surfaces[i].owner, surfaces[j].owner);
                let robot = |owner| match owner {
                    Owner::Base => Some(None),
                    Owner::Body(index) => Some(Some(index)),
                    _ => None,
                };
                let allowed = match (robot(a), robot(b)) {
                    _ if a == b || (still(a) && still(b)) => false,
                    (Some(a), Some(b)) => {
                        let adjacent = (a.is_some() && parent(a) == b) || (b.is_some() && parent(b) == a);
                        let siblings = a.is_some() && b.is_some() && parent(a) == parent(b);
                        self_collision && !adjacent && !siblings
                    }
                    _ => true,
                };
                table.set(i, j, allowed);
            }
        }
        table
    }

    pub(super) fn allows(&self, i: usize, j: usize) -> bool {
        self.allowed[i * self.count + j]
    }

    pub(super) fn set(&mut self, i: usize, j: usize, allowed: bool) {
        self.allowed[i * self.count + j] = allowed;
        self.allowed[j * self.count + i] = allowed;
    }
}

/// Rapier asks it about every pair whose boxes overlap. A collider's user data is the index of its surface.
impl PhysicsHooks for PairTable {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        let surface = |handle: ColliderHandle| context.colliders[handle].user_data as usize;
        self.allows(surface(context.collider1), surface(context.collider2))
            .then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}

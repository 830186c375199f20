//! The colliders of a simulation: solids of the collision model with their surface properties, and pairs of
//! them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use motorium_robots::{
    Attachment, CollisionError, CollisionModel, CollisionOptions, Collisions, ConvexShape, MeshMode,
    TriangleSurface,
};
use motorium_worlds::{FrictionCombine, Grain, HeightField, Object, ObjectShape, Softness, Terrain};
use nalgebra::{Isometry3, Vector3};

use crate::robot::Robot;
use crate::{BuildWarning, Options, RobotSetup, World};

/// Links that start closer than this are excluded from self-collision \[m\].
const TOO_CLOSE: f64 = 0.010;

/// The part of the simulation that moves a collider.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Owner {
    /// The world: the ground, fixed objects, and links that do not move.
    World,
    /// The moving base of the articulation with this index.
    Base(usize),
    /// A body of an articulation.
    Body(usize, usize),
    /// A movable object, by its index among the movable objects.
    Object(usize),
}

impl Owner {
    /// Returns `true` for moving parts of robots.
    pub(crate) fn is_robot(self) -> bool {
        self.articulation().is_some()
    }

    /// Returns the articulation if the owner is a moving part of one.
    pub(crate) fn articulation(self) -> Option<usize> {
        match self {
            Self::Base(of) | Self::Body(of, _) => Some(of),
            Self::World | Self::Object(_) => None,
        }
    }
}

/// One end of a connection: a link, a movable object, or a fixed object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Member {
    pub(crate) owner: Owner,
    /// Index of the object, if it is fixed.
    pub(crate) fixed: Option<usize>,
}

/// A convex shape with surface properties, fixed to its owner.
#[derive(Clone, Debug)]
pub(crate) struct Collider {
    /// Robot link, object, `ground` or `terrain`.
    pub(crate) name: String,
    pub(crate) owner: Owner,
    pub(crate) shape: ConvexShape,
    /// Frame of the shape in the frame of its owner. For movable objects this is the frame of their principal
    /// axes of inertia.
    pub(crate) placement: Isometry3<f64>,
    /// Index of the object, if it is fixed.
    pub(crate) fixed: Option<usize>,
    /// For a part of a mesh or a compound: the index of its object in the world, and the frame of the part in
    /// the object.
    pub(crate) part: Option<(usize, Isometry3<f64>)>,
    /// The triangles of a mesh, about the origin of the collider's shape, which is their bounding box.
    pub(crate) surface: Option<Arc<TriangleSurface>>,
    /// Face planes of an object's hull: outward normal, and height along it \[m\].
    pub(crate) faces: Vec<(Vector3<f64>, f64)>,
    /// Face planes of any hull, for contacts with mesh edges; empty if no mesh in the world uses its
    /// triangles.
    pub(crate) sides: Vec<(Vector3<f64>, f64)>,
    pub(crate) friction: f64,
    pub(crate) friction_combine: Option<FrictionCombine>,
    /// Coefficients of torsional and rolling friction \[m\].
    pub(crate) torsional: f64,
    pub(crate) rolling: f64,
    pub(crate) restitution: f64,
    /// Velocity of the surface relative to the owner, in collider axes \[m/s\].
    pub(crate) conveyor: Option<Vector3<f64>>,
    pub(crate) soft: Option<Softness>,
    pub(crate) grain: Option<ColliderGrain>,
}

/// Direction-dependent friction of a collider.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColliderGrain {
    /// Unit vector in collider axes.
    pub(crate) direction: Vector3<f64>,
    /// Coefficient of friction along it.
    pub(crate) along: f64,
    /// The configured coefficients across and along the direction.
    described: [f64; 2],
}

impl Collider {
    /// Returns the member of a connection that carries this collider.
    pub(crate) fn member(&self) -> Member {
        Member { owner: self.owner, fixed: self.fixed }
    }
}

impl ColliderGrain {
    fn new(direction: Vector3<f64>, along: f64, across: f64) -> Self {
        Self { direction, along, described: [across, along] }
    }

    /// Changes the coefficient across the direction; the coefficient along it changes by the same factor.
    pub(super) fn scale(&mut self, friction: f64) {
        let [across, along] = self.described;
        self.along = if across > 0.0 { along * (friction / across) } else { along };
    }
}

/// All colliders (robots first, then objects, then the ground or the terrain) and the pairs of them that may
/// touch.
pub(crate) struct Colliders {
    pub(crate) colliders: Vec<Collider>,
    /// Index of the first collider of the first object in the world.
    pub(crate) first_object: usize,
    /// The colliders of each object in the world.
    pub(crate) objects: Vec<Range<usize>>,
    /// The collision model of the colliders, with the same indices and pairs. It does not contain the
    /// terrain.
    pub(crate) model: CollisionModel,
    /// The surface of the terrain, which is the last collider. A placeholder shape represents it in the
    /// collision model.
    pub(crate) terrain: Option<Arc<HeightField>>,
    /// The description of the terrain.
    pub(super) described: Option<Terrain>,
}

impl Colliders {
    /// Creates the colliders and their pairs. Links on one body, or on two bodies connected by a joint or a
    /// parent, never touch. No links touch if the robot has no self-collision. The rules of `setup` disable
    /// and enable further pairs. Unusable shapes are omitted with a warning.
    pub(crate) fn new(
        setups: &[RobotSetup],
        world: &World,
        options: &Options,
        warnings: &mut Vec<BuildWarning>,
    ) -> Self {
        let collision_options = |setup: &RobotSetup| CollisionOptions {
            meshes: MeshMode::Outermost,
            siblings: false,
            self_collision: options.self_collision,
            srdf: setup.collision_rules.clone(),
            leave_out_defects: true,
            ..CollisionOptions::default()
        };
        let no_defects = "defects are left out, and nothing else can go wrong";
        let mut model =
            CollisionModel::new(&setups[0].model, &collision_options(&setups[0])).expect(no_defects);
        for setup in &setups[1..] {
            model.add_robot(&setup.model, &collision_options(setup)).expect(no_defects);
        }
        let first_object = model.solid_count();
        warnings.extend(model.left_out().iter().map(|defect| match defect {
            CollisionError::Solid { link, problem } => {
                BuildWarning::ShapeIgnored { link: link.clone(), reason: problem.to_string() }
            }
            CollisionError::UnknownLink { .. } => BuildWarning::RuleIgnored { reason: defect.to_string() },
        }));
        let mut objects = Vec::with_capacity(world.objects.len());
        for object in &world.objects {
            let (first, pose, moves) = (model.solid_count(), object.pose(), object.is_dynamic());
            let mode = if surface_of(object).is_some() { MeshMode::Surface } else { PART };
            for (frame, geometry) in object.shape.geometries() {
                let added = if moves {
                    model.add_free_object(&object.name, pose * frame, geometry, mode)
                } else {
                    model.add_obstacle(&object.name, pose * frame, geometry, mode)
                };
                added.expect("the shapes of objects have been checked with the world");
            }
            objects.push(first..model.solid_count());
        }
        if let Some(ground) = &world.ground {
            model.add_half_space("ground", Isometry3::translation(0.0, 0.0, ground.height));
        }
        let setup = |index: usize| model.robot(index).map(|of| (of, &setups[of]));
        let mut colliders: Vec<Collider> = (0..model.solid_count())
            .map(|index| {
                let object = (index >= first_object).then(|| {
                    let of = objects.partition_point(|colliders: &Range<usize>| colliders.end <= index);
                    (of, world.objects.get(of))
                });
                let free =
                    |until: usize| world.objects[..until].iter().filter(|object| object.is_dynamic()).count();
                let owner = match (model.attachment(index), object, setup(index)) {
                    (_, Some((index, Some(object))), _) if object.is_dynamic() => Owner::Object(free(index)),
                    (Attachment::Body(body), None, Some((of, _))) => Owner::Body(of, body),
                    (Attachment::Base, None, Some((of, setup))) if setup.model.base().floating => {
                        Owner::Base(of)
                    }
                    _ => Owner::World,
                };
                let (mut turning, mut soft, mut grain) = (([0.0; 2], None), None, None);
                let combine;
                let (friction, restitution) = match (object, &world.ground) {
                    (Some((_, Some(object))), _) => {
                        turning = ([object.torsional_friction, object.rolling_friction], object.conveyor);
                        (soft, grain) =
                            (object.soft, object.grain.map(|grain| (grain.unit(), grain.friction)));
                        combine = object.friction_combine;
                        (object.friction, object.restitution)
                    }
                    (Some((_, None)), Some(ground)) => {
                        turning = ([ground.torsional_friction, ground.rolling_friction], ground.conveyor);
                        (soft, grain) =
                            (ground.soft, ground.grain.map(|grain| (grain.unit(), grain.friction)));
                        combine = ground.friction_combine;
                        (ground.friction, ground.restitution)
                    }
                    _ => {
                        let link = model.link(index);
                        let own = |of: fn(&RobotSetup) -> &BTreeMap<String, f64>, all: f64| {
                            setup(index).and_then(|(_, setup)| of(setup).get(link).copied()).unwrap_or(all)
                        };
                        let friction = own(|setup| &setup.friction, options.friction);
                        combine =
                            setup(index).and_then(|(_, setup)| setup.friction_combine.get(link).copied());
                        if let Some((_, setup)) = setup(index) {
                            soft = setup.soft.get(link).copied();
                            grain = setup.grain.get(link).map(|grain| of_link(setup, &model, index, grain));
                        }
                        (friction, own(|setup| &setup.restitution, options.restitution))
                    }
                };
                let ([torsional, rolling], conveyor) = turning;
                let parted = object.and_then(|(of, object)| Some((of, object?)));
                let parted = parted.filter(|(_, object)| {
                    matches!(object.shape, ObjectShape::Mesh(_) | ObjectShape::Compound(_))
                });
                let part = parted.map(|(of, object)| (of, object.pose().inv_mul(&model.placement(index))));
                // Rotates a direction from the axes of the object into the axes of its part.
                let turned = |direction: Vector3<f64>| match parted {
                    Some((_, Object { shape: ObjectShape::Compound(_), .. })) => {
                        part.map_or(direction, |(_, frame)| frame.rotation.inverse() * direction)
                    }
                    _ => direction,
                };
                let surface = parted.and_then(|(_, object)| surface_of(object));
                let shape = match &surface {
                    Some(surface) => ConvexShape::Hull { points: surface.corners() },
                    None => model.convex_shape(index),
                };
                let in_object = || part.map_or_else(Isometry3::identity, |(_, part)| part);
                let axes = parted.and_then(|(_, object)| object.mass_properties()?.frame);
                Collider {
                    name: model.link(index).to_owned(),
                    owner,
                    faces: if part.is_some() && surface.is_none() { shape.faces() } else { Vec::new() },
                    sides: Vec::new(),
                    shape,
                    placement: match (owner, axes) {
                        (Owner::Object(_), Some(axes)) => axes.inv_mul(&in_object()),
                        (Owner::Object(_), None) => in_object(),
                        _ => model.placement(index),
                    },
                    fixed: object.and_then(|(of, object)| (!object?.is_dynamic()).then_some(of)),
                    part,
                    surface,
                    friction,
                    friction_combine: combine,
                    torsional,
                    rolling,
                    restitution,
                    conveyor: conveyor.map(|conveyor| turned(conveyor.velocity.into())),
                    soft,
                    grain: grain
                        .map(|(direction, along)| ColliderGrain::new(turned(direction), along, friction)),
                }
            })
            .collect();
        // The edges of a terrain, or of a mesh that touches by its triangles, need the faces of hulls.
        let any_edges =
            world.terrain.is_some() || colliders.iter().any(|collider| collider.surface.is_some());
        if any_edges {
            for collider in colliders.iter_mut().filter(|collider| collider.surface.is_none()) {
                collider.sides = sides(&collider.shape);
            }
        }
        // Colliders of one owner, and two that never move, need no check. A link that touches nothing on its
        // own robot touches nothing on other robots either, as in one model of both.
        let silent = |index: usize| {
            let rules = model.robot(index).map(|of| &setups[of].collision_rules.disabled_links);
            rules.is_some_and(|links| links.iter().any(|link| link == model.link(index)))
        };
        let silent: Vec<bool> = (0..model.solid_count()).map(silent).collect();
        let robots: Vec<_> = (0..model.solid_count()).map(|index| model.robot(index)).collect();
        model.retain_pairs(|&[a, b]| {
            let apart = robots[a].is_some() && robots[b].is_some() && robots[a] != robots[b];
            colliders[a].owner != colliders[b].owner && !(apart && (silent[a] || silent[b]))
        });
        let field = world.height_field().ok().flatten();
        if let (Some(terrain), Some(_)) = (&world.terrain, &field) {
            colliders.push(Collider {
                name: "terrain".to_owned(),
                owner: Owner::World,
                shape: ConvexShape::HalfSpace,
                placement: Isometry3::identity(),
                fixed: None,
                part: None,
                surface: None,
                faces: Vec::new(),
                sides: Vec::new(),
                friction: terrain.friction,
                friction_combine: terrain.friction_combine,
                torsional: terrain.torsional_friction,
                rolling: terrain.rolling_friction,
                restitution: terrain.restitution,
                conveyor: None,
                soft: terrain.soft,
                grain: None,
            });
        }
        let described = world.terrain.clone();
        Self { colliders, first_object, objects, model, terrain: field.map(Arc::new), described }
    }

    /// Returns the object of the world that a collider belongs to, and the collider's frame in the object if
    /// it differs.
    pub(crate) fn object_of(&self, collider: usize) -> Option<(usize, Option<&Isometry3<f64>>)> {
        let last = self.objects.last()?.end;
        if !(self.first_object..last).contains(&collider) {
            return None;
        }
        let of = self.objects.partition_point(|colliders| colliders.end <= collider);
        Some((of, self.colliders[collider].part.as_ref().map(|(_, frame)| frame)))
    }

    /// Returns `true` if both colliders are links of the robot, moving or not.
    pub(crate) fn both_links(&self, pair: [usize; 2]) -> bool {
        pair.iter().all(|&index| index < self.first_object)
    }

    /// Excludes pairs of links that are too close in the current pose, with a warning each, and warns of
    /// links inside something else. Returns `true` if such pairs exist.
    pub(crate) fn exclude_close(&mut self, robot: &Robot, warnings: &mut Vec<BuildWarning>) -> bool {
        let mut distances = Collisions::new(&self.model);
        for (index, own) in robot.articulations.iter().enumerate() {
            distances.update_robot(&self.model, index, &own.kinematics);
        }
        let mut close = Vec::new();
        for proximity in distances.within(&self.model, TOO_CLOSE) {
            let pair = self.model.pairs()[proximity.pair];
            let [first, second] = pair.map(|index| self.model.link(index).to_owned());
            if self.both_links(pair) {
                close.push(pair);
                let distance = proximity.distance.max(0.0);
                warnings.push(BuildWarning::SelfCollisionOff { first, second, distance });
            } else if pair[0] < self.first_object && proximity.distance <= 0.0 {
                warnings.push(BuildWarning::StartsInside { link: first, other: second });
            }
        }
        self.exclude(&close);
        !close.is_empty()
    }

    /// Excludes pairs of colliders.
    pub(crate) fn exclude(&mut self, pairs: &[[usize; 2]]) {
        self.model.retain_pairs(|pair| !pairs.contains(pair));
    }
}

/// Mode for mesh parts, which are already convex and have few corners.
const PART: MeshMode = MeshMode::Hull { most_corners: usize::MAX };

/// Largest number of corners of a hull whose faces are tested against triangle edges; more would cost too
/// much.
const MOST_SIDED: usize = 512;

/// Returns the face planes of a hull, for contacts with triangle edges.
fn sides(shape: &ConvexShape) -> Vec<(Vector3<f64>, f64)> {
    let ConvexShape::Hull { points } = shape else { return Vec::new() };
    if points.len() <= MOST_SIDED {
        return shape.faces();
    }
    let step = points.len().div_ceil(MOST_SIDED);
    ConvexShape::Hull { points: points.iter().copied().step_by(step).collect() }.faces()
}

/// Returns the triangles of an object that touches by its triangles.
fn surface_of(object: &Object) -> Option<Arc<TriangleSurface>> {
    let ObjectShape::Mesh(mesh) = &object.shape else { return None };
    mesh.body().ok()?.surface.clone()
}

/// Converts a grain from link axes to the axes of the solid with this index on the link.
fn of_link(setup: &RobotSetup, model: &CollisionModel, index: usize, grain: &Grain) -> (Vector3<f64>, f64) {
    let link = setup.model.frame(model.link(index)).ok();
    let placement =
        link.map_or_else(Isometry3::identity, |frame| setup.model.frames()[frame.index()].placement);
    let direction = model.placement(index).rotation.inverse() * (placement.rotation * grain.unit());
    (direction, grain.friction)
}

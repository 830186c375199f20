//! The solids of a collision model and the pairs to check.

use std::collections::HashSet;

use nalgebra::{Isometry3, UnitQuaternion};
use parry3d_f64::shape::SharedShape;

use super::shape::ConvexShape;
use super::solid::{MeshMode, Solid, SolidKind, SolidProblem};
use crate::Srdf;
use crate::model::flat::FlatModel;
use crate::nearest::{nearest, suggestion};
use crate::{Geometry, Model, Shape};

/// Options of a robot's collision model.
#[derive(Clone, Debug)]
pub struct CollisionOptions {
    /// Kind of collision shape that replaces each mesh.
    pub meshes: MeshMode,
    /// `true` if links connected by a joint are checked against each other. In nearly all robot files, the
    /// shapes of such links overlap at the joint. Default false.
    pub adjacent: bool,
    /// `true` if links that are attached to the same link by one joint each, such as two fingers, are checked
    /// against each other. Default true.
    pub siblings: bool,
    /// `true` if links of the robot are checked against each other. Default true.
    pub self_collision: bool,
    /// Collision rules of an SRDF file.
    pub srdf: Srdf,
    /// `true` if unusable shapes (such as missing meshes) and rules with unknown links are skipped and listed
    /// by [`CollisionModel::left_out`]. If false, they cause an error. Default false.
    pub leave_out_defects: bool,
}

impl Default for CollisionOptions {
    /// Convex hulls with up to 500 corners, no checks between links connected by a joint, no rules, no
    /// skipped defects.
    fn default() -> Self {
        Self {
            meshes: MeshMode::default(),
            adjacent: false,
            siblings: true,
            self_collision: true,
            srdf: Srdf::default(),
            leave_out_defects: false,
        }
    }
}

/// Frame to which a solid is fixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attachment {
    /// The world: obstacles and links that cannot move.
    World,
    /// The robot's base.
    Base,
    /// The moving body with this index in [`Model::bodies`].
    Body(usize),
}

/// Error of creating a collision model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CollisionError {
    /// A shape cannot be used.
    #[error("link \"{link}\": {problem}")]
    Solid {
        /// Name of the link.
        link: String,
        /// Defect of the shape.
        problem: SolidProblem,
    },
    /// A collision rule refers to an unknown link.
    #[error("robot \"{robot}\" has no link \"{link}\" for the collision rule{}", suggestion(.nearest.as_deref()))]
    UnknownLink {
        /// Name of the robot.
        robot: String,
        /// The unknown name in the rule.
        link: String,
        /// The closest existing link.
        nearest: Option<String>,
    },
}

/// The solids of robots and obstacles, with the pairs to check. The model is immutable while a
/// [`Collisions`](super::Collisions) uses it.
#[derive(Clone)]
pub struct CollisionModel {
    pub(super) solids: Vec<Solid>,
    /// Slot of the frame to which each solid is fixed: base, bodies, world.
    pub(super) slots: Vec<usize>,
    pub(super) pairs: Vec<[usize; 2]>,
    /// First solid of each robot.
    pub(super) robots: Vec<usize>,
    /// Index of the first obstacle among the solids.
    pub(super) robot_solids: usize,
    /// Initial placement of each obstacle.
    pub(super) obstacle_frames: Vec<Isometry3<f64>>,
    /// For each obstacle, `true` if it moves freely.
    free: Vec<bool>,
    pub(super) left_out: Vec<CollisionError>,
}

impl std::fmt::Debug for CollisionModel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("CollisionModel")
            .field("solids", &self.solids.len())
            .field("pairs", &self.pairs.len())
            .finish_non_exhaustive()
    }
}

impl CollisionModel {
    /// Prepares the shapes of `model`, and reads its mesh files.
    ///
    /// Solids fixed to the same body are never checked against each other. Solids of two bodies that are
    /// connected by a joint, or by joints with only shapeless bodies in between, are checked only if
    /// `options.adjacent` is set.
    ///
    /// # Errors
    ///
    /// [`CollisionError`] for the first unusable shape or unknown link in a rule, unless
    /// `options.leave_out_defects` is set.
    pub fn new(model: &Model, options: &CollisionOptions) -> Result<Self, CollisionError> {
        let mut built = Self {
            solids: Vec::new(),
            slots: Vec::new(),
            pairs: Vec::new(),
            robots: vec![0],
            robot_solids: 0,
            obstacle_frames: Vec::new(),
            free: Vec::new(),
            left_out: Vec::new(),
        };
        let flat = model.flat();
        let identity = Isometry3::identity();
        let base = model.base();
        let world = if base.floating { FlatModel::WORLD } else { 0 };
        let fixed = base.world_shapes.iter().map(|shape| (shape, world, identity));
        let bodies = model.bodies().iter().enumerate().flat_map(|(index, body)| {
            // Bodies' shapes in their node frames.
            let turn = nalgebra::Matrix3::from(flat.align[index].transpose());
            let turn = nalgebra::Rotation3::from_matrix_unchecked(turn);
            let within =
                Isometry3::from_parts(Default::default(), UnitQuaternion::from_rotation_matrix(&turn));
            body.shapes.iter().map(move |shape| (shape, index + 1, within))
        });
        let shapes: Vec<_> =
            base.shapes.iter().map(|shape| (shape, 0, identity)).chain(fixed).chain(bodies).collect();
        for (shape, slot, within) in shapes {
            match Solid::new(shape, &within, options.meshes) {
                Ok(solid) => {
                    built.solids.push(solid);
                    built.slots.push(slot);
                }
                Err(problem) => {
                    let error = CollisionError::Solid { link: shape.link.clone(), problem };
                    if !options.leave_out_defects {
                        return Err(error);
                    }
                    built.left_out.push(error);
                }
            }
        }
        built.robot_solids = built.solids.len();
        built.check_rules(model, options)?;
        built.choose_pairs(model, options);
        built.share_surfaces();
        Ok(built)
    }

    fn check_rules(&mut self, model: &Model, options: &CollisionOptions) -> Result<(), CollisionError> {
        let known: HashSet<&str> = model.frames().iter().map(|frame| frame.name.as_str()).collect();
        let links = options.srdf.links();
        let mut unknown: Vec<_> = links.into_iter().filter(|link| !known.contains(link)).collect();
        unknown.sort_unstable();
        let mut errors = unknown.into_iter().map(|link| CollisionError::UnknownLink {
            robot: model.name().to_owned(),
            link: link.to_owned(),
            nearest: nearest(link, known.iter().copied()).map(str::to_owned),
        });
        if options.leave_out_defects {
            self.left_out.extend(errors);
            return Ok(());
        }
        errors.next().map_or(Ok(()), Err)
    }

    fn choose_pairs(&mut self, model: &Model, options: &CollisionOptions) {
        let rules = &options.srdf;
        let both_ways = |pairs: &[(String, String)]| -> HashSet<(String, String)> {
            pairs.iter().flat_map(|(a, b)| [(a.clone(), b.clone()), (b.clone(), a.clone())]).collect()
        };
        let (disabled, enabled) = (both_ways(&rules.disabled), both_ways(&rules.enabled));
        let silent: HashSet<&str> = rules.disabled_links.iter().map(String::as_str).collect();
        let carrier = carriers(model, &self.slots);
        let parent = |slot: usize| model.flat().nodes[slot - 1].parent;
        for second in 1..self.solids.len() {
            for first in 0..second {
                let [a, b] = [first, second].map(|solid| self.slots[solid]);
                let names = [first, second].map(|solid| self.solids[solid].link.as_str());
                if a == b || !options.self_collision {
                    continue;
                }
                let jointed = |slot: usize| slot != 0 && slot != FlatModel::WORLD;
                let siblings = jointed(a) && jointed(b) && parent(a) == parent(b);
                let neighbours = [(a, b), (b, a)]
                    .into_iter()
                    .any(|(parent, child)| jointed(child) && carrier[child] == parent);
                let pair = (names[0].to_owned(), names[1].to_owned());
                let off = !options.adjacent && neighbours
                    || !options.siblings && siblings
                    || disabled.contains(&pair)
                    || names.iter().any(|name| silent.contains(name));
                if !off || enabled.contains(&pair) {
                    self.pairs.push([first, second]);
                }
            }
        }
    }

    pub(super) fn share_surfaces(&mut self) {
        for pair in &self.pairs {
            if pair.iter().any(|&solid| self.solids[solid].is_surface()) {
                pair.iter().for_each(|&solid| self.solids[solid].share());
            }
        }
    }

    /// Adds an obstacle in the world. The obstacle is checked against every link of the robot that is not
    /// fixed to the world, and against every [free object](Self::add_free_object). Returns the solid index of
    /// the obstacle, for [`Collisions::move_obstacle`](super::Collisions::move_obstacle).
    ///
    /// # Errors
    ///
    /// [`CollisionError::Solid`] if the shape is unusable.
    pub fn add_obstacle(
        &mut self,
        name: &str,
        placement: Isometry3<f64>,
        geometry: Geometry,
        meshes: MeshMode,
    ) -> Result<usize, CollisionError> {
        let solid = obstacle(name, placement, geometry, meshes)?;
        Ok(self.add(solid, placement, false))
    }

    /// Adds a freely moving object: an obstacle that is checked against every solid, including all obstacles.
    /// Returns the solid index of the object.
    ///
    /// # Errors
    ///
    /// [`CollisionError::Solid`] if the shape is unusable.
    pub fn add_free_object(
        &mut self,
        name: &str,
        placement: Isometry3<f64>,
        geometry: Geometry,
        meshes: MeshMode,
    ) -> Result<usize, CollisionError> {
        let solid = obstacle(name, placement, geometry, meshes)?;
        Ok(self.add(solid, placement, true))
    }

    /// Adds a half-space as an obstacle, such as the ground. The half-space fills everything below the plane
    /// z = 0 of the frame `placement`. Returns the solid index of the half-space.
    pub fn add_half_space(&mut self, name: &str, placement: Isometry3<f64>) -> usize {
        self.add(Solid::half_space(name, placement), placement, false)
    }

    fn add(&mut self, solid: Solid, placement: Isometry3<f64>, free: bool) -> usize {
        let index = self.solids.len();
        let checked = |other: &usize| {
            free || if *other < self.robot_solids {
                self.slots[*other] != FlatModel::WORLD
            } else {
                self.free[*other - self.robot_solids]
            }
        };
        let pairs = (0..index).filter(checked).map(|other| [other, index]).collect::<Vec<_>>();
        self.solids.push(solid);
        self.slots.push(FlatModel::WORLD);
        self.obstacle_frames.push(placement);
        self.free.push(free);
        self.pairs.extend(pairs);
        self.share_surfaces();
        index
    }

    /// Keeps only the pairs of solids for which `keep` returns `true`.
    pub fn retain_pairs(&mut self, keep: impl FnMut(&[usize; 2]) -> bool) {
        self.pairs.retain(keep);
    }

    /// Excludes all pairs of solids of two links or obstacles. Returns the number of excluded pairs.
    pub fn exclude(&mut self, first: &str, second: &str) -> usize {
        let before = self.pairs.len();
        let solids = &self.solids;
        self.pairs.retain(|pair| {
            let [a, b] = pair.map(|solid| solids[solid].link.as_str());
            (a, b) != (first, second) && (b, a) != (first, second)
        });
        before - self.pairs.len()
    }

    /// Returns the number of solids. The solids of the robots come first, then the obstacles.
    pub fn solid_count(&self) -> usize {
        self.solids.len()
    }

    /// Returns the name of the link or obstacle to which solid `index` belongs.
    pub fn link(&self, index: usize) -> &str {
        &self.solids[index].link
    }

    /// Returns the kind of shape of solid `index`.
    pub fn kind(&self, index: usize) -> SolidKind {
        self.solids[index].kind
    }

    /// Returns the frame to which solid `index` is fixed. The body index of [`Attachment::Body`] refers to
    /// the solid's [robot](Self::robot). Solids of a robot's base have [`Attachment::Base`] even if the base
    /// is fixed in the world.
    pub fn attachment(&self, index: usize) -> Attachment {
        match self.slots[index] {
            FlatModel::WORLD => Attachment::World,
            0 => Attachment::Base,
            slot => Attachment::Body(slot - 1),
        }
    }

    /// Returns the placement of solid `index` in the frame to which it is [attached](Self::attachment).
    pub fn placement(&self, index: usize) -> Isometry3<f64> {
        self.solids[index].placement
    }

    /// Returns the shape of solid `index`, relative to its [placement](Self::placement). For a
    /// [surface](MeshMode::Surface), this is the convex hull of the surface.
    pub fn convex_shape(&self, index: usize) -> ConvexShape {
        self.solids[index].convex_shape()
    }

    /// Returns the pairs of solids to check, each with the lower index first.
    pub fn pairs(&self) -> &[[usize; 2]] {
        &self.pairs
    }

    /// Returns the names of the links or obstacles of pair `index`.
    pub fn pair_links(&self, index: usize) -> [&str; 2] {
        self.pairs[index].map(|solid| self.link(solid))
    }

    /// Returns the unusable shapes and rules that were skipped.
    pub fn left_out(&self) -> &[CollisionError] {
        &self.left_out
    }

    /// Returns `true` if solid `index` is an obstacle.
    pub fn is_obstacle(&self, index: usize) -> bool {
        index >= self.robot_solids
    }

    pub(super) fn shape(&self, solid: usize) -> Option<&SharedShape> {
        self.solids[solid].shape.as_ref()
    }
}

fn obstacle(
    name: &str,
    placement: Isometry3<f64>,
    geometry: Geometry,
    meshes: MeshMode,
) -> Result<Solid, CollisionError> {
    let shape = Shape { link: name.to_owned(), placement, geometry };
    Solid::new(&shape, &Isometry3::identity(), meshes)
        .map_err(|problem| CollisionError::Solid { link: name.to_owned(), problem })
}

/// Returns, for every slot, the next slot with a shape towards the base.
fn carriers(model: &Model, slots: &[usize]) -> Vec<usize> {
    let nodes = &model.flat().nodes;
    let mut carriers = vec![0; nodes.len() + 1];
    for (index, node) in nodes.iter().enumerate() {
        let shaped = node.parent == 0 || slots.contains(&node.parent);
        carriers[index + 1] = if shaped { node.parent } else { carriers[node.parent] };
    }
    carriers
}

//! The model of a robot: its bodies, joints and frames. A model is immutable once built.

mod attach;
mod body;
pub(crate) mod configuration;
pub(crate) mod dh_frames;
pub(crate) mod flat;
pub(crate) mod followers;
mod frame;
mod inertia;
mod joint;
mod lock;
pub(crate) mod node;
pub(crate) mod per_joint;
mod scale;
mod shape;
mod springs;

use nalgebra::DVector;

pub use attach::{AttachError, Placed};
pub use body::{Base, Body};
pub use frame::{Frame, FrameId, UnknownFrame};
pub use inertia::Inertia;
pub use joint::{Coordinate, Drive, Joint, JointDynamics, JointKind, Limits, SafetyController};
pub use lock::LockError;
pub use scale::{BodyFactors, ScaleError};
pub use shape::{Geometry, Shape};
pub use springs::SpringError;

use crate::nearest::nearest;
use flat::FlatModel;

/// A robot: a base and the bodies moved by its joints.
///
/// ```
/// use motorium_robots::load;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// assert_eq!((panda.name(), panda.nq(), panda.nv()), ("panda", 8, 8));
/// let elbow = panda.joint_index("panda_joint4").unwrap();
/// assert!(panda.upper()[elbow] < 0.0, "rad");
/// let wrong = panda.frame("panda_hnad").unwrap_err();
/// assert_eq!(wrong.to_string(), "robot \"panda\" has no link \"panda_hnad\" (did you mean \"panda_hand\"?)");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Model {
    name: String,
    base: Base,
    bodies: Vec<Body>,
    frames: Vec<Frame>,
    joint_names: Vec<String>,
    joint_bodies: Vec<usize>,
    lower: DVector<f64>,
    upper: DVector<f64>,
    velocity_limit: DVector<f64>,
    effort_limit: DVector<f64>,
    flat: FlatModel,
}

impl Model {
    /// Bodies must be ordered parents first, with independent coordinates numbered 0, 1, 2 ... in that order.
    pub(crate) fn new(name: String, base: Base, bodies: Vec<Body>, frames: Vec<Frame>) -> Self {
        let mut joint_bodies = Vec::new();
        for (index, body) in bodies.iter().enumerate() {
            debug_assert!(body.parent.is_none_or(|parent| parent < index));
            if let Coordinate::Independent(column) = body.joint.coordinate {
                debug_assert_eq!(column, joint_bodies.len());
                joint_bodies.push(index);
            }
        }
        let common = followers::common_limits(&bodies, &joint_bodies);
        let limit = |pick: fn(&Limits) -> f64| DVector::from_iterator(common.len(), common.iter().map(pick));
        Self {
            joint_names: joint_bodies.iter().map(|&index| bodies[index].joint.name.clone()).collect(),
            lower: limit(|limits| limits.lower),
            upper: limit(|limits| limits.upper),
            velocity_limit: limit(|limits| limits.velocity),
            effort_limit: limit(|limits| limits.effort),
            flat: FlatModel::new(
                &bodies,
                &frames,
                &base,
                joint_bodies.len() + if base.floating { 6 } else { 0 },
            ),
            name,
            base,
            bodies,
            frames,
            joint_bodies,
        }
    }

    /// Returns the name of the robot in its file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the length of `v`, `a` and `tau`: the number of independent joints, plus six for a floating
    /// base.
    pub fn nv(&self) -> usize {
        self.joint_names.len() + if self.base.floating { 6 } else { 0 }
    }

    /// Returns the length of `q`: equal to [`nv`](Self::nv) for a fixed base, one more for a floating base.
    pub fn nq(&self) -> usize {
        self.joint_names.len() + if self.base.floating { 7 } else { 0 }
    }

    /// Returns the number of independent joints.
    pub fn joint_count(&self) -> usize {
        self.joint_names.len()
    }

    /// Returns the base, the root of the tree.
    pub fn base(&self) -> &Base {
        &self.base
    }

    /// Returns the joints' part of a configuration: all entries for a fixed base, or the entries after the
    /// base's pose for a floating base.
    pub fn joints_of_q<'a>(&self, q: &'a [f64]) -> &'a [f64] {
        &q[if self.base.floating { 7 } else { 0 }..]
    }

    /// Returns the joints' part of a velocity, acceleration or effort: everything after the six entries of a
    /// floating base.
    pub fn joints_of_v<'a>(&self, v: &'a [f64]) -> &'a [f64] {
        &v[if self.base.floating { 6 } else { 0 }..]
    }

    /// Returns `true` if the model has mimic joints.
    pub fn has_mimics(&self) -> bool {
        self.flat.coupled
    }

    /// Returns the mass of all moving bodies \[kg\]. The base is included only if it floats. See
    /// [`total_mass`](Self::total_mass).
    pub fn mass(&self) -> f64 {
        self.flat.base.mass + self.bodies.iter().map(|body| body.inertia.mass).sum::<f64>()
    }

    /// Returns the mass of all links \[kg\], including links fixed to the world.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?.model;
    /// let fixed = panda.frames()[0].inertia.mass;
    /// assert!(fixed > 0.0 && (panda.total_mass() - panda.mass() - fixed).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn total_mass(&self) -> f64 {
        self.frames.iter().map(|frame| frame.inertia.mass).sum()
    }

    /// Returns `true` if a link has a collision shape.
    pub fn has_shapes(&self) -> bool {
        !self.base.shapes.is_empty() || self.bodies.iter().any(|body| !body.shapes.is_empty())
    }

    /// Returns the names of the independent joints, in the order of `q` and `v` (after a floating base).
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Returns the index of a joint among the independent joints; `None` if there is no such joint. For a
    /// fixed base, this is its index in `q`.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joint_names.iter().position(|joint| joint == name)
    }

    /// Returns the independent joint with this index.
    pub fn joint(&self, index: usize) -> &Joint {
        &self.bodies[self.joint_bodies[index]].joint
    }

    /// Returns the moving bodies, parents before children.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// Returns the index of the body that the independent joint `index` moves.
    pub fn joint_body(&self, index: usize) -> usize {
        self.joint_bodies[index]
    }

    /// Returns the frames of all links, parents before children. The root comes first.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// Returns an iterator over the frames of all links, in their order.
    pub fn frame_ids(&self) -> impl Iterator<Item = FrameId> + use<> {
        (0..self.frames.len()).map(FrameId)
    }

    /// Returns the frame of the link with this name.
    ///
    /// # Errors
    ///
    /// [`UnknownFrame`] with the closest existing name.
    pub fn frame(&self, name: &str) -> Result<FrameId, UnknownFrame> {
        self.frames.iter().position(|frame| frame.name == name).map(FrameId).ok_or_else(|| UnknownFrame {
            name: name.to_owned(),
            robot: self.name.clone(),
            nearest: nearest(name, self.frames.iter().map(|frame| frame.name.as_str())).map(str::to_owned),
        })
    }

    /// Returns the frames of a link and of all links that it carries, directly or indirectly, across fixed
    /// and moving joints. Parents come first.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?.model;
    /// let hand = panda.carried(panda.frame("panda_hand")?);
    /// let names: Vec<_> = hand.iter().map(|frame| panda.frames()[frame.index()].name.as_str()).collect();
    /// assert_eq!((names[0], names.len()), ("panda_hand", 4), "and its tool frame and two fingers");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn carried(&self, link: FrameId) -> Vec<FrameId> {
        let mut carried = vec![false; self.frames.len()];
        carried[link.index()] = true;
        for (index, frame) in self.frames.iter().enumerate() {
            carried[index] |= frame.parent.is_some_and(|parent| carried[parent]);
        }
        (0..self.frames.len()).filter(|index| carried[*index]).map(FrameId).collect()
    }

    /// Returns the lower position limits \[rad or m\], one per independent joint; -inf without a limit. The
    /// limits of mimic joints narrow the lower, upper and velocity limits of the joint that they follow.
    pub fn lower(&self) -> &DVector<f64> {
        &self.lower
    }

    /// Returns the upper position limits \[rad or m\], one per independent joint; +inf without a limit.
    pub fn upper(&self) -> &DVector<f64> {
        &self.upper
    }

    /// Returns the velocity limits \[rad/s or m/s\], one per independent joint; +inf without a limit.
    pub fn velocity_limit(&self) -> &DVector<f64> {
        &self.velocity_limit
    }

    /// Returns the effort limits \[Nm or N\], one per independent joint; +inf without a limit.
    pub fn effort_limit(&self) -> &DVector<f64> {
        &self.effort_limit
    }

    /// Returns the collision geometry of the base. Unless the base floats, this includes all links fixed to
    /// the world.
    pub fn base_shapes(&self) -> &[Shape] {
        &self.base.shapes
    }

    pub(crate) fn flat(&self) -> &FlatModel {
        &self.flat
    }
}

/// Welds a rigid part to `carrier` (or the base); the part is expressed in the carrier's frame.
fn weld(
    base: &mut Base,
    bodies: &mut [Body],
    carrier: Option<usize>,
    inertia: &Inertia,
    added: impl Iterator<Item = Shape>,
) {
    let (whole, shapes) = match carrier {
        Some(carrier) => {
            let Body { inertia, shapes, .. } = &mut bodies[carrier];
            (inertia, shapes)
        }
        None => (&mut base.inertia, &mut base.shapes),
    };
    *whole = whole.merged(inertia);
    shapes.extend(added);
}

//! Forward kinematics: poses, velocities and accelerations of frames, in world axes.

mod centre_of_mass;
mod frames;
pub(crate) mod inverse;
mod jacobian;
mod manipulability;

pub use centre_of_mass::CentreOfMass;
pub use manipulability::TaskRows;

use crate::Model;
use crate::math::{M3, V3, Work, widest};
use crate::model::flat::{FlatModel, FramePlacement, Positions};

/// Motion of one body in world axes, at the origin of its node frame.
#[derive(Clone, Debug)]
struct BodyState {
    rotation: M3,
    position: V3,
    linear: V3,
    angular: V3,
    /// Classical acceleration.
    linear_rate: V3,
    angular_rate: V3,
}

impl BodyState {
    const START: Self = Self {
        rotation: M3::IDENTITY,
        position: V3::ZERO,
        linear: V3::ZERO,
        angular: V3::ZERO,
        linear_rate: V3::ZERO,
        angular_rate: V3::ZERO,
    };
}

/// Workspace for the kinematics of one [`Model`]. Only [`new`](Self::new) allocates.
///
/// Call one of the update methods before any other method. Methods panic if the length of a slice, the size
/// of a matrix or the number of bodies does not match the model.
///
/// ```
/// use motorium_robots::{Kinematics, Reference, load};
/// use nalgebra::Matrix6xX;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, tool) = (&panda.model, panda.end_effector(None)?);
/// let mut kinematics = Kinematics::new(model);
/// let mut jacobian = Matrix6xX::zeros(model.nv());
///
/// let q = panda.profile.as_ref().unwrap().home(model)?;
/// kinematics.update(model, q.as_slice());
/// kinematics.jacobian(model, tool, Reference::LocalWorldAligned, &mut jacobian);
/// assert!(kinematics.pose(model, tool).translation.x > 0.3, "m");
/// // Turning the first joint moves the tool sideways.
/// assert!(jacobian[(1, 0)] > 0.3, "m/rad");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Kinematics {
    positions: Positions,
    /// The base, then one per body.
    bodies: Vec<BodyState>,
    /// Node frames in their body frames.
    align: Vec<M3>,
    /// A frame of the world next to a floating base.
    world: BodyState,
}

impl Kinematics {
    /// Creates a workspace for `model`. Results are valid after the first update.
    pub fn new(model: &Model) -> Self {
        let slots = model.bodies().len() + 1;
        Self {
            positions: Positions::new(model.bodies().len()),
            bodies: vec![BodyState::START; slots],
            align: model.flat().align.clone(),
            world: BodyState::START,
        }
    }

    /// Computes forward kinematics of all bodies at `q` (nq). Velocities and accelerations become zero.
    pub fn update(&mut self, model: &Model, q: &[f64]) {
        self.set_positions(model, q);
        for body in &mut self.bodies {
            (body.linear, body.angular) = (V3::ZERO, V3::ZERO);
            (body.linear_rate, body.angular_rate) = (V3::ZERO, V3::ZERO);
        }
    }

    /// Computes forward kinematics of all bodies at `q` (nq) with the velocity `v` (nv). The acceleration `a`
    /// is assumed to be zero, so the acceleration of each frame is its drift `Jdot v`.
    pub fn update_with_velocity(&mut self, model: &Model, q: &[f64], v: &[f64]) {
        widest(Moving { kinematics: self, model, motion: (q, v) });
    }

    /// Computes forward kinematics of all bodies at `q` (nq) with the velocity `v` (nv) and the acceleration
    /// `a` (nv).
    pub fn update_with_acceleration(&mut self, model: &Model, q: &[f64], v: &[f64], a: &[f64]) {
        assert_eq!(a.len(), model.nv(), "length of a");
        self.set_positions(model, q);
        self.differentiate::<true>(model, v, a);
    }

    #[inline(always)]
    fn check(&self, model: &Model, q: &[f64]) {
        assert_eq!(q.len(), model.nq(), "length of q");
        assert_eq!(
            self.bodies.len(),
            model.bodies().len() + 1,
            "the workspace was made for a different model"
        );
    }

    #[inline(always)]
    fn set_positions(&mut self, model: &Model, q: &[f64]) {
        self.check(model, q);
        let flat = model.flat();
        self.positions.update(&flat.nodes, q);
        (self.bodies[0].rotation, self.bodies[0].position) = flat.base_pose(q);
        for (index, (node, position)) in flat.nodes.iter().zip(self.positions.iter()).enumerate() {
            let (outer, inner) = self.bodies.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let (rotation, translation) = node.pose(position);
            body.rotation = parent.rotation * rotation;
            body.position = parent.position + parent.rotation * translation;
        }
    }

    #[inline(always)]
    fn differentiate<const ACCELERATED: bool>(&mut self, model: &Model, v: &[f64], a: &[f64]) {
        assert_eq!(v.len(), model.nv(), "length of v");
        let flat = model.flat();
        if flat.floating {
            let base = &mut self.bodies[0];
            let r = base.rotation;
            let (linear, angular) = (V3::from_slice(&v[..3]), V3::from_slice(&v[3..6]));
            // Spatial to classical acceleration.
            let mut rate = angular.cross(linear);
            let mut angular_rate = V3::ZERO;
            if ACCELERATED {
                rate += V3::from_slice(&a[..3]);
                angular_rate = V3::from_slice(&a[3..6]);
            }
            (base.linear, base.angular) = (r * linear, r * angular);
            (base.linear_rate, base.angular_rate) = (r * rate, r * angular_rate);
        }
        for (index, node) in flat.nodes.iter().enumerate() {
            let (outer, inner) = self.bodies.split_at_mut(index + 1);
            let (parent, body) = (&outer[node.parent], &mut inner[0]);
            let arm = body.position - parent.position;
            let across = parent.angular.cross(arm);
            let own = body.rotation.z * (node.multiplier * v[node.column]);
            let mut linear = parent.linear + across;
            let mut angular = parent.angular;
            let mut linear_rate =
                parent.linear_rate + parent.angular_rate.cross(arm) + parent.angular.cross(across);
            let mut angular_rate = parent.angular_rate;
            let turning = parent.angular.cross(own);
            if node.prismatic {
                linear += own;
                linear_rate += turning * 2.0;
            } else {
                angular += own;
                angular_rate += turning;
            }
            if ACCELERATED {
                let own = body.rotation.z * (node.multiplier * a[node.column]);
                if node.prismatic { linear_rate += own } else { angular_rate += own }
            }
            (body.linear, body.angular) = (linear, angular);
            (body.linear_rate, body.angular_rate) = (linear_rate, angular_rate);
        }
    }

    /// Returns the body on which a frame is mounted.
    #[inline(always)]
    fn carrier(&self, placement: &FramePlacement) -> &BodyState {
        if placement.slot == FlatModel::WORLD { &self.world } else { &self.bodies[placement.slot] }
    }
}

/// Poses and velocities at these positions and velocities.
struct Moving<'a> {
    kinematics: &'a mut Kinematics,
    model: &'a Model,
    motion: (&'a [f64], &'a [f64]),
}

impl Work for Moving<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Self { kinematics, model, motion: (q, v) } = self;
        kinematics.set_positions(model, q);
        kinematics.differentiate::<false>(model, v, &[]);
    }
}

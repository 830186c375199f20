//! Joints in the form used by the algorithms: fixed joints are removed, and mimic joints refer to the joint
//! that they follow.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

/// Type of motion of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum JointKind {
    /// Rotation about the axis, within limits \[rad\].
    Revolute,
    /// Unlimited rotation about the axis; its coordinate is one unbounded angle \[rad\].
    Continuous,
    /// Translation along the axis \[m\].
    Prismatic,
}

/// Limits of one joint, infinite if missing from the file. Units: rad or m, rad/s or m/s, Nm or N.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Minimum position.
    pub lower: f64,
    /// Maximum position.
    pub upper: f64,
    /// Maximum speed in either direction.
    pub velocity: f64,
    /// Maximum effort in either direction.
    pub effort: f64,
}

impl Limits {
    /// Infinite limits.
    pub const NONE: Self = Self {
        lower: f64::NEG_INFINITY,
        upper: f64::INFINITY,
        velocity: f64::INFINITY,
        effort: f64::INFINITY,
    };
}

/// Passive joint forces, for simulators. No dynamics function of this crate includes them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointDynamics {
    /// Viscous damping \[Nms/rad or Ns/m\].
    pub damping: f64,
    /// Static (Coulomb) friction \[Nm or N\].
    pub friction: f64,
    /// Stiffness of a spring in the joint \[Nm/rad or N/m\]; 0 without a spring.
    pub stiffness: f64,
    /// Rest position of the spring \[rad or m\].
    pub rest: f64,
}

/// The drive of a joint, as described in the robot's file. Only its [`armature`](Self::armature) affects the
/// dynamics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Gear reduction: motor revolutions per joint revolution, or motor radians per metre of a prismatic
    /// joint.
    pub reduction: f64,
    /// Inertia of the motor's rotor about its axis \[kg m2\].
    pub rotor_inertia: f64,
}

impl Drive {
    /// A direct drive without rotor inertia. Default if the file describes no drive.
    pub const DIRECT: Self = Self { reduction: 1.0, rotor_inertia: 0.0 };

    /// Returns the rotor inertia reflected to the joint \[kg m2 or kg\], which is included in the diagonal of
    /// the mass matrix.
    pub fn armature(&self) -> f64 {
        self.reduction * self.reduction * self.rotor_inertia
    }
}

impl Default for Drive {
    fn default() -> Self {
        Self::DIRECT
    }
}

/// Soft limits of a joint inside its hard limits (URDF's `<safety_controller>`). Intended for controllers; no
/// function of this crate applies them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyController {
    /// Lower soft limit of the position \[rad or m\].
    pub soft_lower: f64,
    /// Upper soft limit of the position \[rad or m\].
    pub soft_upper: f64,
    /// Speed that is allowed per distance from the soft position limit \[1/s\].
    pub k_position: f64,
    /// Effort that is allowed per difference between the speed and the allowed speed \[Nms/rad or Ns/m\].
    pub k_velocity: f64,
}

/// Source of a joint's position: an independent coordinate, or the joint that a mimic joint follows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// Independent coordinate: index in the joints' part of `q`
    /// ([`Model::joints_of_q`](crate::Model::joints_of_q)).
    Independent(usize),
    /// The joint follows the independent joint `of`: position = `multiplier * q[of] + offset`. Chains of
    /// mimic joints are resolved to an independent joint.
    Mimic {
        /// Index of the followed joint among the independent joints.
        of: usize,
        /// Position per unit of the followed joint's position.
        multiplier: f64,
        /// Position when the followed joint is at zero \[rad or m\].
        offset: f64,
    },
}

impl Coordinate {
    /// Returns the index of the independent joint that determines the position. For a fixed base, this is the
    /// index in `q` and `v`. For a floating base, add 7 for the index in `q` and 6 for the index in `v`.
    pub fn index(&self) -> usize {
        match *self {
            Self::Independent(index) => index,
            Self::Mimic { of, .. } => of,
        }
    }

    /// Returns the joint position per unit of `q[index]`.
    pub fn multiplier(&self) -> f64 {
        match *self {
            Self::Independent(_) => 1.0,
            Self::Mimic { multiplier, .. } => multiplier,
        }
    }

    /// Returns the joint position at `q[index] == 0` \[rad or m\].
    pub fn offset(&self) -> f64 {
        match *self {
            Self::Independent(_) => 0.0,
            Self::Mimic { offset, .. } => offset,
        }
    }

    /// Returns the position of the joint \[rad or m\]. `q` is the joints' part of the configuration.
    pub fn position(&self, q: &[f64]) -> f64 {
        self.multiplier() * q[self.index()] + self.offset()
    }
}

/// The joint that moves a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Name of the joint in the file.
    pub name: String,
    /// Type of motion.
    pub kind: JointKind,
    /// Axis of rotation or translation in the joint frame, which is the body frame.
    pub axis: Unit<Vector3<f64>>,
    /// Pose of the body frame in the parent body's frame at joint position zero, including the transforms of
    /// fixed joints in between.
    pub placement: Isometry3<f64>,
    /// Limits of this joint alone. [`Model::lower`](crate::Model::lower) and the related methods also respect
    /// the limits of joints that follow this joint.
    pub limits: Limits,
    /// Passive forces: damping, friction and spring.
    pub dynamics: JointDynamics,
    /// Reduction and rotor of the drive.
    pub drive: Drive,
    /// Limits for controllers; `None` if the file specifies none.
    pub safety: Option<SafetyController>,
    /// Source of the position.
    pub coordinate: Coordinate,
}

impl Joint {
    /// Returns the pose of the body frame in the parent body's frame at joint position `x` \[rad or m\].
    pub fn pose(&self, x: f64) -> Isometry3<f64> {
        let motion = match self.kind {
            JointKind::Prismatic => {
                Isometry3::from_parts((self.axis.into_inner() * x).into(), UnitQuaternion::identity())
            }
            JointKind::Revolute | JointKind::Continuous => Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_axis_angle(&self.axis, x),
            ),
        };
        self.placement * motion
    }
}

//! Parts of a profile: base, end effectors, feet, wheels and rotors.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use serde::Deserialize;

/// Kind of base: fixed to the world, or floating.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BaseKind {
    /// Root link fixed to the world, unless the URDF specifies otherwise.
    #[default]
    Fixed,
    /// Floating root link.
    Floating,
}

/// Pose of a floating base in the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BasePose {
    /// Position of the base's origin \[m\].
    pub position: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes x, y, z \[rad\].
    #[serde(default)]
    pub rpy: [f64; 3],
}

impl BasePose {
    /// Converts an isometry to a pose.
    pub fn from_isometry(pose: &Isometry3<f64>) -> Self {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        Self { position: pose.translation.vector.into(), rpy: [roll, pitch, yaw] }
    }

    /// Returns the pose as an isometry, the base frame in the world.
    pub fn isometry(&self) -> Isometry3<f64> {
        let ([x, y, z], [roll, pitch, yaw]) = (self.position, self.rpy);
        Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }
}

/// A frame with which the robot acts on its environment.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffector {
    /// Link whose frame is controlled.
    pub frame: String,
    /// Joints that move the frame.
    pub joints: Vec<String>,
    /// Joints of the fingers, if any.
    #[serde(default)]
    pub fingers: Vec<String>,
}

/// A contact on which the robot stands: a point, a ball or a flat sole.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Foot {
    /// Link whose frame touches the ground, at its origin unless `radius` is set.
    pub frame: String,
    /// Joints that move the foot.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Radius of a ball or wheel about the frame's origin \[m\]. The contact point is this far below the
    /// origin.
    pub radius: Option<f64>,
    /// Sides along the frame's x and y of a flat sole centred on its origin \[m\].
    pub sole: Option<[f64; 2]>,
    /// Coefficient of friction of the surface, for simulators; 0 for a ball that rolls in a socket. Default:
    /// the robot's friction.
    pub friction: Option<f64>,
}

/// Steering of a mobile base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Steering {
    /// Two wheels, or two rows of wheels, with independent speeds.
    Differential,
    /// Steered front wheels whose axes intersect at one point on the rear axle's line.
    Ackermann,
    /// Any planar velocity.
    Omnidirectional,
    /// Every wheel steers independently.
    SteeredWheels,
}

impl Steering {
    /// Name of the drive in a profile.
    pub fn name(self) -> &'static str {
        match self {
            Self::Differential => "differential",
            Self::Ackermann => "ackermann",
            Self::Omnidirectional => "omnidirectional",
            Self::SteeredWheels => "steered_wheels",
        }
    }
}

/// Properties of a mobile base. Lists of wheels and steering joints are ordered front to rear, left before
/// right.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MobileBase {
    /// Kind of steering.
    pub drive: Steering,
    /// Link that represents the base: x forwards, z up.
    pub frame: String,
    /// Joints that form the base's pose in the world, if the model has such joints: x, y, yaw.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Joints that turn wheels.
    #[serde(default)]
    pub wheels: Vec<String>,
    /// Joints that steer wheels.
    #[serde(default)]
    pub steering: Vec<String>,
    /// Radius of the wheels \[m\].
    pub wheel_radius: Option<f64>,
    /// Distance between the centres of left and right wheels \[m\].
    pub track: Option<f64>,
    /// Distance between the front and rear axle \[m\].
    pub wheelbase: Option<f64>,
}

/// Spin direction of a rotor, seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spin {
    /// Drag torque turns the robot counterclockwise.
    Clockwise,
    /// Drag torque turns the robot clockwise.
    Counterclockwise,
}

/// A rotor that pulls along the z axis of its frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotor {
    /// Link with the point of action of the thrust at its frame's origin.
    pub frame: String,
    /// Spin direction.
    pub spin: Spin,
    /// Largest thrust \[N\].
    pub max_thrust: f64,
    /// Drag torque about z per thrust \[m\].
    pub torque_per_thrust: f64,
}

//! Parts of a profile: base, end effectors, feet, wheels and rotors.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use serde::Deserialize;

/// Kind of base: fixed to the world, or floating.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum BaseKind {
    /// The root link is fixed to the world, unless the URDF specifies otherwise.
    #[default]
    Fixed,
    /// The root link floats.
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
    /// Creates a pose from an isometry.
    pub fn from_isometry(pose: &Isometry3<f64>) -> Self {
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        Self { position: pose.translation.vector.into(), rpy: [roll, pitch, yaw] }
    }

    /// Returns the pose of the base frame in the world as an isometry.
    pub fn isometry(&self) -> Isometry3<f64> {
        let ([x, y, z], [roll, pitch, yaw]) = (self.position, self.rpy);
        Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }
}

/// A frame with which the robot acts on its environment.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffector {
    /// Name of the link whose frame is controlled.
    pub frame: String,
    /// Names of the joints that move the frame.
    pub joints: Vec<String>,
    /// Names of the finger joints; empty without fingers.
    #[serde(default)]
    pub fingers: Vec<String>,
}

/// A foot on which the robot stands: a point, a ball or a flat sole.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Foot {
    /// Name of the link that touches the ground. The contact point is at the origin of the link's frame,
    /// unless `radius` is set.
    pub frame: String,
    /// Names of the joints that move the foot.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Radius of a ball or wheel about the frame's origin \[m\]. The contact point is below the origin by
    /// this distance.
    pub radius: Option<f64>,
    /// Side lengths of a flat sole along the x and y axes of the frame \[m\]. The sole is centred on the
    /// frame's origin.
    pub sole: Option<[f64; 2]>,
    /// Coefficient of friction of the foot's surface, for simulators; 0 for a ball that rolls in a socket.
    /// Default: the coefficient that the simulator uses for the robot.
    pub friction: Option<f64>,
}

/// Type of steering of a mobile base.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Steering {
    /// Two wheels, or two rows of wheels, with independently driven sides.
    Differential,
    /// Steered front wheels whose axes intersect at one point on the rear axle's line.
    Ackermann,
    /// The base can move with any planar velocity.
    Omnidirectional,
    /// Every wheel steers independently.
    SteeredWheels,
}

impl Steering {
    /// Returns the name of the steering type in a profile.
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
    /// Type of steering.
    pub drive: Steering,
    /// Name of the link that represents the base, with x forwards and z up.
    pub frame: String,
    /// Names of the joints x, y and yaw that form the base's pose in the world; empty if the model has no
    /// such joints.
    #[serde(default)]
    pub joints: Vec<String>,
    /// Names of the joints that rotate wheels.
    #[serde(default)]
    pub wheels: Vec<String>,
    /// Names of the joints that steer wheels.
    #[serde(default)]
    pub steering: Vec<String>,
    /// Radius of the wheels \[m\].
    pub wheel_radius: Option<f64>,
    /// Distance between the centres of left and right wheels \[m\].
    pub track: Option<f64>,
    /// Distance between the front and the rear axle \[m\].
    pub wheelbase: Option<f64>,
}

/// Spin direction of a rotor, seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Spin {
    /// Clockwise. The drag torque turns the robot counterclockwise.
    Clockwise,
    /// Counterclockwise. The drag torque turns the robot clockwise.
    Counterclockwise,
}

/// A rotor that applies thrust along the z axis of its frame.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotor {
    /// Name of the link at whose origin the thrust acts.
    pub frame: String,
    /// Spin direction.
    pub spin: Spin,
    /// Maximum thrust \[N\].
    pub max_thrust: f64,
    /// Drag torque about z per unit of thrust \[m\].
    pub torque_per_thrust: f64,
}

//! Robot models for motorium: URDF, kinematics and dynamics, independent of the runtime.
//!
//! [`load`] turns a catalogue name, a folder, a URDF or an MJCF file into a [`Model`]. [`Kinematics`],
//! [`Dynamics`], [`ConstrainedDynamics`] and [`InverseKinematics`] are preallocated workspaces for a model.
//! Only `new` allocates.
//!
//! # Conventions
//!
//! - SI units, radians, `f64`. The world frame is the frame of the URDF's root link, unless the base floats.
//! - `v`, `a` and `tau` have one entry per *independent* joint (revolute, continuous, prismatic): parents
//!   before children, siblings in the order of the URDF file. A planar joint counts as two prismatic joints
//!   and a revolute joint. A continuous joint is one unbounded angle. On a fixed base, `nq == nv`.
//! - With a floating base, `q` starts with the base's position in the world and its orientation, a quaternion
//!   x y z w; `v` starts with the velocity of the base's origin and its angular velocity, both in base axes.
//!   `a` starts with the derivative of these six numbers (the spatial acceleration, not the classical
//!   acceleration), and `tau` starts with a wrench at the base's origin in base axes. These conventions are
//!   Pinocchio's; [`Model::to_pinocchio`] and [`Model::to_mujoco`] convert the remaining differences.
//! - The position of a mimic joint is `multiplier * q[of] + offset`. Its motion, forces and inertia are
//!   included in the column of the joint that it follows.
//! - Spatial vectors and the rows of a Jacobian have the linear part first, then the angular part.
//! - A body frame is the frame of the URDF child link of its joint; links fixed to it are merged into it.
//! - Joint damping and friction are read from the file, but no dynamics function of this crate includes them;
//!   simulators add them. Drive rotors in the file are included as an armature (reduction squared times
//!   inertia) on the diagonal of `M`.
//!
//! ```
//! use motorium_robots::{Kinematics, load};
//!
//! let robot = load("panda", std::path::Path::new(".")).unwrap();
//! let model = &robot.model;
//! let home = robot.profile.as_ref().unwrap().home(model).unwrap();
//! let tool = robot.end_effector(None).unwrap();
//! let mut kinematics = Kinematics::new(model);
//! kinematics.update(model, home.as_slice());
//! assert!(kinematics.pose(model, tool).translation.z > 0.4);
//! ```
//!
//! # Modules
//!
//! The modules form layers. Each module uses only modules above it or in its own row, and no two import each
//! other; a test checks this.
//!
//! | modules | contents |
//! |---|---|
//! | `math`, `nearest`, `file` | three-vectors, spatial algebra, [Lie groups](lie), twists; names and files |
//! | `mesh` | meshes, hulls and convex parts |
//! | `model` | links, joints, inertias, shapes; configurations and values per joint |
//! | `kinematics`, `dynamics`, `actuator` | algorithms; drives and motors |
//! | `geometry` | distances between links, collision rules |
//! | `profile` | poses, gains, end effectors |
//! | `formats`, `catalogue` | readers of URDF and [MJCF](mjcf), options of reading; included robots |
//! | `loading` | robots ready to use, their drafts, images and digests |

mod actuator;
mod catalogue;
mod dynamics;
mod file;
mod formats;
mod geometry;
mod kinematics;
mod loading;
mod math;
mod mesh;
mod model;
mod nearest;
mod profile;

pub use actuator::{
    Activation, Actuator, ActuatorError, ActuatorNetwork, ActuatorSettings, ActuatorTable,
    ActuatorTableError, Delay, DriveCommand, Drivetrain, DrivetrainTable, EffortLaw, Envelope, EnvelopeTable,
    InputOrder, JointLaw, Motor, NetworkError, NetworkSettings, NetworkTable, NetworkWeights, Thermal,
    ThermalTable,
};
pub use catalogue::{Entry, catalogue};
pub use dynamics::{
    ConstrainedDynamics, ConstrainedError, Constraint, Derivatives, Dynamics, MassFactor, Momentum,
    PARAMETERS, SingularMassMatrix, Wrench,
};
pub use file::read_bounded;
pub use formats::colours::{Colour, LinkColours};
pub use formats::format::{FileFormat, is_mjcf};
pub use formats::lines::{FilePosition, Position};
pub use formats::mjcf;
pub use formats::mjcf::{MjcfError, MjcfProblem, MjcfRobot, parse_mjcf};
pub use formats::options::{BaseMode, LoadOptions, MimicMode, ProfileChoice, ShapeSource};
pub use formats::packages::PackagePath;
pub use formats::urdf::{
    DrawnRobot, ModelWarning, UrdfError, UrdfProblem, UrdfRobot, draw_as_urdf, parse_urdf, parse_urdf_with,
    pinocchio_joint_order,
};
pub use geometry::srdf::{Srdf, SrdfError};
pub use geometry::{
    Attachment, CollisionError, CollisionModel, CollisionOptions, Collisions, ConvexShape, MeshMode,
    Proximity, SolidKind, SolidProblem, SurfaceEdge, SurfaceTriangle, TriangleSurface, convex_corners,
    fit_capsule, nearest_on_triangle,
};
pub use kinematics::inverse::{IkFailure, IkOptions, IkProgress, IkSolution, InverseKinematics};
pub use kinematics::{CentreOfMass, Kinematics, TaskRows};
pub use loading::draft::draft_profile;
pub use loading::end_effector::EndEffectorError;
pub use loading::installed::{Installed, installed, installed_folder};
pub use loading::load::{LoadError, Loaded, load, load_with};
pub use loading::postures::Posture;
pub use loading::setting_error::SettingError;
pub use loading::source::{RobotSource, RobotSourceError};
pub use math::degrees::{degrees_doubt, suspected_degrees};
pub use math::twist::{Reference, Twist};
pub use math::{M3, V3, lie};
pub use mesh::{MeshError, MeshProblem, TriangleMesh, VolumeProperties};
pub use model::per_joint::{PerJoint, PerJointError};
pub use model::{
    AttachError, Base, Body, BodyFactors, Coordinate, Drive, Frame, FrameId, Geometry, Inertia, Joint,
    JointDynamics, JointKind, Limits, LockError, Model, Placed, SafetyController, ScaleError, Shape,
    SpringError, UnknownFrame,
};
pub use nearest::{nearest, suggestion};
pub use profile::{
    BaseKind, BasePose, EndEffector, Foot, Gains, MobileBase, Profile, ProfileError, Rotor, Spin, Steering,
};

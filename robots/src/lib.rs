//! Robot models for motorium: URDF, kinematics and dynamics, independent of the runtime.
//!
//! [`load`] turns a catalogue name, a folder, a URDF or an MJCF file into a [`Model`]. [`Kinematics`],
//! [`Dynamics`], [`ConstrainedDynamics`] and [`InverseKinematics`] are preallocated workspaces for it: only
//! `new` allocates.
//!
//! # Conventions
//!
//! - SI units, radians, `f64`. The world frame is the frame of the URDF's root link, unless the base floats.
//! - `v`, `a` and `tau` have one entry per *independent* joint (revolute, continuous, prismatic), parents
//!   before children, siblings in the order of the URDF file; a planar joint counts as two prismatic joints
//!   and a revolute one. A continuous joint is one unbounded angle. On a fixed base `nq == nv`.
//! - With a floating base, `q` starts with the base's position in the world and its orientation, a quaternion
//!   x y z w; `v` starts with the velocity of the base's origin and its angular velocity, both in base axes.
//!   `a` starts with the derivative of these six numbers (the spatial acceleration, not the classical one),
//!   and `tau` with a wrench at the base's origin in its axes. This is Pinocchio's convention;
//!   [`Model::to_pinocchio`] and [`Model::to_mujoco`] convert the differences.
//! - A mimic joint is at `multiplier * q[of] + offset`; its motion, forces and inertia are included in the
//!   column of the joint it follows.
//! - Spatial vectors and the rows of a Jacobian have the linear part first, then the angular part.
//! - A body frame is the frame of the URDF child link of its joint; links fixed to it are merged into it.
//! - Joint damping and friction are read but not part of any dynamics quantity here; simulators add them.
//!   Drive rotors in the file are included as an armature (reduction squared times inertia) on the diagonal
//!   of `M`.
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
//! The modules form layers. Each uses only modules above it or in its own row, and no two import each other,
//! which a test checks.
//!
//! | modules | contents |
//! |---|---|
//! | [`algebra`], [`lie`], `mesh` | three-vectors, spatial algebra, Lie groups, meshes |
//! | `model` | links, joints, inertias, shapes |
//! | `configuration`, `kinematics`, `dynamics`, `per_joint`, `srdf` | algorithms; collision rules |
//! | `geometry` | distances between links |
//! | `profile`, `options` | poses, gains, end effectors; options of loading |
//! | `urdf`, [`mjcf`] | readers of files |
//! | `load`, `catalogue`, `settings`, `digest`, `draft`, `drawn` | robots ready to use, and their pictures |

mod actuator;
pub mod algebra;
mod catalogue;
mod colours;
mod configuration;
mod digest;
mod draft;
mod drawn;
mod dynamics;
mod end_effector;
mod file;
mod format;
mod geometry;
mod installed;
mod inverse_kinematics;
mod joint_subset;
mod kinematics;
pub mod lie;
mod lines;
mod load;
mod mesh;
pub mod mjcf;
mod model;
mod nearest;
mod options;
mod packages;
mod per_joint;
mod postures;
mod profile;
mod setting_error;
mod settings;
mod source;
mod srdf;
mod twist;
mod urdf;

pub use actuator::{
    Activation, Actuator, ActuatorError, ActuatorNetwork, ActuatorSettings, ActuatorTable,
    ActuatorTableError, Delay, DriveCommand, Drivetrain, DrivetrainTable, EffortLaw, Envelope, EnvelopeTable,
    InputOrder, JointLaw, Motor, NetworkError, NetworkSettings, NetworkTable, NetworkWeights, Thermal,
    ThermalTable,
};
pub use catalogue::{Entry, catalogue};
pub use colours::{Colour, LinkColours};
pub use draft::draft_profile;
pub use dynamics::{
    ConstrainedDynamics, ConstrainedError, Constraint, Derivatives, Dynamics, MassFactor, Momentum,
    PARAMETERS, SingularMassMatrix, Wrench,
};
pub use end_effector::EndEffectorError;
pub use file::read_bounded;
pub use format::{FileFormat, is_mjcf};
pub use geometry::{
    Attachment, CollisionError, CollisionModel, CollisionOptions, Collisions, ConvexShape, MeshMode,
    Proximity, SolidKind, SolidProblem, SurfaceEdge, SurfaceTriangle, TriangleSurface, convex_corners,
    fit_capsule, nearest_on_triangle,
};
pub use installed::{Installed, installed, installed_folder};
pub use inverse_kinematics::{IkFailure, IkOptions, IkProgress, IkSolution, InverseKinematics};
pub use kinematics::{CentreOfMass, Kinematics, TaskRows};
pub use lines::Position;
pub use load::{LoadError, Loaded, load, load_with};
pub use mesh::{MeshError, MeshProblem, TriangleMesh, VolumeProperties};
pub use mjcf::{MjcfError, MjcfProblem, MjcfRobot, parse_mjcf};
pub use model::{
    AttachError, Base, Body, BodyFactors, Coordinate, Drive, Frame, FrameId, Geometry, Inertia, Joint,
    JointDynamics, JointKind, Limits, LockError, Model, Placed, SafetyController, ScaleError, Shape,
    SpringError, UnknownFrame,
};
pub use nearest::{nearest, suggestion};
pub use options::{BaseMode, LoadOptions, MimicMode, ProfileChoice, ShapeSource};
pub use packages::PackagePath;
pub use per_joint::{PerJoint, PerJointError};
pub use postures::Posture;
pub use profile::{
    BaseKind, BasePose, EndEffector, Foot, Gains, MobileBase, Profile, ProfileError, Rotor, Spin, Steering,
};
pub use setting_error::SettingError;
pub use source::{RobotSource, RobotSourceError};
pub use srdf::{Srdf, SrdfError};
pub use twist::{Reference, Twist};
pub use urdf::{
    DrawnRobot, ModelWarning, UrdfError, UrdfProblem, UrdfRobot, draw_as_urdf, parse_urdf, parse_urdf_with,
    pinocchio_joint_order,
};

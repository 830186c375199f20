//! Robots of a plan: assignment of topics to robots, descriptions, and link poses.

use foxglove::messages::{FrameTransform, FrameTransforms};
use motorium::declare::RobotReference;
use motorium::plan::{ComponentPlan, Plan, PortPlan};
use motorium::state::{BaseState, JointState, StateBuffer as _};
use motorium_recordings::messages::wire;
use motorium_robots::{
    BasePose, Kinematics, LoadOptions, Loaded, RobotSource, RobotSourceError, ShapeSource,
};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::Schema;
use super::fields::{quaternion, timestamp, vector};

/// Parent frame of robots and objects.
pub(super) const WORLD: &str = "world";

/// Description of a robot for viewers, the `robot_description` of ROS.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// Name of the robot in the graph.
    pub robot: String,
    /// Topic of the description: `/robot_description`, or `/ROBOT/robot_description` with several robots.
    pub topic: String,
    /// URDF text of the robot: the text of its file, or a conversion of its MJCF.
    pub text: String,
    /// URDF text for viewers of a recorded file, which cannot request `meshes`. In this text, collision
    /// shapes replace the meshes.
    pub plain: String,
    /// MJCF text of the robot's file; `None` if the file is not MJCF.
    pub mjcf: Option<String>,
    /// Meshes without a file: the name in the description and the Wavefront OBJ text of each.
    pub meshes: Vec<(String, String)>,
    /// Prefix of the robot's link names in [`FrameTransforms`]: empty, or `ROBOT/` with several robots.
    pub frame_prefix: String,
}

impl Description {
    /// Returns the schema of the message: one text named `data`, as in ROS.
    pub fn schema(&self) -> Schema {
        let (mut field, mut message, mut file, mut data) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        wire::bytes(1, b"data", &mut field);
        // number 1, optional, a string
        for (key, value) in [(3, 1), (4, 1), (5, 9)] {
            wire::key(key, wire::VARINT, &mut field);
            wire::varint(value, &mut field);
        }
        wire::bytes(1, b"RobotDescription", &mut message);
        wire::bytes(2, &field, &mut message);
        wire::bytes(1, b"motorium.v1.RobotDescription.proto", &mut file);
        wire::bytes(2, b"motorium.v1", &mut file);
        wire::bytes(4, &message, &mut file);
        wire::bytes(12, b"proto3", &mut file);
        wire::bytes(1, &file, &mut data);
        Schema { name: "motorium.v1.RobotDescription".to_string(), encoding: "protobuf", data }
    }

    /// Encodes the description as a message.
    pub fn encode(&self) -> Vec<u8> {
        let mut message = Vec::with_capacity(self.plain.len() + 8);
        wire::bytes(1, self.plain.as_bytes(), &mut message);
        message
    }
}

/// Robots of a plan without duplicates, in the order of its components.
pub(crate) fn robots(plan: &Plan) -> Vec<&RobotReference> {
    let mut robots: Vec<&RobotReference> = Vec::new();
    for robot in plan.components.iter().flat_map(|component| component.robot.iter().chain(&component.robots))
    {
        if !robots.iter().any(|known| known.name == robot.name) {
            robots.push(robot);
        }
    }
    robots
}

/// Returns the descriptions of the robots of a plan. A robot whose file no longer exists is skipped.
///
/// ```
/// # fn of(plan: &motorium::plan::Plan) {
/// for description in motorium_bridges::foxglove::descriptions(plan) {
///     println!("{}: {} bytes", description.topic, description.text.len());
/// }
/// # }
/// ```
pub fn descriptions(plan: &Plan) -> Vec<Description> {
    let robots = robots(plan);
    let alone = robots.len() == 1;
    let describe = |robot: &&RobotReference| {
        let loaded = load(robot).ok()?;
        let drawn = loaded.drawn().ok()??;
        let mjcf = if loaded.is_mjcf().ok()? { loaded.text().ok()? } else { None };
        let meshes = drawn.meshes.iter().map(|(name, mesh)| (name.clone(), mesh.to_shaded_obj())).collect();
        let (plain, text) = (drawn.without_meshes(), drawn.text);
        let name = &robot.name;
        let topic =
            if alone { "/robot_description".to_string() } else { format!("/{name}/robot_description") };
        let (robot, frame_prefix) = (name.clone(), prefix(plan, name));
        Some(Description { robot, topic, text, plain, mjcf, meshes, frame_prefix })
    };
    robots.iter().filter_map(describe).collect()
}

fn prefix(plan: &Plan, robot: &str) -> String {
    if robots(plan).len() == 1 { String::new() } else { format!("{robot}/") }
}

/// Loads a robot of a plan with its base at the origin.
pub(crate) fn load(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    load_with_base(robot, None, &LoadOptions::default())
}

/// Loads a robot of a plan with its base at its pose in the world.
pub(crate) fn load_in_world(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    load_with_base(robot, in_world(robot), &LoadOptions::default())
}

/// [`load_in_world`], with visible shapes.
pub(crate) fn load_visible(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    let visible = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
    load_with_base(robot, in_world(robot), &visible)
}

fn in_world(robot: &RobotReference) -> Option<BasePose> {
    robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy })
}

fn load_with_base(
    robot: &RobotReference,
    pose: Option<BasePose>,
    options: &LoadOptions,
) -> Result<Loaded, RobotSourceError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        pose,
    };
    source.load_with(options)
}

/// Returns the robot that the arrays of a topic describe: the robot of the component that writes the topic.
/// If the writer has no robot, the robot of a component that reads the topic is used. Returns `None` if
/// neither the writer nor a reader has a robot.
///
/// For a component with several robots, the port `ROBOT.PORT` to which the topic is wired determines the
/// robot.
pub fn robot_of_topic(plan: &Plan, index: usize) -> Option<&RobotReference> {
    let topic = plan.topics.get(index)?;
    let writer = std::iter::once((topic.writer, true));
    let mut ends = writer.chain(topic.readers.iter().map(|reader| (*reader, false)));
    ends.find_map(|(component, writes)| {
        let component = plan.components.get(component)?;
        robot_of(component, if writes { &component.outputs } else { &component.inputs }, index)
    })
}

fn robot_of<'p>(
    component: &'p ComponentPlan,
    ports: &[PortPlan],
    topic: usize,
) -> Option<&'p RobotReference> {
    if let Some(robot) = &component.robot {
        return Some(robot);
    }
    let port = ports.iter().find(|port| port.topic == Some(topic))?;
    let (robot, _) = port.port.split_once('.')?;
    component.robots.iter().find(|known| known.name == robot)
}

/// Returns the names of the joints to which the arrays of a topic belong, followed by the names of the
/// rotors. The robot is the one that [`robot_of_topic`] returns. Returns `None` if there is no such robot, or
/// if its file has changed.
pub fn joints_of_topic(plan: &Plan, index: usize) -> Option<Vec<String>> {
    robot_of_topic(plan, index).and_then(|robot| load(robot).ok()).map(|loaded| joint_names(&loaded))
}

/// Names of a robot's joints and then of its rotors, in the order of the arrays in joint states and commands.
fn joint_names(loaded: &Loaded) -> Vec<String> {
    let rotors = loaded.profile.iter().flat_map(|profile| profile.rotors.keys());
    loaded.model.joint_names().iter().chain(rotors).cloned().collect()
}

/// Computes the poses of all links of a robot with motorium's kinematics.
///
/// ```
/// use motorium::declare::RobotReference;
/// use motorium::state::JointState;
/// use motorium_bridges::foxglove::RobotFrames;
///
/// let reference = RobotReference { name: "arm".into(), urdf: "panda".into(), ..RobotReference::default() };
/// let mut frames = RobotFrames::load(&reference, "", false)?;
/// let mut state = JointState::default();
/// state.set_count(8);
/// let transforms = frames.of_joints(&state, 0).unwrap();
/// assert_eq!(transforms.transforms[0].parent_frame_id, "world");
/// # Ok::<(), motorium_robots::RobotSourceError>(())
/// ```
#[derive(Debug, Clone)]
pub struct RobotFrames {
    loaded: Loaded,
    kinematics: Kinematics,
    q: Vec<f64>,
    /// Pose of a fixed base; `None` if a topic provides it.
    base: Option<Isometry3<f64>>,
    prefix: String,
}

impl RobotFrames {
    /// Loads a robot of a plan. `prefix` is prepended to link names, as in [`Description::frame_prefix`].
    /// `moves` is `true` if a topic provides the pose of the base.
    ///
    /// # Errors
    /// Returns an error if the robot's files can no longer be read.
    pub fn load(robot: &RobotReference, prefix: &str, moves: bool) -> Result<Self, RobotSourceError> {
        let loaded = load(robot)?;
        let pose = robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }.isometry());
        let base = (!moves && !loaded.model.base().floating).then(|| pose.unwrap_or_default());
        Ok(Self {
            kinematics: Kinematics::new(&loaded.model),
            q: loaded.model.neutral(),
            base,
            prefix: prefix.to_string(),
            loaded,
        })
    }

    pub(super) fn of_topic(plan: &Plan, index: usize) -> Option<Self> {
        let robot = robot_of_topic(plan, index)?;
        let mut topics = plan.topics.iter().enumerate();
        let moves = topics.any(|(other, topic)| {
            topic.layout.type_name == BaseState::NAME
                && robot_of_topic(plan, other).is_some_and(|mover| mover.name == robot.name)
        });
        Self::load(robot, &prefix(plan, &robot.name), moves).ok()
    }

    /// Returns the names of the joints and then of the rotors, in the order of the arrays in joint states and
    /// commands.
    pub fn joint_names(&self) -> Vec<String> {
        joint_names(&self.loaded)
    }

    /// Returns the frame name of the root link.
    pub fn root(&self) -> String {
        let root = self.loaded.model.frames().first().map_or("base", |frame| frame.name.as_str());
        format!("{}{root}", self.prefix)
    }

    /// Returns the poses of all links at the given joint positions, relative to the root link. If the base is
    /// fixed, the pose of the root link in the world is included. `None` if the state has too few joints.
    pub fn of_joints(&mut self, state: &JointState, time_ns: u64) -> Option<FrameTransforms> {
        let model = &self.loaded.model;
        let joints = model.joint_count();
        let first = model.nq() - joints;
        self.q[first..].copy_from_slice(state.position().get(..joints)?);
        self.kinematics.update(model, &self.q);
        let timestamp = Some(timestamp(time_ns));
        let frame_id = |index: usize| format!("{}{}", self.prefix, model.frames()[index].name);
        let transform = |parent: String, child: String, pose: &Isometry3<f64>| FrameTransform {
            timestamp,
            parent_frame_id: parent,
            child_frame_id: child,
            translation: Some(vector(pose.translation.vector.as_slice())),
            rotation: Some(quaternion(pose.rotation.coords.as_slice())),
        };
        let ids = || model.frames().iter().filter_map(|frame| model.frame(&frame.name).ok());
        let root = ids().next()?;
        let to_root = self.kinematics.pose(model, root).inverse();
        let mut transforms = Vec::with_capacity(model.frames().len());
        if let Some(base) = &self.base {
            transforms.push(transform(WORLD.to_string(), frame_id(0), base));
        }
        for id in ids().skip(1) {
            let pose = to_root * self.kinematics.pose(model, id);
            transforms.push(transform(frame_id(0), frame_id(id.index()), &pose));
        }
        Some(FrameTransforms { transforms })
    }

    /// Returns the pose of the root link in the world at `time_ns`.
    pub fn of_base(&self, state: &BaseState, time_ns: u64) -> FrameTransforms {
        let [x, y, z, w] = state.orientation;
        // The state describes the base frame; the root link of a model is its base.
        let pose = Isometry3::from_parts(
            Translation3::from(state.position),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        );
        FrameTransforms {
            transforms: vec![FrameTransform {
                timestamp: Some(timestamp(time_ns)),
                parent_frame_id: WORLD.to_string(),
                child_frame_id: self.root(),
                translation: Some(vector(pose.translation.vector.as_slice())),
                rotation: Some(quaternion(pose.rotation.coords.as_slice())),
            }],
        }
    }
}

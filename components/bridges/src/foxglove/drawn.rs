//! Samples as Foxglove messages that viewers can draw.

use foxglove::Encode;
use foxglove::messages::{
    ArrowPrimitive, CameraCalibration, Color, FrameTransform, FrameTransforms, JointState as NamedJoint,
    JointStates, Log, Odometry as FoxgloveOdometry, Pose, PoseInFrame, RawImage, SceneEntity, SceneUpdate,
    log::Level,
};
use motorium::declare::TopicPattern;
use motorium::plan::Plan;
use motorium::state::{
    BaseState, Contacts, Event, ImageInfo, JointState, ObjectPoses, Odometry, PoseTarget, StateBuffer, Text,
    from_bytes,
};
use motorium_worlds::World;
use serde::Deserialize as _;

use super::Schema;
use super::fields::{quaternion, timestamp, vector};
use super::pictures::{PictureError, Pictures};
use super::robots::{RobotFrames, WORLD, robot_of_topic};

/// Length of the arrow for a force of 1 N, m.
const METRES_PER_NEWTON: f64 = 0.01;

/// Converts the samples of one topic to Foxglove messages that viewers can draw.
#[derive(Debug, Clone)]
pub struct Drawing {
    name: &'static str,
    schema: Schema,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    /// Names of the joints.
    Joints(Vec<String>),
    Links(Box<RobotFrames>),
    Base(Box<RobotFrames>),
    Target,
    /// The frame of the base.
    Odometry(String),
    /// Names of the objects, in the order of their poses.
    Objects(Vec<String>),
    Contacts,
    Calibration(String),
    Pictures(Pictures),
    /// The publisher's name.
    Text(String),
    Event(String),
}

/// Error returned when a sample cannot be drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DrawnError {
    /// The sample is truncated, or longer than its type.
    #[error("the sample has {0} bytes, which is not the size of its type")]
    Size(usize),
    /// The joint state has fewer joints than the robot.
    #[error("the joint state has fewer joints than the robot")]
    Joints,
    /// The bytes do not match the announced image format.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

fn pose(position: &[f64], orientation: &[f64]) -> Option<Pose> {
    Some(Pose { position: Some(vector(position)), orientation: Some(quaternion(orientation)) })
}

impl Drawing {
    /// Returns the drawings of the topic with this plan index. The list is empty if viewers cannot draw the
    /// type or the robot cannot be loaded.
    pub fn of_topic(plan: &Plan, index: usize) -> Vec<Self> {
        let Some(topic) = plan.topics.get(index) else { return Vec::new() };
        if matches!(topic.pattern, TopicPattern::Slices { .. }) {
            return Pictures::of_topic(plan, index).map(Kind::Pictures).map(Self::new).into_iter().collect();
        }
        let writer =
            || plan.components.get(topic.writer).map_or_else(String::new, |writer| writer.name.clone());
        let frames = || RobotFrames::of_topic(plan, index);
        let base = || frames().map_or_else(|| "base".to_string(), |frames| frames.root());
        let kinds = match topic.layout.type_name.as_str() {
            JointState::NAME => frames().map_or_else(Vec::new, |frames| {
                vec![Kind::Joints(frames.joint_names()), Kind::Links(Box::new(frames))]
            }),
            BaseState::NAME => frames().map(|frames| Kind::Base(Box::new(frames))).into_iter().collect(),
            PoseTarget::NAME => vec![Kind::Target],
            Odometry::NAME => vec![Kind::Odometry(base())],
            ObjectPoses::NAME => vec![Kind::Objects(object_names(plan, topic.writer))],
            Contacts::NAME => vec![Kind::Contacts],
            ImageInfo::NAME => vec![Kind::Calibration(writer())],
            Text::NAME => vec![Kind::Text(writer())],
            Event::NAME => vec![Kind::Event(writer())],
            _ => Vec::new(),
        };
        // One topic provides the poses of all links of a robot; two differing topics would make the links
        // jump.
        let kinds = kinds.into_iter().filter(|kind| {
            !matches!(kind, Kind::Links(_)) || first_state(plan, index).is_none_or(|first| first == index)
        });
        kinds.map(Self::new).collect()
    }

    fn new(kind: Kind) -> Self {
        let (name, schema) = match &kind {
            Kind::Joints(_) => ("joints", Schema::of::<JointStates>()),
            Kind::Links(_) | Kind::Base(_) | Kind::Objects(_) => {
                ("transforms", Schema::of::<FrameTransforms>())
            }
            Kind::Target => ("pose", Schema::of::<PoseInFrame>()),
            Kind::Odometry(_) => ("odometry", Schema::of::<FoxgloveOdometry>()),
            Kind::Contacts => ("scene", Schema::of::<SceneUpdate>()),
            Kind::Calibration(_) => ("calibration", Schema::of::<CameraCalibration>()),
            Kind::Pictures(_) => ("image", Schema::of::<RawImage>()),
            Kind::Text(_) | Kind::Event(_) => ("log", Schema::of::<Log>()),
        };
        Self { name, schema, kind }
    }

    /// Returns the name of the drawing, the last part of its channel's name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the schema of the messages.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Returns `true` if every sample must be encoded. This applies to log lines, and to images, which have
    /// no exact channel.
    pub fn needs_every_sample(&self) -> bool {
        matches!(self.kind, Kind::Pictures(_) | Kind::Text(_) | Kind::Event(_))
    }

    /// Index of the topic with the image format.
    pub(super) fn form_topic(&self) -> Option<usize> {
        match &self.kind {
            Kind::Pictures(pictures) => Some(pictures.form_topic()),
            _ => None,
        }
    }

    /// Records the image format.
    pub(super) fn note(&mut self, bytes: &[u8]) {
        if let Kind::Pictures(pictures) = &mut self.kind {
            pictures.note(bytes);
        }
    }

    /// Encodes a sample as a message with the time `time_ns` and appends it to `out`.
    ///
    /// # Errors
    /// Returns an error if the sample does not fit its type or its robot; `out` is then unchanged.
    pub fn encode(&mut self, bytes: &[u8], time_ns: u64, out: &mut Vec<u8>) -> Result<(), DrawnError> {
        fn read<T: StateBuffer>(bytes: &[u8]) -> Result<T, DrawnError> {
            from_bytes(bytes).ok_or(DrawnError::Size(bytes.len()))
        }
        let time = Some(timestamp(time_ns));
        match &mut self.kind {
            Kind::Joints(names) => {
                let state = read::<JointState>(bytes)?;
                let joint = |(index, name): (usize, &String)| NamedJoint {
                    name: name.clone(),
                    position: state.position().get(index).copied(),
                    velocity: state.velocity().get(index).copied(),
                    acceleration: None,
                    effort: state.effort().get(index).copied(),
                };
                let joints = names.iter().enumerate().take(state.count()).map(joint).collect();
                append(&JointStates { timestamp: time, joints }, out);
            }
            Kind::Links(frames) => {
                let state = read::<JointState>(bytes)?;
                append(&frames.of_joints(&state, time_ns).ok_or(DrawnError::Joints)?, out);
            }
            Kind::Base(frames) => append(&frames.of_base(&read::<BaseState>(bytes)?, time_ns), out),
            Kind::Target => {
                let target = read::<PoseTarget>(bytes)?;
                let pose = pose(&target.position, &target.orientation);
                append(&PoseInFrame { timestamp: time, frame_id: WORLD.to_string(), pose }, out);
            }
            Kind::Odometry(base) => append(&odometry(&read::<Odometry>(bytes)?, base, time_ns), out),
            Kind::Objects(names) => append(&objects(&read::<ObjectPoses>(bytes)?, names, time_ns), out),
            Kind::Contacts => append(&contacts(&read::<Contacts>(bytes)?, time_ns), out),
            Kind::Calibration(camera) => {
                let info = read::<ImageInfo>(bytes)?;
                let ([fx, fy], [cx, cy]) = (info.focal_length, info.principal_point);
                let calibration = CameraCalibration {
                    timestamp: time,
                    frame_id: camera.clone(),
                    width: info.width,
                    height: info.height,
                    k: vec![fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
                    r: vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
                    p: vec![fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
                    ..CameraCalibration::default()
                };
                append(&calibration, out);
            }
            Kind::Pictures(pictures) => append(&pictures.image(bytes, time_ns)?, out),
            Kind::Text(name) => {
                let text = read::<Text>(bytes)?;
                append(&log(time_ns, Level::Info, name, text.as_str()), out);
            }
            Kind::Event(name) => {
                let event = read::<Event>(bytes)?;
                let level = match event.severity {
                    Event::INFORMATION => Level::Info,
                    Event::WARNING => Level::Warning,
                    _ => Level::Error,
                };
                append(&log(time_ns, level, name, event.as_str()), out);
            }
        }
        Ok(())
    }
}

/// Converts a log line to Foxglove's format.
///
/// ```
/// use foxglove::schemas::log::Level;
/// use motorium_bridges::foxglove::log;
///
/// let line = log(1_500_000_000, Level::Warning, "controller", "goal out of reach");
/// assert_eq!((line.timestamp.unwrap().sec(), line.name.as_str()), (1, "controller"));
/// ```
pub fn log(time_ns: u64, level: Level, name: &str, message: &str) -> Log {
    Log {
        timestamp: Some(timestamp(time_ns)),
        level: level as i32,
        message: message.to_string(),
        name: name.to_string(),
        ..Log::default()
    }
}

fn append(message: &impl Encode, out: &mut Vec<u8>) {
    out.reserve(message.encoded_len().unwrap_or_default());
    // Encoding fails only for a buffer of fixed size.
    let _ = message.encode(out);
}

/// Returns the topic of joint states from which the links of the robot are drawn: the first one in the plan.
/// In a simulation, it is the true state.
fn first_state(plan: &Plan, index: usize) -> Option<usize> {
    let robot = &robot_of_topic(plan, index)?.name;
    let mut states = plan.topics.iter().enumerate().filter(|(other, topic)| {
        topic.layout.type_name == JointState::NAME
            && robot_of_topic(plan, *other).is_some_and(|known| known.name == *robot)
    });
    states.next().map(|(first, _)| first)
}

/// Names of the objects of the world of the component that writes their poses.
fn object_names(plan: &Plan, writer: usize) -> Vec<String> {
    // Other keys belong to the simulating component.
    let world = plan.components.get(writer).and_then(|component| {
        let settings = &component.config["world"];
        let mut keys = serde_json::Map::new();
        for key in ["objects", "file"] {
            if let Some(value) = settings.get(key).filter(|value| !value.is_null()) {
                keys.insert(key.to_string(), value.clone());
            }
        }
        let mut world = World::deserialize(serde_json::Value::Object(keys)).ok()?;
        world.locate(&component.folder).ok()?;
        Some(world)
    });
    world.unwrap_or_default().objects.into_iter().map(|object| object.name).collect()
}

fn odometry(odometry: &Odometry, base: &str, time_ns: u64) -> FoxgloveOdometry {
    let [x, y] = odometry.position;
    let half = odometry.yaw / 2.0;
    // x, y and yaw among x, y, z, roll, pitch and yaw
    let mut covariance = vec![0.0; 36];
    for (row, of_row) in [0, 1, 5].into_iter().enumerate() {
        for (column, of_column) in [0, 1, 5].into_iter().enumerate() {
            covariance[6 * of_row + of_column] = odometry.covariance[3 * row + column];
        }
    }
    FoxgloveOdometry {
        timestamp: Some(timestamp(time_ns)),
        frame_id: WORLD.to_string(),
        body_frame_id: base.to_string(),
        pose: pose(&[x, y, 0.0], &[0.0, 0.0, half.sin(), half.cos()]),
        linear_velocity: Some(vector(&[odometry.velocity[0], odometry.velocity[1], 0.0])),
        angular_velocity: Some(vector(&[0.0, 0.0, odometry.yaw_rate])),
        pose_covariance: covariance,
        ..FoxgloveOdometry::default()
    }
}

fn objects(poses: &ObjectPoses, names: &[String], time_ns: u64) -> FrameTransforms {
    let transform = |index: usize| {
        let object = poses.object()[index] as usize;
        let name = names.get(object).filter(|name| !name.is_empty());
        FrameTransform {
            timestamp: Some(timestamp(time_ns)),
            parent_frame_id: WORLD.to_string(),
            child_frame_id: name.cloned().unwrap_or_else(|| format!("object {object}")),
            translation: Some(vector(&[
                poses.position_x()[index],
                poses.position_y()[index],
                poses.position_z()[index],
            ])),
            rotation: Some(quaternion(&[
                poses.orientation_x()[index],
                poses.orientation_y()[index],
                poses.orientation_z()[index],
                poses.orientation_w()[index],
            ])),
        }
    };
    FrameTransforms { transforms: (0..poses.count()).map(transform).collect() }
}

/// Draws one arrow per contact, along its force.
fn contacts(contacts: &Contacts, time_ns: u64) -> SceneUpdate {
    let arrow = |index: usize| {
        let force = nalgebra::Vector3::new(
            contacts.force_x()[index],
            contacts.force_y()[index],
            contacts.force_z()[index],
        );
        let along = nalgebra::UnitQuaternion::rotation_between(&nalgebra::Vector3::x(), &force);
        // A force along -x has no unique rotation; a half turn about z is one of them.
        let opposite = || nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, core::f64::consts::PI);
        let along = along.unwrap_or_else(opposite);
        let position =
            [contacts.position_x()[index], contacts.position_y()[index], contacts.position_z()[index]];
        let length = force.norm() * METRES_PER_NEWTON;
        ArrowPrimitive {
            pose: pose(&position, along.coords.as_slice()),
            shaft_length: 0.8 * length,
            shaft_diameter: 0.005,
            head_length: 0.2 * length,
            head_diameter: 0.01,
            color: Some(Color { r: 0.9, g: 0.3, b: 0.1, a: 1.0 }),
        }
    };
    let entity = SceneEntity {
        timestamp: Some(timestamp(time_ns)),
        frame_id: WORLD.to_string(),
        id: "contacts".to_string(),
        arrows: (0..contacts.count()).map(arrow).collect(),
        ..SceneEntity::default()
    };
    SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
}

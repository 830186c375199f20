//! Conversion of graph topics to the format read by Foxglove, Lichtblick, rerun and PlotJuggler. This module
//! does not contain a server.
//!
//! Each topic becomes one or two channels of messages in the protobuf encoding:
//!
//! - Its **exact** channel, named like the topic, contains every field and the stamp of a sample in a schema
//!   derived from the layout of its type, `motorium.v1.JointState` for `motorium.JointState`. It is lossless:
//!   [`Derived::decode`] returns the sample bit for bit.
//! - A **drawn** channel, named after the topic and its drawing, contains one of Foxglove's own messages, for
//!   types that viewers can draw. `panda/joint_state/transforms` contains the poses of all links from
//!   motorium's kinematics.
//!
//! | type | drawn channel | schema |
//! |---|---|---|
//! | `motorium.JointState` | `joints`, `transforms` | `foxglove.JointStates`, `foxglove.FrameTransforms` |
//! | `motorium.BaseState` | `transforms` | `foxglove.FrameTransforms` |
//! | `motorium.PoseTarget` | `pose` | `foxglove.PoseInFrame` |
//! | `motorium.Odometry` | `odometry` | `foxglove.Odometry` |
//! | `motorium.ObjectPoses` | `transforms` | `foxglove.FrameTransforms` |
//! | `motorium.Contacts` | `scene` | `foxglove.SceneUpdate` |
//! | `motorium.ImageInfo` | `calibration` | `foxglove.CameraCalibration` |
//! | `motorium.Text`, `motorium.Event` | `log` | `foxglove.Log` |
//! | slices of `u8` of a component that publishes one `motorium.ImageInfo` | `image` | `foxglove.RawImage` |
//!
//! Every topic except images has an exact channel. The descriptions of robots ([`descriptions`]) and the
//! ground and the objects of the world ([`world_scene`]) never change.
//!
//! [`channels`] returns the channels of a plan:
//!
//! ```
//! use motorium::state::{JointState, Stamp, StateBuffer, encode};
//! use motorium_bridges::foxglove::Derived;
//!
//! let derived = Derived::new(&JointState::layout())?;
//! assert_eq!(derived.schema().name, "motorium.v1.JointState");
//! let bytes = encode(&JointState::layout(), "position=[0.5, -1.0]").unwrap();
//! let stamp = Stamp { sequence: 7, ..Stamp::default() };
//! let mut message = Vec::new();
//! derived.encode(&stamp, &bytes, &mut message);
//! assert_eq!(derived.decode(&message)?, (stamp, bytes));
//! # Ok::<(), motorium_bridges::foxglove::DerivedError>(())
//! ```

mod channels;
mod derived;
mod drawn;
mod fields;
mod pictures;
mod robots;
mod world;

pub use channels::{Channel, Content, channels};
pub use derived::{Derived, DerivedError};
pub use drawn::{Drawing, DrawnError, log};
pub use pictures::PictureError;
pub use robots::{Description, RobotFrames, descriptions, joints_of_topic, robot_of_topic};
pub(crate) use robots::{load as load_robot, load_in_world, load_visible, robots};
pub(crate) use world::world_of;
pub use world::{WORLD_SCENE, world_scene};

/// Schema of the messages of a channel.
///
/// ```
/// use motorium::state::{StateBuffer, Wrench};
/// use motorium_bridges::foxglove::Derived;
///
/// let derived = Derived::new(&Wrench::layout())?;
/// let schema = derived.schema();
/// assert_eq!((schema.name.as_str(), schema.encoding), ("motorium.v1.Wrench", "protobuf"));
/// assert!(!schema.data.is_empty());
/// # Ok::<(), motorium_bridges::foxglove::DerivedError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Schema {
    /// Full name of the schema, such as `foxglove.JointStates`.
    pub name: String,
    /// Encoding of `data` and of the messages: always `protobuf`.
    pub encoding: &'static str,
    /// A `google.protobuf.FileDescriptorSet` with the schema and all types that it uses.
    pub data: Vec<u8>,
}

impl Schema {
    /// Returns the schema of one of Foxglove's messages.
    pub fn of<M: foxglove::Encode>() -> Self {
        let schema = M::get_schema().expect("every message of Foxglove has a schema");
        Self { name: schema.name, encoding: "protobuf", data: schema.data.into_owned() }
    }
}

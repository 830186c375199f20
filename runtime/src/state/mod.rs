//! State buffers: the plain-old-data types that components share, their layouts and their stamps.
//!
//! A state buffer is a `#[repr(C)]` type without pointers or meaningful padding. Every bit pattern is a valid
//! value, so any process can read a buffer in place in shared memory. Use
//! [`state_buffer!`](crate::state_buffer) to define one.
//!
//! Two processes agree on a type only if their [`TypeLayout`]s agree: names, offsets and types of all fields.

mod buffer;
mod bus;
mod content;
mod control;
mod counted;
mod decode;
mod digest;
mod emergency;
mod encode;
mod field;
mod finite;
mod goal;
mod in_use;
mod joint;
mod layout;
mod learning;
mod legs;
mod motion;
mod numbers;
mod people;
mod ranging;
mod read;
mod sensing;
mod stamp;

pub use buffer::StateBuffer;
pub use bus::{BusHealth, CanFrame};
pub use content::{ContentCheck, ContentDefect, UnknownKind};
pub use control::{ControlDiagnostics, MAX_ACTIVE, MAX_TASKS};
pub use decode::{DecodeError, Decoded, Decoder, FieldValue, Number};
pub use digest::Digest;
pub use emergency::EmergencyStop;
pub use encode::{EncodeError, encode};
pub use field::{Checked, Defect, Field};
pub use finite::Numbers;
pub use goal::{GoalState, GoalStatus, MAX_GOAL_TEXT, MotionGoal};
pub(crate) use in_use::InUse;
pub use joint::{JointCommand, JointState, MAX_JOINTS};
pub use layout::{FieldLayout, TypeLayout};
pub use learning::{
    Action, ActionChunk, MAX_ACTION, MAX_CHUNK, MAX_DRAWN, MAX_OBSERVATION, MAX_WEIGHTS, Observation,
    Randomisation, Reward, Weights,
};
pub use legs::{BaseEstimate, ContactSchedule, FootContacts, MAX_FEET};
pub use motion::{BaseState, ImuSample, Odometry, Phase, PoseTarget, TwistTarget, Wrench};
pub use numbers::{number, numbered};
pub use people::{Controls, Event, MAX_AXES, MAX_EVENT_TEXT, MAX_TEXT, Text};
pub use ranging::{Altitude, GeoFix, HeightScan, MAX_HEIGHTS, MAX_RANGES, MagneticField, Ranges};
pub use read::from_bytes;
pub use sensing::{
    CloudPoint, ContactImpulses, Contacts, ImageInfo, MAX_CONTACTS, MAX_IMPULSES, MAX_OBJECTS, ObjectPoses,
};
pub use stamp::{FUTURE_TOLERANCE_NS, Stamp};

#[doc(hidden)]
pub use iceoryx2::prelude::ZeroCopySend as __ZeroCopySend;

/// Returns the layouts of all state buffers that the runtime defines, in the order of [`numbered`].
///
/// ```
/// let names: Vec<String> = motorium::state::built_in().into_iter().map(|layout| layout.type_name).collect();
/// assert!(names.contains(&"motorium.JointState".to_string()));
/// ```
pub fn built_in() -> Vec<TypeLayout> {
    numbered().into_iter().map(|(_, layout)| layout).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_state_of_the_runtime_is_in_the_list() {
        let sources = [
            include_str!("bus.rs"),
            include_str!("control.rs"),
            include_str!("emergency.rs"),
            include_str!("goal.rs"),
            include_str!("joint.rs"),
            include_str!("learning.rs"),
            include_str!("legs.rs"),
            include_str!("motion.rs"),
            include_str!("people.rs"),
            include_str!("ranging.rs"),
            include_str!("sensing.rs"),
        ]
        .concat();
        let mut defined: Vec<&str> =
            sources.split(" as \"motorium.").skip(1).filter_map(|rest| rest.split('"').next()).collect();
        let layouts = built_in();
        let mut listed: Vec<&str> =
            layouts.iter().map(|layout| layout.type_name.trim_start_matches("motorium.")).collect();
        defined.sort_unstable();
        listed.sort_unstable();
        assert_eq!(listed, defined);
    }
}

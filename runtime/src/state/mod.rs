//! State buffers: the plain-old-data types that components share, their layouts and their stamps.
//!
//! A state buffer is a `#[repr(C)]` type without pointers and without padding of meaning, valid for every bit
//! pattern, so that it can live in shared memory and be read in place by another process. Use
//! [`state_buffer!`](crate::state_buffer) to define one.
//!
//! Two processes agree on a type only if their [`TypeLayout`]s agree: names, offsets and types of all fields.

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

pub use bus::{BusHealth, CanFrame};
pub use content::{ContentCheck, ContentDefect, UnknownKind};
pub use control::{ControlDiagnostics, MAX_ACTIVE, MAX_TASKS};
pub use decode::{DecodeError, Decoded, Decoder, FieldValue, Number};
pub use digest::Digest;
pub use emergency::EmergencyStop;
pub use encode::{EncodeError, encode};
pub use field::{Defect, Field};
pub use finite::{Checked, Numbers};
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

/// A type that can be published on a topic.
///
/// Implemented by [`state_buffer!`](crate::state_buffer), which checks the requirements of the trait: a fixed
/// name, `#[repr(C)]`, and fields that are all [`Field`]s.
pub trait StateBuffer: Field + __ZeroCopySend {
    /// Name of the type for other languages and processes, such as `motorium.JointState`.
    const NAME: &'static str;

    /// Names, offsets and types of the fields.
    fn layout() -> TypeLayout;
}

/// The layouts of all state buffers that the runtime defines, in the order of their numbers.
///
/// ```
/// let names: Vec<String> = motorium::state::built_in().into_iter().map(|layout| layout.type_name).collect();
/// assert!(names.contains(&"motorium.JointState".to_string()));
/// ```
pub fn built_in() -> Vec<TypeLayout> {
    numbered().into_iter().map(|(_, layout)| layout).collect()
}

/// Defines a state buffer.
///
/// The fields may be numbers, arrays of numbers, or other state buffers. The type gets `Clone`, `Copy`,
/// `Debug`, `PartialEq`, `Default` (all zero) and [`StateBuffer`].
///
/// ```
/// motorium::state_buffer! {
///     /// Contact of one foot with the ground.
///     pub struct FootContact as "example.FootContact" {
///         /// Normal force, N.
///         pub normal_force: f64,
///         /// Centre of pressure in the foot frame, m.
///         pub centre_of_pressure: [f64; 2],
///     }
/// }
/// use motorium::state::StateBuffer;
/// assert_eq!(FootContact::layout().fields[1].offset, 8);
/// ```
#[macro_export]
macro_rules! state_buffer {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident as $type_name:literal {
            $( $(#[$field_meta:meta])* $field_vis:vis $field:ident : $field_type:ty ),* $(,)?
        }
    ) => {
        $crate::state_buffer! {
            @layout $(#[$meta])*
            $vis struct $name as $type_name { $( $(#[$field_meta])* $field_vis $field : $field_type ),* }
        }

        #[allow(unsafe_code)]
        // SAFETY: `repr(C)`, and every field is itself a `Field`.
        unsafe impl $crate::state::Field for $name {
            const ZERO: Self = Self { $( $field: <$field_type as $crate::state::Field>::ZERO ),* };
            const NUMBERS: $crate::state::Numbers =
                $crate::state::Numbers::concat(&[$( <$field_type as $crate::state::Field>::NUMBERS ),*]);

            fn describe(prefix: &str, offset: usize, out: &mut Vec<$crate::state::FieldLayout>) {
                $crate::state_buffer!(@describe $name, prefix, offset, out, $( $field : $field_type ),*);
            }

            fn check(&self) -> Result<(), $crate::state::Defect> {
                $( $crate::state::Field::check(&self.$field).map_err(|defect| defect.inside(stringify!($field)))?; )*
                Ok(())
            }

            #[inline]
            fn check_rest(&self, checked: &$crate::state::Checked) -> Result<(), $crate::state::Defect> {
                $( $crate::state::Field::check_rest(&self.$field, checked)
                    .map_err(|defect| defect.inside(stringify!($field)))?; )*
                Ok(())
            }

            fn digest(&self, digest: &mut $crate::state::Digest) {
                $( $crate::state::Field::digest(&self.$field, digest); )*
            }
        }
    };
    (
        @layout $(#[$meta:meta])*
        $vis:vis struct $name:ident as $type_name:literal {
            $( $(#[$field_meta:meta])* $field_vis:vis $field:ident : $field_type:ty ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[repr(C)]
        $vis struct $name {
            $( $(#[$field_meta])* $field_vis $field : $field_type ),*
        }

        #[allow(unsafe_code)]
        // SAFETY: `repr(C)`, `'static`, no pointers and no `Drop`, since every field is a `Field`.
        unsafe impl $crate::state::__ZeroCopySend for $name {
            unsafe fn type_name() -> &'static str {
                $type_name
            }
        }

        impl $crate::state::StateBuffer for $name {
            const NAME: &'static str = $type_name;

            fn layout() -> $crate::state::TypeLayout {
                $crate::state::TypeLayout::of::<$name>()
            }
        }

        impl Default for $name {
            fn default() -> Self {
                <Self as $crate::state::Field>::ZERO
            }
        }
    };
    (@describe $name:ident, $prefix:ident, $offset:ident, $out:ident, $( $field:ident : $field_type:ty ),*) => {
        $(
            let path = if $prefix.is_empty() {
                stringify!($field).to_string()
            } else {
                format!("{}.{}", $prefix, stringify!($field))
            };
            <$field_type as $crate::state::Field>::describe(
                &path,
                $offset + core::mem::offset_of!($name, $field),
                $out,
            );
        )*
    };
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

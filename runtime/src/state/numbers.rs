//! Permanent numbers of the runtime's messages. Recorded files and programs in other languages identify a
//! type by this number.

use super::{
    Action, ActionChunk, Altitude, BaseEstimate, BaseState, BusHealth, CanFrame, CloudPoint, ContactImpulses,
    ContactSchedule, Contacts, ControlDiagnostics, Controls, EmergencyStop, Event, FootContacts, GeoFix,
    GoalStatus, HeightScan, ImageInfo, ImuSample, JointCommand, JointState, MagneticField, MotionGoal,
    ObjectPoses, Observation, Odometry, Phase, PoseTarget, Randomisation, Ranges, Reward, StateBuffer, Text,
    TwistTarget, TypeLayout, Weights, Wrench,
};

macro_rules! numbers {
    ($($number:literal $type:ident),* $(,)?) => {
        /// Returns the numbers and layouts of all messages that the runtime defines, ordered by number.
        ///
        /// ```
        /// let (number, layout) = motorium::state::numbered().remove(0);
        /// assert_eq!((number, layout.type_name.as_str()), (1, "motorium.JointState"));
        /// ```
        pub fn numbered() -> Vec<(u16, TypeLayout)> {
            vec![$( ($number, $type::layout()) ),*]
        }

        /// Returns the permanent number of the runtime's message with this type name; `None` for all other
        /// names.
        ///
        /// ```
        /// assert_eq!(motorium::state::number("motorium.Wrench"), Some(5));
        /// assert_eq!(motorium::state::number("example.FootContact"), None);
        /// ```
        pub fn number(type_name: &str) -> Option<u16> {
            match type_name {
                $( $type::NAME => Some($number), )*
                _ => None,
            }
        }

        #[cfg(test)]
        #[allow(unsafe_code)] // values of any bytes, to be refused
        fn check_all(mut check: impl FnMut(&TypeLayout, &dyn Fn(&[u8]) -> bool)) {
            $(
                check(&$type::layout(), &|bytes: &[u8]| {
                    use super::Field as _;
                    let mut value = $type::default();
                    assert_eq!(bytes.len(), size_of::<$type>());
                    // SAFETY: a state buffer is valid for every bit pattern, and has the length of the bytes.
                    unsafe {
                        core::ptr::from_mut(&mut value).cast::<u8>().copy_from(bytes.as_ptr(), bytes.len());
                    }
                    value.check().is_ok()
                });
            )*
        }
    };
}

numbers! {
    1 JointState,
    2 JointCommand,
    3 BaseState,
    4 PoseTarget,
    5 Wrench,
    6 ImuSample,
    7 Phase,
    8 EmergencyStop,
    9 TwistTarget,
    10 Contacts,
    11 ObjectPoses,
    12 ImageInfo,
    13 CloudPoint,
    14 CanFrame,
    15 BusHealth,
    16 Weights,
    17 Observation,
    18 Action,
    19 Reward,
    20 Controls,
    21 Text,
    22 Event,
    23 Odometry,
    24 FootContacts,
    25 BaseEstimate,
    26 Ranges,
    27 GeoFix,
    28 Altitude,
    29 MagneticField,
    30 HeightScan,
    31 Randomisation,
    32 ControlDiagnostics,
    33 ContactImpulses,
    34 ContactSchedule,
    35 ActionChunk,
    36 MotionGoal,
    37 GoalStatus,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::ContentCheck;

    #[test]
    fn numbers_and_names_are_unique() {
        let messages = numbered();
        for (index, (number, layout)) in messages.iter().enumerate() {
            assert_eq!(usize::from(*number), index + 1, "{}: numbers are given in turn", layout.type_name);
            assert!(messages[..index].iter().all(|(_, other)| other.type_name != layout.type_name));
            assert_eq!(super::number(&layout.type_name), Some(*number));
        }
    }

    #[test]
    fn messages_have_no_padding() {
        for (_, layout) in numbered() {
            let mut end = 0;
            for field in &layout.fields {
                assert_eq!(field.offset, end, "{}.{}", layout.type_name, field.name);
                end += field.size;
            }
            assert_eq!(end, layout.size, "{}", layout.type_name);
        }
    }

    #[test]
    fn non_finite_numbers_are_rejected_in_every_field() {
        check_all(|layout, by_type| {
            let by_layout = ContentCheck::new(layout).unwrap();
            let mut clean = vec![0; layout.size];
            if let Some(count) = layout.fields.iter().find(|field| field.name == "count") {
                clean[count.offset] = 1;
            }
            assert!(by_type(&clean) && by_layout.check(&clean).is_ok(), "{layout}");
            for field in &layout.fields {
                let nan: &[u8] = match field.kind.trim_start_matches('[').split(';').next() {
                    Some("f64") => &f64::NAN.to_ne_bytes(),
                    Some("f32") => &f32::NAN.to_ne_bytes(),
                    _ => continue,
                };
                let mut bytes = clean.clone();
                bytes[field.offset..field.offset + nan.len()].copy_from_slice(nan);
                assert!(!by_type(&bytes), "{}.{}", layout.type_name, field.name);
                assert!(by_layout.check(&bytes).is_err(), "{}.{}", layout.type_name, field.name);
            }
        });
    }
}

//! Messages in joint space: the measured state of a robot's joints, and commands for them.

#![allow(unsafe_code)] // two `Field` implementations that look only at the used part of their arrays

use super::field::all_finite;
use super::{Defect, Digest, Field, FieldLayout};

/// Maximum number of joints of a joint buffer.
pub const MAX_JOINTS: usize = 64;

crate::state_buffer! {
    @layout
    /// Positions, velocities and efforts of a robot's joints, in the order of its model's `q`.
    ///
    /// Only the first `count` entries of each array are in use, and the accessors return only these entries.
    pub struct JointState as "motorium.JointState" {
        count: u32,
        reserved: u32,
        position: [f64; MAX_JOINTS],
        velocity: [f64; MAX_JOINTS],
        effort: [f64; MAX_JOINTS],
    }
}

crate::state_buffer! {
    @layout
    /// Setpoints for a robot's joints, in the order of its model's `q`.
    ///
    /// The actuator applies `tau = kp (position - q) + kd (velocity - v) + effort`, clamped to the effort
    /// limit. Position control is `kp, kd > 0`; velocity control is `kp = 0`; effort control is
    /// `kp = kd = 0`.
    pub struct JointCommand as "motorium.JointCommand" {
        count: u32,
        reserved: u32,
        position: [f64; MAX_JOINTS],
        velocity: [f64; MAX_JOINTS],
        effort: [f64; MAX_JOINTS],
        kp: [f64; MAX_JOINTS],
        kd: [f64; MAX_JOINTS],
    }
}

macro_rules! joint_buffer {
    ($name:ident { $( $(#[$doc:meta])* $field:ident, $field_mut:ident );* $(;)? }) => {
        impl $name {
            /// Returns the number of joints, at most [`MAX_JOINTS`].
            pub fn count(&self) -> usize {
                (self.count as usize).min(MAX_JOINTS)
            }

            /// Sets the number of joints. Added entries keep the content that the buffer had there before.
            ///
            /// # Panics
            /// If `count` exceeds [`MAX_JOINTS`]; check a model's size during configuration.
            pub fn set_count(&mut self, count: usize) {
                assert!(count <= MAX_JOINTS, "{count} joints, but a buffer holds {MAX_JOINTS}");
                self.count = count as u32;
            }

            $(
                $(#[$doc])*
                pub fn $field(&self) -> &[f64] {
                    &self.$field[..self.count()]
                }

                $(#[$doc])*
                pub fn $field_mut(&mut self) -> &mut [f64] {
                    let count = self.count();
                    &mut self.$field[..count]
                }
            )*
        }

        // SAFETY: `repr(C)`, and every field is itself a `Field`.
        unsafe impl Field for $name {
            const ZERO: Self = Self { count: 0, reserved: 0, $( $field: [0.0; MAX_JOINTS] ),* };

            fn describe(prefix: &str, offset: usize, out: &mut Vec<FieldLayout>) {
                let first = out.len();
                crate::state_buffer!(@describe $name, prefix, offset, out,
                    count: u32, reserved: u32, $( $field: [f64; MAX_JOINTS] ),*);
                let counter = if prefix.is_empty() { "count".to_string() } else { format!("{prefix}.count") };
                let joints = out[first..].iter_mut().filter(|field| field.kind.starts_with('['));
                joints.for_each(|field| field.count = Some(counter.clone()));
            }

            fn check(&self) -> Result<(), Defect> {
                let count = self.count as usize;
                if count > MAX_JOINTS {
                    return Err(Defect::Count { field: "count", found: count, capacity: MAX_JOINTS });
                }
                $( all_finite(stringify!($field), &self.$field[..count])?; )*
                Ok(())
            }

            fn digest(&self, digest: &mut Digest) {
                digest.write_u64(u64::from(self.count));
                $( f64::digest_all(self.$field(), digest); )*
            }
        }
    };
}

joint_buffer!(JointState {
    /// Joint positions `q`, rad; m for a prismatic joint.
    position, position_mut;
    /// Joint velocities `v`, rad/s or m/s.
    velocity, velocity_mut;
    /// Joint efforts `tau`, N m or N.
    effort, effort_mut;
});

joint_buffer!(JointCommand {
    /// Position setpoints, rad or m.
    position, position_mut;
    /// Velocity setpoints, rad/s or m/s.
    velocity, velocity_mut;
    /// Feed-forward efforts, N m or N.
    effort, effort_mut;
    /// Proportional gains, N m/rad or N/m.
    kp, kp_mut;
    /// Derivative gains, N m s/rad or N s/m.
    kd, kd_mut;
});

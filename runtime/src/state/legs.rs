//! Messages of legged robots: measured and planned contacts of the feet, and the estimated state of the base.

#![allow(unsafe_code)] // `Field` implementations that look only at the used part of their arrays

use super::counted::counted_buffer;

/// Maximum number of feet in [`FootContacts`] and [`ContactSchedule`].
pub const MAX_FEET: usize = 16;

counted_buffer! {
    /// Readings of the contact sensors in a robot's feet, in the order of the feet in the robot's profile.
    ///
    /// ```
    /// use motorium::state::FootContacts;
    ///
    /// let mut feet = FootContacts::default();
    /// feet.set_count(4);
    /// feet.contact_mut().copy_from_slice(&[1, 0, 0, 1]);
    /// assert_eq!(feet.contact().iter().filter(|contact| **contact == 1).count(), 2);
    /// ```
    pub struct FootContacts as "motorium.FootContacts", at most MAX_FEET {
        counted {
            /// 1 if the foot is in contact, else 0.
            contact, contact_mut: u32;
            /// Magnitude of the force on the foot, N.
            force, force_mut: f64;
        }
    }
}

counted_buffer! {
    /// Planned contacts of a robot's feet, in the order of the feet in the robot's profile.
    ///
    /// ```
    /// use motorium::state::ContactSchedule;
    ///
    /// let mut schedule = ContactSchedule::default();
    /// schedule.set_count(2);
    /// schedule.load_mut().copy_from_slice(&[1.0, 0.0]);
    /// assert_eq!(schedule.load(), [1.0, 0.0]); // it stands on the first foot
    /// ```
    pub struct ContactSchedule as "motorium.ContactSchedule", at most MAX_FEET {
        plain {
            /// Ground normal under the feet, in world axes. Need not have unit length; zero stands for
            /// straight up.
            ground_normal: [f64; 3];
        }
        counted {
            /// Fraction of its full share of the load that the foot carries: 0 if lifted, 1 if fully loaded.
            load, load_mut: f64;
        }
    }
}

crate::state_buffer! {
    /// The estimated pose and velocity of a robot's base and the biases of its inertial measurement unit,
    /// with their uncertainty.
    ///
    /// ```
    /// use motorium::state::BaseEstimate;
    ///
    /// let mut estimate = BaseEstimate::default();
    /// estimate.covariance[8 * 9 + 8] = 1e-4;
    /// let deviation = estimate.covariance[80].sqrt(); // of the height, m
    /// assert_eq!(deviation, 0.01);
    /// ```
    pub struct BaseEstimate as "motorium.BaseEstimate" {
        /// Position of the base frame's origin in the world, m.
        pub position: [f64; 3],
        /// Orientation of the base in the world as a unit quaternion, x y z w.
        pub orientation: [f64; 4],
        /// Velocity of the base frame's origin, in the axes of the base, m/s.
        pub linear_velocity: [f64; 3],
        /// Angular velocity, in the axes of the base, rad/s.
        pub angular_velocity: [f64; 3],
        /// Bias of the gyroscope, in the axes of the sensor, rad/s.
        pub gyroscope_bias: [f64; 3],
        /// Bias of the accelerometer, in the axes of the sensor, m/s^2.
        pub accelerometer_bias: [f64; 3],
        /// Covariance of the errors of orientation (as a rotation vector), velocity and position, in this
        /// order and in world axes. A 9 x 9 matrix, row by row; the units of the entries are products of rad,
        /// m/s and m.
        pub covariance: [f64; 81],
        /// Standard deviations of the biases, the gyroscope's first, rad/s and m/s^2.
        pub bias_deviation: [f64; 6],
        /// Bit mask of the feet that the estimate uses; the first foot is bit 0.
        pub contacts: u64,
    }
}

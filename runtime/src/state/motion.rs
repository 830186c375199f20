//! Cartesian state: poses, twists, wrenches, inertial measurements, phases.

crate::state_buffer! {
    /// The target pose and velocity of a frame, expressed in the world frame.
    pub struct PoseTarget as "motorium.PoseTarget" {
        /// Position of the frame's origin, m.
        pub position: [f64; 3],
        /// Orientation as a unit quaternion, x y z w.
        pub orientation: [f64; 4],
        /// Linear velocity of the frame's origin, m/s.
        pub linear_velocity: [f64; 3],
        /// Angular velocity, rad/s.
        pub angular_velocity: [f64; 3],
        /// Number of the goal to which this target moves. The number changes when the motion to a new goal
        /// starts.
        pub goal: u64,
        /// 1 if the target is at rest at its goal, else 0.
        pub at_goal: u64,
    }
}

crate::state_buffer! {
    /// Target velocity of a frame. Expressed in world axes, unless the component that reads the target
    /// defines its own axes: `control.wheels` uses the axes of the base.
    ///
    /// ```
    /// use motorium::state::TwistTarget;
    ///
    /// let up = TwistTarget { linear: [0.0, 0.0, 0.05], ..TwistTarget::default() };
    /// assert_eq!(up.angular, [0.0; 3]);
    /// ```
    pub struct TwistTarget as "motorium.TwistTarget" {
        /// Linear velocity of the frame's origin, m/s.
        pub linear: [f64; 3],
        /// Angular velocity, rad/s.
        pub angular: [f64; 3],
    }
}

crate::state_buffer! {
    /// Pose and velocity of a robot's base. Together with the joint state, this is the complete state of a
    /// floating-base robot.
    ///
    /// Position and orientation are the base's part of `q` in `motorium-robots`. The linear velocity followed
    /// by the angular velocity is the base's part of `v`.
    pub struct BaseState as "motorium.BaseState" {
        /// Position of the base frame's origin in the world, m.
        pub position: [f64; 3],
        /// Orientation of the base in the world as a unit quaternion, x y z w.
        pub orientation: [f64; 4],
        /// Velocity of the base frame's origin, in the axes of the base, m/s.
        pub linear_velocity: [f64; 3],
        /// Angular velocity, in the axes of the base, rad/s.
        pub angular_velocity: [f64; 3],
    }
}

crate::state_buffer! {
    /// Planar pose and velocity of a base from wheel odometry, with the uncertainty of the pose.
    ///
    /// ```
    /// use motorium::state::Odometry;
    ///
    /// let odometry = Odometry { covariance: [4e-4, 0.0, 0.0, 0.0, 1e-4, 0.0, 0.0, 0.0, 1e-4], ..Odometry::default() };
    /// assert_eq!(odometry.covariance[0].sqrt(), 0.02); // standard deviation along x, m
    /// ```
    pub struct Odometry as "motorium.Odometry" {
        /// Position of the base frame's origin along x and y of the world, m.
        pub position: [f64; 2],
        /// Yaw angle about the world's z axis, unwrapped, rad.
        pub yaw: f64,
        /// Velocity of the base frame's origin along x and y of the base, m/s.
        pub velocity: [f64; 2],
        /// Rate of change of the yaw angle, rad/s.
        pub yaw_rate: f64,
        /// Covariance of x, y and yaw, a 3 x 3 matrix row by row, m^2, m rad and rad^2.
        pub covariance: [f64; 9],
        /// Distance travelled since the start, m.
        pub distance: f64,
    }
}

crate::state_buffer! {
    /// Force and torque on a body, expressed at the origin and in the axes of the measuring frame.
    pub struct Wrench as "motorium.Wrench" {
        /// Force, N.
        pub force: [f64; 3],
        /// Torque, N m.
        pub torque: [f64; 3],
    }
}

crate::state_buffer! {
    /// One sample of an inertial measurement unit, in the axes of the sensor.
    pub struct ImuSample as "motorium.ImuSample" {
        /// Specific force (acceleration minus gravity), m/s^2.
        pub specific_force: [f64; 3],
        /// Angular velocity, rad/s.
        pub angular_velocity: [f64; 3],
        /// Orientation of the sensor in the world as a unit quaternion, x y z w.
        pub orientation: [f64; 4],
    }
}

crate::state_buffer! {
    /// Phase of a periodic or one-shot motion, by which components that share the motion stay synchronised.
    pub struct Phase as "motorium.Phase" {
        /// Phase: rad for a periodic motion; from 0 at the start to 1 at the end for a one-shot motion.
        pub phase: f64,
        /// Time derivative of the phase, rad/s for a periodic and 1/s for a one-shot motion.
        pub rate: f64,
        /// Scale factor of the motion's amplitude.
        pub amplitude: f64,
        /// Number of completed repetitions.
        pub cycle: u64,
    }
}

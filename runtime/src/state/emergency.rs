//! The emergency stop.

crate::state_buffer! {
    /// An emergency stop, for example from a button, a supervisor or a light curtain.
    ///
    /// This message is published on the topic that the graph names in `[safety] emergency_stop`. After a
    /// value with `stop` set, every actuator of the graph stays in its safe state until `motorium resume`,
    /// even if the publisher dies.
    ///
    /// ```
    /// use motorium::state::EmergencyStop;
    ///
    /// assert!(EmergencyStop { stop: 1 }.is_pressed());
    /// assert!(!EmergencyStop::default().is_pressed());
    /// ```
    pub struct EmergencyStop as "motorium.EmergencyStop" {
        /// Any value other than 0 stops the robot.
        pub stop: u64,
    }
}

impl EmergencyStop {
    /// Returns `true` if this value stops the robot.
    pub fn is_pressed(&self) -> bool {
        self.stop != 0
    }
}

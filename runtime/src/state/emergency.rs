//! The emergency stop.

crate::state_buffer! {
    /// An emergency stop: of a button, a supervisor, a light curtain.
    ///
    /// The topic that `[safety] emergency_stop` names carries it. Once a value stops, every actuator of the
    /// graph stays in its safe state until `motorium resume`, also if its publisher dies.
    ///
    /// ```
    /// use motorium::state::EmergencyStop;
    ///
    /// assert!(EmergencyStop { stop: 1 }.is_pressed());
    /// assert!(!EmergencyStop::default().is_pressed());
    /// ```
    pub struct EmergencyStop as "motorium.EmergencyStop" {
        /// Anything but 0 stops.
        pub stop: u64,
    }
}

impl EmergencyStop {
    /// True if this value stops.
    pub fn is_pressed(&self) -> bool {
        self.stop != 0
    }
}

//! Settings of a simulated drive.

/// Settings of a simulated drive that differ from the table.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overrides {
    /// Watchdog time, ns; 0 for off.
    pub watchdog_ns: Option<u64>,
    /// Largest torque of its range, or its rated torque, N m.
    pub torque: Option<f64>,
}

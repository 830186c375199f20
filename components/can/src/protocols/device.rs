//! Devices found on a bus.

use crate::drive::PositionReference;

/// Device found on a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Device {
    /// ID on the bus.
    pub node: u8,
    /// Kind of the device.
    pub kind: DeviceKind,
}

/// Kind of a device.
#[derive(Clone, Debug, PartialEq)]
pub enum DeviceKind {
    /// Damiao drive with readable settings.
    Damiao {
        /// Identifier of the drive's answers.
        master: u16,
        /// Watchdog time, ns, 0 for off; `None` if not read.
        watchdog_ns: Option<u64>,
        /// Limits of the ranges: position (rad), velocity (rad/s), torque (N m); `None` for a limit that was
        /// not read.
        ranges: [Option<f64>; 3],
    },
    /// ODrive, found by the axis state and errors in its heartbeat.
    Odrive {
        /// State of the axis, such as 1 for idle and 8 for closed loop.
        state: u8,
        /// Errors of the axis.
        errors: u32,
    },
    /// CANopen node, found by the state in its heartbeat.
    CanOpen {
        /// State of the node: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational.
        state: u8,
    },
    /// moteus drive, found by its answer to a query.
    Moteus {
        /// Name of the active mode.
        mode: String,
        /// Position reference; `None` if not reported.
        home: Option<PositionReference>,
        /// Fault code.
        fault: u8,
    },
}

impl DeviceKind {
    /// Updates the kind of a device that was found again. Settings that `other` lacks are kept.
    pub(crate) fn update(&mut self, other: Self) {
        match (self, other) {
            (
                Self::Damiao { watchdog_ns, ranges, .. },
                Self::Damiao { watchdog_ns: other, ranges: other_ranges, .. },
            ) => {
                *watchdog_ns = watchdog_ns.or(other);
                for (range, other) in ranges.iter_mut().zip(other_ranges) {
                    *range = range.or(other);
                }
            }
            (kind, other) => *kind = other,
        }
    }
}

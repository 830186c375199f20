//! Joints with simulated drives.

use super::actuation::Actuation;
use crate::{AnySimulatedDrive, Transmission};

/// One joint with its drive.
pub(super) struct Axis {
    pub(super) name: String,
    pub(super) drive: AnySimulatedDrive,
    pub(super) gear: Transmission,
    /// Actuator between the drive and the joint, unless it is ideal.
    pub(super) actuation: Option<Actuation>,
    pub(super) bus: usize,
    /// Node of the drive on the bus.
    pub(super) node: usize,
    /// Index of the drive in the table.
    pub(super) entry: usize,
    /// `true` if the drive was without power in the previous step.
    pub(super) was_off: bool,
    /// `true` if the drive's controller is bus-off, or its cable is unplugged.
    pub(super) is_cut_off: bool,
}

impl Axis {
    /// Returns `true` if the drive receives the traffic of the bus.
    pub(super) fn is_on_bus(&self) -> bool {
        !self.was_off && !self.is_cut_off
    }
}

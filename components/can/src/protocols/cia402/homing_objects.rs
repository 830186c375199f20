//! Objects of a homing by a CiA 402 drive.

use core::f64::consts::TAU;

use crate::protocols::entries::{DriveEntry, HomingBy};

/// Objects of a CiA 402 homing, in units of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HomingObjects {
    /// Homing method, object 0x6098.
    pub(crate) method: i8,
    /// Velocities towards and at the mark, objects 0x6099:01 and 0x6099:02, increments per second.
    pub(crate) velocities: [u32; 2],
    /// Acceleration, object 0x609A, increments per second squared.
    pub(crate) acceleration: u32,
}

impl HomingObjects {
    /// Returns the objects of an entry; `None` if the drive has no homing procedure of its own, or if a value
    /// does not fit into its object.
    pub(crate) fn from_entry(entry: &DriveEntry) -> Option<Self> {
        let homing = entry.homing.as_ref().filter(|homing| homing.by == HomingBy::Drive)?;
        let per_joint = entry.increments? / TAU * entry.ratio;
        let whole = |value: Option<f64>| {
            let increments = (value? * per_joint + 0.5).floor();
            (1.0..=f64::from(u32::MAX)).contains(&increments).then_some(increments as u32)
        };
        Some(Self {
            method: homing.method?,
            velocities: [whole(homing.velocity)?, whole(homing.creep_velocity)?],
            acceleration: whole(homing.acceleration)?,
        })
    }

    /// Returns the written objects, with index, subindex and number.
    pub(crate) fn registers(&self) -> Vec<(u16, u8, i64)> {
        vec![
            (0x6098, 0, self.method.into()),
            (0x6099, 1, self.velocities[0].into()),
            (0x6099, 2, self.velocities[1].into()),
            (0x609a, 0, self.acceleration.into()),
            (0x607c, 0, 0),
        ]
    }
}

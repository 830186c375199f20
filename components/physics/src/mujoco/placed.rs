//! Placed articulations in MuJoCo: joints and base with so much inertia that nothing deflects them in a step.

use super::Mujoco;
use super::native::Native;
use super::places::ArticulationPlaces;
use crate::articulated::Drive;
use crate::robot::Articulation;

/// Inertia of each degree of freedom of a placed articulation \[kg m2 or kg\]. A force of 1 kN changes its
/// velocity by 1 um/s in a millisecond; more would cost MuJoCo's solver digits of the forces on objects.
const IMMOVABLE: f64 = 1e6;

impl Mujoco {
    /// Clears the drive states left by the last steps of an articulation. The next step finds contacts near
    /// it.
    pub(super) fn forget_drives(&mut self, own: &Articulation) {
        self.drives[own.joints()].fill(Drive::Linear);
        self.external[own.v()].fill(0.0);
        self.seen.near = true;
    }
}

/// Sets the inertia of a floating base in addition to its links'.
pub(super) fn set_base_inertia(native: &mut Native, places: &ArticulationPlaces, placed: bool) {
    if let Some((_, first)) = places.base {
        let inertia = if placed { IMMOVABLE } else { 0.0 };
        (first..first + 6).for_each(|dof| native.set_armature(dof, inertia));
    }
}

/// Makes the joints of a placed articulation immovable.
pub(super) fn hold_joints(native: &mut Native, places: &ArticulationPlaces) {
    for (_, dof) in &places.joints {
        native.set_armature(*dof, IMMOVABLE);
    }
}

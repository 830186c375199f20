//! A placed robot in rapier: joints with so much inertia that nothing deflects them in a step.

use super::Rapier;
use super::multibody::DriveAction;
use crate::robot::Robot;

/// Inertia of each joint of a placed robot \[kg m2 or kg\]. A force of 1 kN changes its velocity by 1 um/s in
/// a millisecond.
const IMMOVABLE: f64 = 1e6;

impl Rapier {
    /// Makes the joints immovable, or returns them to their drives, which have no effort yet.
    pub(super) fn change_drives(&mut self, robot: &Robot, placed: bool) {
        let model = &robot.first().model;
        for (column, joint) in robot.joints.iter().enumerate() {
            let place = (column, robot.state.q[column]);
            self.multibody.drive(model, &mut self.scene, place, DriveAction::Constant(0.0), joint);
        }
        let inertia = placed.then_some(IMMOVABLE);
        self.multibody.set_inertia(model, &robot.joints, &mut self.scene, inertia);
        self.integrator.forget();
        self.overdriven.fill(false);
        self.stale = true;
    }
}

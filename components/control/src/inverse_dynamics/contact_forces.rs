//! Contacts of inverse dynamics: forces of the last solution, and settings that change between ticks.

use motorium_robots::Twist;
use nalgebra::Vector3;

use super::InverseDynamics;
use crate::contact::{Contact, ContactShape};

impl InverseDynamics {
    /// Returns the wrench of a contact in the last solution: the force on the robot and its torque about the
    /// origin of the contact's frame, world axes \[N, Nm\].
    pub fn wrench(&self, contact: usize) -> Twist {
        let place = &self.contacts[contact];
        let mut wrench = Twist::zero();
        for (point, arm) in place.arms.iter().enumerate() {
            let force = self.solution.forces.fixed_rows::<3>(3 * (place.first_point + point));
            let force = place.axes * force;
            wrench.linear += force;
            wrench.angular += arm.cross(&force);
        }
        wrench
    }

    /// Returns the centre of pressure of a sole in the last solution: the point about which its normal forces
    /// have no torque. The coordinates are along x and y of the sole's frame, from its origin \[m\]. Returns
    /// `None` for other shapes and unloaded contacts.
    ///
    /// On level ground, the centre of pressure is the zero-moment point of the foot. It keeps at least the
    /// [margin](Contact::margin) from the edges of the sole, since the forces at the corners can only push.
    pub fn centre_of_pressure(&self, contact: usize) -> Option<[f64; 2]> {
        let place = &self.contacts[contact];
        let ContactShape::Sole { .. } = place.contact.shape else { return None };
        let (mut normal, mut moment) = (0.0, Vector3::zeros());
        for (point, arm) in place.arms.iter().enumerate() {
            let force = self.solution.forces[3 * (place.first_point + point) + 2];
            normal += force;
            moment += place.axes.tr_mul(arm) * force;
        }
        (normal > 0.0).then(|| [moment.x / normal, moment.y / normal])
    }

    /// Returns the contacts in the order of construction.
    pub fn contacts(&self) -> impl ExactSizeIterator<Item = &Contact> {
        self.contacts.iter().map(|place| &place.contact)
    }

    /// Returns the index of a contact's point among the points of all contacts. The force of point `k` is in
    /// entries `3 k` to `3 k + 2` of [`forces`](InverseDynamicsSolution::forces).
    pub fn point_number(&self, contact: usize, point: usize) -> usize {
        self.contacts[contact].first_point + point
    }

    /// Activates or deactivates a contact from the next [`begin`](Self::begin).
    pub fn set_active(&mut self, contact: usize, active: bool) {
        self.contacts[contact].active = active;
    }

    /// Returns `true` if a contact is active.
    pub fn is_active(&self, contact: usize) -> bool {
        self.contacts[contact].active
    }

    /// Sets the maximum normal force at each point of a contact \[N\] from the next [`begin`](Self::begin).
    /// To unload a contact before lifting it, ramp this force to zero.
    pub fn set_max_force(&mut self, contact: usize, force: f64) {
        self.contacts[contact].contact.max_force = force;
    }

    /// Sets the unit surface normal at a contact from the next [`begin`](Self::begin). Ignored for a sole,
    /// which uses its frame's normal.
    pub fn set_normal(&mut self, contact: usize, normal: Vector3<f64>) {
        self.contacts[contact].contact.normal = normal;
    }

    /// Sets the coefficient of friction of a contact from the next [`begin`](Self::begin).
    pub fn set_friction(&mut self, contact: usize, friction: f64) {
        self.contacts[contact].contact.friction = friction;
    }
}

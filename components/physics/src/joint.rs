//! Passive properties of joints.

use motorium_robots::Model;

/// Passive properties of one independent joint. The properties include the contributions of joints that mimic
/// this joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointProperties {
    /// Lower position limit \[rad or m\]; -inf without a limit.
    pub lower: f64,
    /// Upper position limit \[rad or m\]; +inf without a limit.
    pub upper: f64,
    /// Maximum effort of the drive in either direction \[Nm or N\].
    pub effort_limit: f64,
    /// Velocity limit \[rad/s or m/s\]; +inf without a limit. The simulation counts steps in which the joint
    /// exceeds this limit. A drive enforces a velocity limit only if its command
    /// ([`JointSetpoint`](crate::JointSetpoint)) contains the limit.
    pub velocity_limit: f64,
    /// Viscous damping \[Nms/rad or Ns/m\].
    pub damping: f64,
    /// Coulomb friction \[Nm or N\].
    pub friction: f64,
    /// Inertia of the rotor reflected to the joint \[kg m2 or kg\].
    pub armature: f64,
    /// Stiffness of the joint's spring \[Nm/rad or N/m\]; 0 without a spring.
    pub stiffness: f64,
    /// Position at which the spring is relaxed \[rad or m\].
    pub rest: f64,
}

impl JointProperties {
    /// Returns the properties of every independent joint of `model`. All joints have the given armature \[kg
    /// m2 or kg\].
    ///
    /// A mimic joint adds `multiplier^2` times its damping and stiffness, and `|multiplier|` times its
    /// friction, to the joint that it follows.
    pub fn from_model(model: &Model, armature: f64) -> Vec<Self> {
        let mut joints: Vec<Self> = (0..model.joint_count())
            .map(|index| Self {
                lower: model.lower()[index],
                upper: model.upper()[index],
                effort_limit: model.effort_limit()[index],
                velocity_limit: model.velocity_limit()[index],
                damping: 0.0,
                friction: 0.0,
                armature,
                stiffness: 0.0,
                rest: 0.0,
            })
            .collect();
        for body in model.bodies() {
            let joint = &body.joint;
            let (multiplier, offset) = (joint.coordinate.multiplier(), joint.coordinate.offset());
            let own = &mut joints[joint.coordinate.index()];
            own.damping += multiplier * multiplier * joint.dynamics.damping;
            own.friction += multiplier.abs() * joint.dynamics.friction;
            let stiffness = multiplier * multiplier * joint.dynamics.stiffness;
            if stiffness > 0.0 {
                // Two parallel springs act as one spring that rests at the mean of their rest positions,
                // weighted by stiffness.
                let rest = (joint.dynamics.rest - offset) / multiplier;
                own.rest = (own.stiffness * own.rest + stiffness * rest) / (own.stiffness + stiffness);
                own.stiffness += stiffness;
            }
        }
        joints
    }

    /// Returns the velocity beyond which the simulation is no longer meaningful \[rad/s or m/s\]: 20 times
    /// the velocity limit, but at least 100; 1000 for a joint without a velocity limit.
    pub fn divergence_bound(&self) -> f64 {
        if self.velocity_limit.is_finite() { (20.0 * self.velocity_limit).max(100.0) } else { 1000.0 }
    }
}

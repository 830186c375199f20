//! The table `inverse_dynamics` of `control.qp`.

use motorium::prelude::*;
use motorium::units::TimeSpan;
use motorium_robots::{Foot, Model, Profile};
use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::checks::in_range;
use crate::inverse_dynamics::{
    Contact, ContactShape, FrictionModel, InverseDynamicsSettings, JointAccelerationLimits, Unknowns,
    WrenchCone,
};
use crate::limits::LimitsConfig;

/// Fraction of the profile's acceleration limits to use. Drives that follow the integrated accelerations
/// overshoot them.
const PROFILE_SHARE: f64 = 0.9;

with_defaults! {
    /// Whole-body inverse dynamics: torques, contacts, floating bases. Every key has a default. For a robot
    /// of the catalogue with feet the table may stay empty.
    ///
    /// ```toml
    /// contacts = [{ foot = "left" }, { foot = "right", friction = 0.5 }]
    /// force_weight = 1e-3
    /// on_infeasible = "relax"
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct InverseDynamicsConfig;

    /// Decision variables of each step. Default "accelerations_and_forces".
    pub unknowns: Unknowns = Unknowns::AccelerationsAndForces;
    /// Contacts with the ground. Default: all feet of the robot's profile.
    pub contacts: Option<Vec<ContactConfig>> = None;
    /// Cost of a contact force, 1/N, 0 to 1000, which spreads the load over the contact points. Default 1e-3.
    pub force_weight: f64 = 1e-3;
    /// Deceleration that always suffices to stop a joint before its limits, rad/s2 or m/s2, 1e-3 to 1e6. Must
    /// not exceed the joint's maximum acceleration. Default 20.
    pub braking: f64 = InverseDynamicsSettings::default().joints.braking;
    /// Maximum acceleration of a joint, rad/s2 or m/s2. Must not be less than `braking`. Default: 0.9 times
    /// the limit of the robot's profile, 1000 for a joint without a limit.
    pub max_acceleration: Option<f64> = None;
    /// Fraction of the torque limits that may be used, more than 0, at most 1. Default 1.
    pub torque_fraction: f64 = InverseDynamicsSettings::default().torque_fraction;
    /// Decay rate of the margin between a velocity and its limit in `limits.frames`, `limits.collision` or
    /// `limits.support`, 1/s, 1e-3 to 1e6. The margin shrinks no faster than at this rate, which is limited
    /// to the tick rate. Default 100.
    pub barrier_rate: f64 = InverseDynamicsSettings::default().barrier_rate;
    /// Fraction of the joint damping in the robot's file that the torques compensate, 0 to 1. Default 0.
    pub joint_damping: f64 = InverseDynamicsSettings::default().joint_damping;
    /// Decay rate of the velocity of a slipping contact, 1/s, 0 to 1000. Default 20.
    pub contact_damping: f64 = InverseDynamicsSettings::default().contact_damping;
    /// Duration of loading or unloading a contact that is switched on or off. Default 200 ms.
    pub contact_ramp: TimeSpan = TimeSpan { ns: 200_000_000 };
    /// Fraction of the gains kp and kd with which the drives follow the integrated accelerations, 0 to 1.
    /// Default 0 (torques alone), or 1 with `unknowns = "accelerations"` (positions and velocities, with the
    /// torques as a feed-forward).
    pub impedance: Option<f64> = None;
    /// Initial period in which the drives hold their positions with full kp and kd in addition to the
    /// torques. During this period the actuators leave the safe state. The gains then ramp down to
    /// `impedance` within half of that period. Default 600 ms.
    pub stiff_start: TimeSpan = TimeSpan { ns: 600_000_000 };
    /// Friction model of all contacts. Default "pyramid".
    pub friction_model: FrictionModel = FrictionModel::Pyramid;
    /// Maximum total number of solver iterations in a step, 10 to 100000, which bounds the computing time. A
    /// step that exceeds this number has no solution, and its joints are held. Default 500.
    pub max_iterations: u32 = InverseDynamicsSettings::default().max_iterations;
    /// Policy for infeasible constraints. Default "relax".
    pub on_infeasible: InfeasiblePolicy = InfeasiblePolicy::Relax;
}

/// Policy for a step with contradictory constraints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InfeasiblePolicy {
    /// Contacts at rest, joint limits and constraint tasks are relaxed; the result reports the violation.
    /// Torque limits and friction are never relaxed. Without `inverse_dynamics` only constraint tasks are
    /// relaxed.
    Relax,
    /// The joints hold their positions with their gains and the torques that support the robot's weight.
    /// Without `inverse_dynamics` the setpoint stays constant.
    Hold,
    /// No command is published, so the drives enter their safe state.
    SafeStop,
}

/// A contact: a foot of the profile, or a frame with a shape.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ContactConfig {
    /// Foot of the robot's profile, which also names the contact. Set either `foot` or `frame`.
    pub foot: Option<String>,
    /// Link whose frame touches the ground, which also names the contact. Set either `frame` or `foot`.
    pub frame: Option<String>,
    /// Radius of a ball about the origin of `frame`, m. Without `radius` and `sole` the contact is a point.
    pub radius: Option<f64>,
    /// Sides of a sole along x and y of `frame`, centred on its origin, m.
    pub sole: Option<[f64; 2]>,
    /// Coefficient of friction, 1e-3 to 10. Default: the foot's value, or 0.6.
    pub friction: Option<f64>,
    /// Maximum normal force at each point of the contact, N. Default: no limit.
    pub max_force: Option<f64>,
    /// Distance that the centre of pressure of a sole keeps from its edges, m. Must be less than half of the
    /// shorter side. Default 0.
    pub margin: Option<f64>,
    /// Limits of the total wrench of a sole. Default: only the limits of its points.
    pub wrench: Option<WrenchConfig>,
}

/// Limits of the total wrench of a sole, in addition to the limits of the forces at its corners.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WrenchConfig {
    /// Sides along x and y of the rectangle that contains the centre of pressure, centred at the origin of
    /// the frame, m. Default: the sides of the sole, reduced by `margin` at each edge.
    pub sides: Option<[f64; 2]>,
    /// Coefficient of friction for tangential force and yaw torque, 1e-3 to 10. Default: the contact's value.
    pub friction: Option<f64>,
    /// Minimum normal force, N, at least 0. Default 0.
    pub min_force: Option<f64>,
    /// Maximum normal force, N. Must be greater than `min_force`. Default: no limit.
    pub max_force: Option<f64>,
    /// Maximum torque about the normal, Nm, at least 0. Default: no limit.
    pub max_yaw: Option<f64>,
}

impl WrenchConfig {
    /// Converts the limits of a contact and checks them.
    fn cone(&self, contact: &Contact, key: &dyn Fn(&str) -> String) -> Result<WrenchCone, ConfigError> {
        let ContactShape::Sole { sides } = contact.shape else {
            return Err(ConfigError::key(key("wrench"), "the contact has no sole")
                .advise("a point or a ball transmits no torque: limit it by `friction` and `max_force`"));
        };
        let cone = WrenchCone {
            sides: self.sides.unwrap_or(sides.map(|side| side - 2.0 * contact.margin)),
            friction: self.friction.unwrap_or(contact.friction),
            min_force: self.min_force.unwrap_or(0.0),
            max_force: self.max_force.unwrap_or(f64::INFINITY),
            max_yaw: self.max_yaw.unwrap_or(f64::INFINITY),
        };
        for side in cone.sides {
            in_range(&key("wrench.sides"), side, 1e-6..=1e3)?;
        }
        in_range(&key("wrench.friction"), cone.friction, 1e-3..=10.0)?;
        in_range(&key("wrench.min_force"), cone.min_force, 0.0..=1e9)?;
        in_range(&key("wrench.max_yaw"), cone.max_yaw, 0.0..=f64::INFINITY)?;
        if cone.max_force.is_nan() || cone.max_force <= cone.min_force {
            let message = format!("{} N, but `min_force` is {} N", cone.max_force, cone.min_force);
            return Err(ConfigError::key(key("wrench.max_force"), message)
                .advise("set `max_force` above `min_force`"));
        }
        Ok(cone)
    }
}

/// Returns the error for a key that has no effect with `unknowns`.
fn no_use(unknowns: &str, key: impl Into<String>) -> ConfigError {
    let message = format!("it has no effect with `unknowns = \"{unknowns}\"`");
    ConfigError::key(key, message)
        .advise("leave it out, or solve for motions and forces: unknowns = \"accelerations_and_forces\"")
}

impl InverseDynamicsConfig {
    /// Converts the contacts and checks them.
    pub(super) fn contacts(
        &self,
        model: &Model,
        profile: Option<&Profile>,
    ) -> Result<Vec<Contact>, ConfigError> {
        let Some(configs) = &self.contacts else {
            let feet = profile.iter().flat_map(|profile| &profile.feet);
            let contact = |(name, foot): (&String, &Foot)| {
                Contact::of_foot(model, name, foot).map_err(|error| ConfigError::new(error.to_string()))
            };
            return feet.map(contact).collect();
        };
        let mut contacts: Vec<Contact> = Vec::new();
        for (index, config) in configs.iter().enumerate() {
            let key = |name: &str| format!("inverse_dynamics.contacts[{index}].{name}");
            let contact = config.contact(model, profile, &key)?;
            if contacts.iter().any(|other| other.name == contact.name) {
                let message = format!("contact `{}` is listed twice", contact.name);
                return Err(ConfigError::key(key("foot"), message));
            }
            contacts.push(contact);
        }
        Ok(contacts)
    }

    /// Returns the largest acceleration of each joint from the robot's profile, or `None` if the table
    /// defines one for all joints or the robot has no profile.
    pub(super) fn profile_acceleration(
        &self,
        model: &Model,
        profile: Option<&Profile>,
    ) -> Result<Option<DVector<f64>>, ConfigError> {
        let Some(profile) = profile.filter(|_| self.max_acceleration.is_none()) else { return Ok(None) };
        let limit = profile.acceleration_limit(model);
        let limit = limit.map_err(|error| ConfigError::key("robot", error.to_string()))?;
        Ok(Some(limit * PROFILE_SHARE))
    }

    /// Returns the fraction of the gains with which the drives follow the integrated accelerations.
    pub(super) fn impedance(&self) -> f64 {
        self.impedance.unwrap_or(if self.unknowns == Unknowns::Accelerations { 1.0 } else { 0.0 })
    }

    /// Rejects keys that have no effect for the unknowns.
    fn refuse_unused_keys(&self) -> Result<(), ConfigError> {
        let default = Self::default();
        let of_forces = [
            ("torque_fraction", self.torque_fraction != default.torque_fraction),
            ("friction_model", self.friction_model != default.friction_model),
        ];
        let of_motions = [
            ("braking", self.braking != default.braking),
            ("max_acceleration", self.max_acceleration != default.max_acceleration),
            ("contact_damping", self.contact_damping != default.contact_damping),
        ];
        let (words, unused) = match self.unknowns {
            Unknowns::AccelerationsAndForces => return Ok(()),
            Unknowns::Accelerations => ("accelerations", &of_forces[..]),
            Unknowns::Forces => ("forces", &of_motions[..]),
        };
        if let Some((key, _)) = unused.iter().find(|(_, given)| *given) {
            return Err(no_use(words, format!("inverse_dynamics.{key}")));
        }
        // accelerations may be feasible without any contact force
        let has_least = |config: &ContactConfig| {
            config.wrench.is_some_and(|wrench| wrench.min_force.is_some_and(|force| force != 0.0))
        };
        let contact = self.contacts.iter().flatten().position(has_least);
        match contact.filter(|_| self.unknowns == Unknowns::Accelerations) {
            Some(index) => Err(no_use(words, format!("inverse_dynamics.contacts[{index}].wrench.min_force"))),
            None => Ok(()),
        }
    }

    /// Rejects joint limits if only forces are decided, since no joint moves then.
    pub(super) fn refuse_unused_limits(&self, limits: &LimitsConfig) -> Result<(), ConfigError> {
        let default = LimitsConfig::default();
        let given = [
            ("limits.position.margin", limits.position.margin != default.position.margin),
            ("limits.velocity.fraction", limits.velocity.fraction != default.velocity.fraction),
        ];
        match given.into_iter().find(|(_, given)| *given && self.unknowns == Unknowns::Forces) {
            Some((key, _)) => Err(no_use("forces", key)),
            None => Ok(()),
        }
    }

    /// Converts the settings and checks them.
    pub(super) fn settings(
        &self,
        gravity: [f64; 3],
        damping: f64,
        limits: &LimitsConfig,
    ) -> Result<InverseDynamicsSettings, ConfigError> {
        let key = |name: &str| format!("inverse_dynamics.{name}");
        self.refuse_unused_keys()?;
        in_range(&key("impedance"), self.impedance(), 0.0..=1.0)?;
        let joints = JointAccelerationLimits::default();
        let braking = in_range(&key("braking"), self.braking, 1e-3..=1e6)?;
        in_range(&key("max_iterations"), f64::from(self.max_iterations), 10.0..=1e5)?;
        Ok(InverseDynamicsSettings {
            gravity: gravity.into(),
            damping,
            force_weight: in_range(&key("force_weight"), self.force_weight, 0.0..=1000.0)?,
            contact_damping: in_range(&key("contact_damping"), self.contact_damping, 0.0..=1000.0)?,
            joints: JointAccelerationLimits {
                braking,
                max_acceleration: in_range(
                    &key("max_acceleration"),
                    self.max_acceleration.unwrap_or(joints.max_acceleration),
                    braking..=1e9,
                )?,
                margin: limits.position.margin,
                velocity_fraction: limits.velocity.fraction,
            },
            friction_model: self.friction_model,
            unknowns: self.unknowns,
            max_iterations: self.max_iterations,
            joint_damping: in_range(&key("joint_damping"), self.joint_damping, 0.0..=1.0)?,
            torque_fraction: in_range(&key("torque_fraction"), self.torque_fraction, 1e-6..=1.0)?,
            barrier_rate: in_range(&key("barrier_rate"), self.barrier_rate, 1e-3..=1e6)?,
            relaxation: match self.on_infeasible {
                InfeasiblePolicy::Relax => InverseDynamicsSettings::default().relaxation,
                InfeasiblePolicy::Hold | InfeasiblePolicy::SafeStop => None,
            },
        })
    }
}

impl ContactConfig {
    fn contact(
        &self,
        model: &Model,
        profile: Option<&Profile>,
        key: &dyn Fn(&str) -> String,
    ) -> Result<Contact, ConfigError> {
        let mut contact = match (&self.foot, &self.frame) {
            (Some(name), None) => {
                if self.radius.is_some() || self.sole.is_some() {
                    let message = "the robot's profile defines the shape of a foot";
                    return Err(ConfigError::key(key("foot"), message)
                        .advise("name the `frame` of the foot instead of `foot`"));
                }
                let feet = profile.map(|profile| &profile.feet);
                let Some(foot) = feet.and_then(|feet| feet.get(name)) else {
                    let names: Vec<_> =
                        feet.iter().flat_map(|feet| feet.keys().map(String::as_str)).collect();
                    let message = format!("robot `{}` has no foot `{name}`", model.name());
                    return Err(ConfigError::key(key("foot"), message).advise(match names.is_empty() {
                        true => "its profile has no feet: name a `frame` and its shape".to_owned(),
                        false => format!("it has {}", names.join(", ")),
                    }));
                };
                Contact::of_foot(model, name, foot)
                    .map_err(|error| ConfigError::key(key("foot"), error.to_string()))?
            }
            (None, Some(name)) => {
                let frame =
                    model.frame(name).map_err(|error| ConfigError::key(key("frame"), error.to_string()))?;
                let shape = match (self.sole, self.radius) {
                    (Some(_), Some(_)) => {
                        return Err(ConfigError::key(key("radius"), "the contact also has a `sole`"));
                    }
                    (Some(sides), None) => ContactShape::Sole { sides },
                    (None, Some(radius)) => ContactShape::Ball { radius },
                    (None, None) => ContactShape::Point,
                };
                Contact::new(name, frame, shape)
            }
            _ => {
                let message = "a contact is either a `foot` of the profile or a `frame`";
                return Err(ConfigError::key(key("foot"), message));
            }
        };
        if let ContactShape::Sole { sides } = contact.shape {
            for side in sides {
                in_range(&key("sole"), side, 1e-6..=1e3)?;
            }
        }
        if let ContactShape::Ball { radius } = contact.shape {
            in_range(&key("radius"), radius, 0.0..=1e3)?;
        }
        if let Some(friction) = self.friction {
            contact.friction = in_range(&key("friction"), friction, 1e-3..=10.0)?;
        }
        if let Some(margin) = self.margin {
            let ContactShape::Sole { sides } = contact.shape else {
                return Err(ConfigError::key(key("margin"), "the contact has no sole"));
            };
            let half = 0.5 * sides[0].min(sides[1]);
            contact.margin = in_range(&key("margin"), margin, 0.0..=f64::MAX)?;
            if margin >= half {
                let message =
                    format!("{margin} m leaves nothing of a sole of {} m by {} m", sides[0], sides[1]);
                return Err(ConfigError::key(key("margin"), message)
                    .advise(format!("choose less than half of its shorter side, {half} m")));
            }
        }
        if let Some(force) = self.max_force {
            contact.max_force = in_range(&key("max_force"), force, 1e-3..=1e9)?;
        }
        contact.wrench = self.wrench.map(|wrench| wrench.cone(&contact, key)).transpose()?;
        Ok(contact)
    }
}

//! Contact switching by parameters and a schedule.

use motorium::prelude::*;
use motorium::state::{ContactSchedule, MAX_FEET};
use nalgebra::Vector3;

use crate::component::setup::ControllerSetup;
use crate::inverse_dynamics::{Contact, InverseDynamics};

/// Limit of the normal force at each point of a fully loaded contact, as a multiple of the robot's weight.
const LOADED: f64 = 2.0;

/// Length below which a normal is treated as missing.
const LEAST_NORMAL: f64 = 1e-6;

/// Name of the input of the schedule.
const INPUT: &str = "contact_schedule";

/// Contacts of a torque controller. The load fraction of each is its ramped parameter times the fraction in
/// the schedule, which the planner ramps.
pub(super) struct ContactSwitches {
    switches: Vec<Switch>,
    /// `None` for a robot without feet.
    schedule: Option<Input<ContactSchedule>>,
    /// Feet of the robot's profile.
    feet: usize,
    ramp: f64,
    /// Ground normal from the last schedule.
    normal: Vector3<f64>,
    /// Number of steps in which all feet stood because the schedule was stale or did not match the profile.
    without_schedule: u64,
}

/// Load fraction of a contact, ramped towards a parameter.
struct Switch {
    parameter: Parameter<f64>,
    load: f64,
    /// Load fraction allowed by the schedule. Without a fresh schedule it ramps back to 1.
    share: f64,
    /// Index of the contact's foot in the schedule.
    foot: Option<usize>,
    /// Largest normal force at each point under full load \[N\], and while it is ramped.
    max_force: f64,
    ramped: f64,
}

impl ContactSwitches {
    pub(super) fn declare(contacts: &[Contact], parts: &ControllerSetup, declare: &mut Declare) {
        for contact in contacts {
            let doc = "fraction of its load that the contact may carry, ramped; 0 lifts it";
            declare.float(&format!("{}_contact", contact.name), 1.0, 0.0..=1.0, "", doc);
        }
        if feet(parts).count() > 0 {
            let doc = "load fraction of each foot of the profile; without a fresh schedule all feet stand";
            declare.optional_input::<ContactSchedule>(INPUT, doc);
        }
    }

    pub(super) fn configure(
        contacts: &[Contact],
        parts: &ControllerSetup,
        (weight, ramp): (f64, f64),
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let switch = |contact: &Contact| {
            let parameter = setup.parameter(&format!("{}_contact", contact.name))?;
            let (max_force, foot) = (contact.max_force, feet(parts).position(|name| *name == contact.name));
            let ramped = max_force.min(LOADED * weight);
            Ok(Switch { parameter, load: 1.0, share: 1.0, foot, max_force, ramped })
        };
        let switches = contacts.iter().map(switch).collect::<Result<Vec<_>, ConfigureError>>()?;
        let feet = feet(parts).count();
        let schedule = if feet > 0 { Some(setup.input(INPUT)?) } else { None };
        Ok(Self { switches, schedule, feet, ramp, normal: Vector3::z(), without_schedule: 0 })
    }

    /// Loads and unloads the contacts for a step of `dt` seconds. A schedule older than `timeout_ns` is
    /// ignored.
    pub(super) fn apply(&mut self, control: &mut InverseDynamics, dt: f64, timeout_ns: u64) {
        let step = dt / self.ramp.max(dt);
        let wired = self.is_scheduled();
        let fresh = self
            .schedule
            .as_mut()
            .and_then(Input::latest)
            .filter(|schedule| schedule.age_ns() <= timeout_ns && schedule.count() == self.feet);
        self.without_schedule += u64::from(wired && fresh.is_none());
        let planned = fresh.as_ref().map(|schedule| schedule.load());
        // without a fresh schedule the ground stays unchanged
        if let Some(schedule) = &fresh {
            let normal = Vector3::from(schedule.ground_normal);
            self.normal = normal.try_normalize(LEAST_NORMAL).unwrap_or(Vector3::z());
        }
        for (index, switch) in self.switches.iter_mut().enumerate() {
            switch.load += (switch.parameter.get() - switch.load).clamp(-step, step);
            switch.share = match planned.zip(switch.foot) {
                Some((planned, foot)) => planned[foot].clamp(0.0, 1.0),
                None => (switch.share + step).min(1.0),
            };
            let load = switch.load * switch.share;
            control.set_active(index, load > 0.0);
            if wired && switch.foot.is_some() {
                control.set_normal(index, self.normal);
            }
            let full = load >= 1.0;
            control.set_max_force(index, if full { switch.max_force } else { load * switch.ramped });
        }
    }

    fn is_scheduled(&self) -> bool {
        self.schedule.as_ref().is_some_and(Input::is_wired)
    }

    pub(super) fn reset(&mut self) {
        self.switches.iter_mut().for_each(|switch| (switch.load, switch.share) = (1.0, 1.0));
        (self.normal, self.without_schedule) = (Vector3::z(), 0);
    }

    pub(super) fn add_to(&self, result: &mut serde_json::Value) {
        if self.is_scheduled() {
            result["steps_without_fresh_schedule"] = serde_json::json!(self.without_schedule);
        }
    }
}

/// Names of the profile's feet in the order of a schedule, up to the capacity of a schedule.
fn feet(parts: &ControllerSetup) -> impl Iterator<Item = &String> {
    let feet = parts.profile.iter().map(|profile| &profile.feet);
    feet.filter(|feet| feet.len() <= MAX_FEET).flat_map(|feet| feet.keys())
}

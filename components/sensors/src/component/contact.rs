//! `sensor.contact`: the contact sensors of a robot's feet as a component.

use motorium::prelude::*;
use motorium::state::{Contacts, FootContacts, MAX_FEET};
use motorium_robots::{BaseMode, Loaded};
use nalgebra::Vector3;

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::readings::refused;
use super::robot::{self, name};
use crate::channel::ErrorModel;
use crate::contact::ContactModel;
use crate::randomise::SensorDraw;

/// Minimum `other` of a contact with a link of the same robot. The largest number is a contact with the
/// ground.
const FIRST_LINK: u32 = 65_536;

sensor_config! {
    /// Configuration of `sensor.contact`. The default is an ideal sensor.
    ///
    /// ```toml
    /// force   = { noise = 0.5, resolution = 0.1 }
    /// on      = 3.0
    /// off     = 1.0
    /// latency = "2 ms"
    /// ```
    pub struct ContactConfig;

    /// Errors of the force, N.
    force: ErrorModel = ErrorModel::default();
    /// Force at or above which contact starts, N. Default 1.
    on: f64 = 1.0;
    /// Force below which contact ends, N. Default 0.5.
    off: f64 = 0.5;
}

impl ContactConfig {
    fn model(&self, feet: usize, seed: u64, draw: &SensorDraw) -> Result<ContactModel, ConfigError> {
        let force = draw.errors(&self.force);
        ContactModel::new(feet, &force, (self.on, self.off), self.seed.unwrap_or(seed)).map_err(refused)
    }
}

/// A component that publishes the readings of the contact sensors of a robot's feet.
///
/// The force on a foot is the magnitude of the sum of all contact forces on the links that are rigidly fixed
/// to the foot's frame. Forces between links of the robot are excluded.
pub struct FootContactSensor {
    contacts: Input<Contacts>,
    feet: Output<FootContacts>,
    config: ContactConfig,
    model: ContactModel,
    delivery: Delivery,
    /// The foot that each link belongs to, by its index among the links of the model.
    foot_of: Vec<Option<usize>>,
    sums: Vec<Vector3<f64>>,
    values: Vec<f64>,
    seen: (u32, u32, u64),
    since: Option<u64>,
    /// Number of samples with incomplete contacts.
    cut: u64,
}

impl Component for FootContactSensor {
    const KIND: &'static str = "sensor.contact";
    const SUMMARY: &'static str = "contact sensors of feet: force, switch, noise, latency";
    const RESETS: bool = true;
    type Config = ContactConfig;

    fn declare(config: &ContactConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let loaded = robot::load(robot::named(declare, "the feet of a robot")?, BaseMode::AsFile)?;
        let feet = feet(&loaded)?.len();
        let common = config.common();
        config.model(feet, 0, &common.declare_draws(declare)?)?;
        common.declare_readings(2 * feet, declare)?;
        declare.input::<Contacts>("contacts", "true contact points on the robot");
        declare.output::<FootContacts>("feet", "contacts of the feet, in the order of their names");
        Ok(())
    }

    fn configure(config: ContactConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let loaded = robot::load(setup.robot()?, BaseMode::AsFile)?;
        let bodies = feet(&loaded)?;
        let count = bodies.len();
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        let foot_of = |frame: &motorium_robots::Frame| bodies.iter().position(|body| *body == frame.body);
        Ok(Self {
            contacts: setup.input("contacts")?,
            feet: setup.output("feet")?,
            model: config.model(count, seed, &draw)?,
            delivery: opened.deliver(2 * count)?,
            foot_of: loaded.model.frames().iter().map(foot_of).collect(),
            sums: vec![Vector3::zeros(); count],
            values: vec![0.0; 2 * count],
            seen: (0, 0, 0),
            since: None,
            cut: 0,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        if let Some(points) = self.contacts.latest() {
            let stamp = points.stamp();
            if name(&stamp) != self.seen {
                self.seen = name(&stamp);
                self.cut += u64::from(points.cut > 0);
                self.sums.fill(Vector3::zeros());
                for index in 0..points.count() {
                    let other = points.other()[index];
                    if (FIRST_LINK..u32::MAX).contains(&other) {
                        continue;
                    }
                    let foot = self.foot_of.get(points.link()[index] as usize).copied().flatten();
                    let Some(foot) = foot else { continue };
                    self.sums[foot] += Vector3::new(
                        points.force_x()[index],
                        points.force_y()[index],
                        points.force_z()[index],
                    );
                }
                let time = points.time_ns();
                let dt =
                    self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
                let (forces, switches) = self.values.split_at_mut(self.sums.len());
                forces.iter_mut().zip(&self.sums).for_each(|(force, sum)| *force = sum.norm());
                self.model.measure(dt, forces);
                for (switch, contact) in switches.iter_mut().zip(self.model.contacts()) {
                    *switch = f64::from(u8::from(*contact));
                }
                self.delivery.push(tick.time_ns, stamp.source_time, &self.values);
            }
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        let (forces, switches) = values.split_at(values.len() / 2);
        let mut feet = self.feet.loan()?;
        feet.set_count(forces.len());
        feet.force_mut().copy_from_slice(forces);
        feet.contact_mut().iter_mut().zip(switches).for_each(|(contact, switch)| *contact = *switch as u32);
        feet.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        self.model = self
            .config
            .model(self.sums.len(), seed, &draw)
            .map_err(|error| StepError::failed(error.to_string()))?;
        (self.seen, self.since, self.cut) = ((0, 0, 0), None, 0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.delivery.result();
        result["samples_with_contacts_left_out"] = serde_json::json!(self.cut);
        Some(result)
    }
}

/// Returns the foot of each body, with feet in the order of their names.
fn feet(robot: &Loaded) -> Result<Vec<Option<usize>>, ConfigError> {
    let feet = robot.profile.iter().flat_map(|profile| profile.feet.values());
    let frames = feet.map(|foot| robot.model.frame(&foot.frame));
    let bodies = frames.map(|frame| frame.map(|frame| robot.model.frames()[frame.index()].body));
    let bodies: Vec<_> =
        bodies.collect::<Result<_, _>>().map_err(|error| ConfigError::new(error.to_string()))?;
    if bodies.is_empty() || bodies.len() > MAX_FEET {
        let message = format!("the robot has {} feet, expected 1 to {MAX_FEET}", bodies.len());
        return Err(ConfigError::key("robot", message).advise("name its feet in its profile: `[feet.NAME]`"));
    }
    Ok(bodies)
}

//! `sensor.joint_torque`: the torque sensors of a robot's joints as a component.

use motorium::prelude::*;
use motorium_robots::{FrameId, JointKind, Model};

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::force_torque::earth;
use super::loads::{Axes, TrueLoads};
use super::readings::refused;
use crate::channel::{Channel, ErrorModel, SettingError};
use crate::randomise::SensorDraw;

sensor_config! {
    /// Configuration of `sensor.joint_torque`. The default is an ideal sensor in every joint.
    ///
    /// ```toml
    /// torque  = { noise = 0.05, bias = 0.2, scale_error = 0.01, resolution = 0.01, range = 100.0 }
    /// latency = "1 ms"
    /// ```
    pub struct JointTorqueConfig;

    /// Errors of the torque of a revolute joint, N m, and of the force of a prismatic joint, N.
    torque: ErrorModel = ErrorModel::default();
    /// Gravitational acceleration (m/s^2). Default: the value in the graph's `[world]`, otherwise standard
    /// gravity.
    gravity: [f64; 3] = earth();
}

impl JointTorqueConfig {
    fn channel(&self, joints: usize, seed: u64, draw: &SensorDraw) -> Result<Channel, SettingError> {
        Channel::new("torque", &draw.errors(&self.torque), joints, self.seed.unwrap_or(seed), 0)
    }
}

/// A component that publishes the readings of torque sensors on the output side of a robot's joints.
///
/// A reading is the transmitted torque about the joint axis (or force along it), averaged over the time since
/// the previous sample. Friction, damping and inertia of the drive act on the other side of the sensor and
/// are not measured.
pub struct JointTorque {
    loads: TrueLoads,
    measured: Output<JointState>,
    config: JointTorqueConfig,
    channel: Channel,
    delivery: Delivery,
    /// Link carried by each joint.
    links: Vec<FrameId>,
    /// Torques, then positions and velocities.
    values: Vec<f64>,
    since: Option<u64>,
}

impl Component for JointTorque {
    const KIND: &'static str = "sensor.joint_torque";
    const SUMMARY: &'static str = "torque sensors of joints: noise, bias, resolution, range, latency";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = JointTorqueConfig;

    fn declare(config: &JointTorqueConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let common = config.common();
        let draw = common.declare_draws(declare)?;
        let model = TrueLoads::declare(config.gravity, declare)?;
        if model.joint_count() == 0 || model.joint_count() > MAX_JOINTS {
            let message = format!("the robot has {} joints, expected 1 to {MAX_JOINTS}", model.joint_count());
            return Err(ConfigError::new(message));
        }
        common.declare_readings(3 * model.joint_count(), declare)?;
        config.channel(model.joint_count(), 0, &draw).map_err(refused)?;
        links(&model)?;
        declare.output::<JointState>(
            "measured",
            "joint torques as efforts, with the true positions and velocities",
        );
        Ok(())
    }

    fn configure(config: JointTorqueConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let mut loads = TrueLoads::open(config.gravity, setup)?;
        let links = links(loads.model())?;
        let bodies: Vec<_> = (0..links.len()).map(|joint| loads.model().joint_body(joint)).collect();
        loads.follow(bodies.into_iter().map(Axes::Body));
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        Ok(Self {
            measured: setup.output("measured")?,
            channel: config.channel(links.len(), seed, &draw).map_err(refused)?,
            delivery: opened.deliver(3 * links.len())?,
            values: vec![0.0; 3 * links.len()],
            since: None,
            loads,
            links,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        let joints = self.links.len();
        if let Some(times) = self.loads.newest(tick)? {
            let (torques, rest) = self.values.split_at_mut(joints);
            for (joint, (torque, link)) in torques.iter_mut().zip(&self.links).enumerate() {
                *torque = along_axis(&self.loads, joint, *link);
            }
            let dt = self.since.replace(times.state).map_or(0, |since| times.state.saturating_sub(since));
            self.channel.measure(dt as f64 * 1e-9, torques);
            let (position, velocity) = self.loads.joints();
            rest[..joints].copy_from_slice(position);
            rest[joints..].copy_from_slice(velocity);
            self.delivery.push(tick.time_ns, times.source, &self.values);
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        let mut measured = self.measured.loan()?;
        measured.set_count(joints);
        measured.effort_mut().copy_from_slice(&values[..joints]);
        measured.position_mut().copy_from_slice(&values[joints..2 * joints]);
        measured.velocity_mut().copy_from_slice(&values[2 * joints..]);
        measured.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        let channel = self.config.channel(self.links.len(), seed, &draw);
        self.channel = channel.map_err(|error| StepError::failed(error.to_string()))?;
        self.loads.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.delivery.result();
        result["joints"] = serde_json::json!(self.loads.model().joint_names());
        result["samples_with_contacts_left_out"] = serde_json::json!(self.loads.incomplete());
        result["torque_bias"] = serde_json::json!(self.channel.bias());
        Some(result)
    }
}

/// Returns the component of a joint's mean wrench about its axis, or along it for a prismatic joint. The axis
/// is taken in the middle of the interval.
fn along_axis(loads: &TrueLoads, joint: usize, link: FrameId) -> f64 {
    let model = loads.model();
    let (force, torque) = loads.through(link).seen_from(&loads.middle(joint));
    let joint = model.joint(joint);
    if joint.kind == JointKind::Prismatic { joint.axis.dot(&force) } else { joint.axis.dot(&torque) }
}

/// Returns the first link carried by each joint. An intermediate body, as in a planar joint, has no link.
fn links(model: &Model) -> Result<Vec<FrameId>, ConfigError> {
    let below = |body: Option<usize>, ancestor: usize| {
        let mut body = body;
        while let Some(index) = body.filter(|index| *index != ancestor) {
            body = model.bodies()[index].parent;
        }
        body.is_some()
    };
    let first = |joint: usize| {
        let body = model.joint_body(joint);
        let frame = model.frame_ids().find(|frame| below(model.frames()[frame.index()].body, body));
        frame.ok_or_else(|| {
            ConfigError::new(format!("joint `{}` carries no link", model.joint_names()[joint]))
        })
    };
    (0..model.joint_count()).map(first).collect()
}

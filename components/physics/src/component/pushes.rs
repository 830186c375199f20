//! Pushes from outside at stated times.

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::{FrameId, Model};
use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::PhysicsEngine;
use crate::Simulation;

/// A force on a link of the robot from one time of a run, or of an episode, to another.
///
/// ```toml
/// at = "2 s"
/// duration = "100 ms"
/// link = "torso"
/// force = [60.0, 0.0, 0.0]
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PushConfig {
    /// Time at which it begins.
    pub at: TimeSpan,
    /// Its duration.
    pub duration: TimeSpan,
    /// Link that is pushed. Without it: the base.
    #[serde(default)]
    pub link: Option<String>,
    /// Point of the link at which it acts, in the axes of the link, m. Default: its origin.
    #[serde(default)]
    pub point: [f64; 3],
    /// The force in world axes, N.
    pub force: [f64; 3],
}

/// The pushes of a component, their links looked up.
pub(super) struct Pushes(Vec<Push>);

struct Push {
    from_ns: u64,
    to_ns: u64,
    link: FrameId,
    point: Point3<f64>,
    force: Vector3<f64>,
}

impl Pushes {
    /// Checks the pushes for a robot.
    pub(super) fn new<E: PhysicsEngine>(configs: &[PushConfig], model: &Model) -> Result<Self, ConfigError> {
        if !configs.is_empty() && !E::PUSHES {
            let message = format!("pushes, which `{}` cannot apply", E::KIND);
            return Err(ConfigError::key("pushes", message).advise("use `kind = \"physics.articulated\"`"));
        }
        let push = |(index, config): (usize, &PushConfig)| {
            let key = |name: &str| format!("pushes[{index}].{name}");
            let link = match &config.link {
                Some(link) => model.frame(link),
                None => model.frame(&model.frames()[0].name),
            };
            let link = link.map_err(|error| ConfigError::key(key("link"), error.to_string()))?;
            for (name, numbers) in [("point", config.point), ("force", config.force)] {
                if let Some(number) = numbers.iter().find(|number| number.is_nan() || number.abs() >= 1e6) {
                    let message = format!("{number}, expected a number between -1e6 and 1e6");
                    return Err(ConfigError::key(key(name), message));
                }
            }
            if config.duration.ns == 0 {
                return Err(ConfigError::key(key("duration"), "0, expected a time such as \"100 ms\""));
            }
            Ok(Push {
                from_ns: config.at.ns,
                to_ns: config.at.ns.saturating_add(config.duration.ns),
                link,
                point: config.point.into(),
                force: config.force.into(),
            })
        };
        configs.iter().enumerate().map(push).collect::<Result<_, _>>().map(Self)
    }

    /// Applies the pushes of the time `now_ns` to the next step of the simulation.
    pub(super) fn apply<E: PhysicsEngine>(&self, simulation: &mut Simulation<E>, now_ns: u64) {
        for push in self.0.iter().filter(|push| (push.from_ns..push.to_ns).contains(&now_ns)) {
            E::push(simulation, push.link, push.point, push.force);
        }
    }
}

//! Configuration of `policy.latent`, and its files.

use std::collections::BTreeMap;
use std::path::Path;

use motorium::declare::{ConfigError, RobotReference};
use motorium::units::TimeSpan;
use motorium_models::gplvm::LatentModel;
use motorium_primitives::reach::Repeat;
use motorium_recordings::{Recording, Selection};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::joint_command::{CommandedJoints, JointCommandConfig, earth};

/// Configuration of `policy.latent`.
///
/// ```toml
/// model  = "arms.latent"
/// motion = "take.csv"
/// rate   = 30.0
/// repeat = "forever"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LatentPolicyConfig {
    /// Path of a model written by `motorium latent train`, relative to the graph file. The latent point of
    /// the model must be a function of the human's pose.
    #[schemars(extend("format" = "path"))]
    pub model: String,
    /// Path of a recorded movement of the human, relative to the graph file. The channels of the movement
    /// must be the columns of the human's space. Default: poses arrive through the port `human`.
    #[serde(default)]
    #[schemars(extend("format" = "path"))]
    pub motion: Option<String>,
    /// Sample rate of a movement without time stamps, Hz. Required for such a movement.
    #[serde(default)]
    pub rate: Option<f64>,
    /// Behaviour after a movement: "once" stays at its end, "forever" starts the movement again.
    #[serde(default)]
    pub repeat: Repeat,
    /// Name of the model's space for each robot, by robot name. Default: the space with the robot's name.
    #[serde(default)]
    pub spaces: BTreeMap<String, String>,
    /// Time constant with which joints follow the prediction, 1 ms to 10 s. Default 80 ms.
    #[serde(default = "follow")]
    pub follow: TimeSpan,
    /// Age beyond which a human pose from the port `human` counts as stale, so that the robots hold. Default
    /// 200 ms.
    #[serde(default = "timeout")]
    pub timeout: TimeSpan,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Gains, easing and feed-forward of joint commands, the same for all robots.
    #[serde(default)]
    pub joint_command: JointCommandConfig,
}

fn follow() -> TimeSpan {
    TimeSpan { ns: 80_000_000 }
}

fn timeout() -> TimeSpan {
    TimeSpan { ns: 200_000_000 }
}

/// One robot of the component.
#[derive(Debug)]
pub(super) struct Mimic {
    pub(super) name: String,
    /// Index of its space in the model.
    pub(super) space: usize,
    pub(super) driven: CommandedJoints,
}

/// Everything that a configuration references, read and checked.
#[derive(Debug)]
pub(super) struct Loaded {
    pub(super) model: LatentModel,
    /// Index of the human's space.
    pub(super) human: usize,
    pub(super) motion: Option<Recording>,
    pub(super) mimics: Vec<Mimic>,
}

/// Reads and checks a configuration; `folder` is the graph file's.
pub(super) fn load(
    config: &LatentPolicyConfig,
    robots: &[RobotReference],
    folder: &Path,
) -> Result<Loaded, ConfigError> {
    let span = config.follow.as_secs_f64();
    if !(1e-3..=10.0).contains(&span) {
        return Err(ConfigError::key("follow", format!("{span} s, expected 1 ms to 10 s")));
    }
    if config.timeout.ns == 0 {
        return Err(ConfigError::key("timeout", "0 s, expected more than 0 s"));
    }
    let path = folder.join(&config.model);
    let model = LatentModel::load(&path)
        .map_err(|error| ConfigError::key("model", format!("{}: {error}", path.display())))?;
    let Some(human) = model.back_constrained() else {
        return Err(ConfigError::key(
            "model",
            "the latent points of the model are free, expected a function of the human's pose",
        )
        .advise("train it with `motorium latent train --back pose`"));
    };
    let names: Vec<String> = model.spaces().iter().map(|space| space.name.clone()).collect();
    let motion = config.motion.as_ref().map(|file| motion(&folder.join(file), config.rate, &human.columns));
    let motion = motion.transpose()?;
    if config.motion.is_none() && config.rate.is_some() {
        return Err(ConfigError::key("rate", "`rate` requires a `motion`"));
    }
    if human.columns.len() > motorium::state::MAX_OBSERVATION {
        let (found, most) = (human.columns.len(), motorium::state::MAX_OBSERVATION);
        return Err(ConfigError::key(
            "model",
            format!("a human with {found} columns, expected at most {most}"),
        ));
    }
    let human = model.space(&human.name).map_err(|error| ConfigError::new(error.to_string()))?;
    if robots.is_empty() {
        return Err(ConfigError::new("the component names no robots, expected at least one")
            .advise("add `robots = [\"NAME\"]` to the component"));
    }
    for name in config.spaces.keys() {
        if !robots.iter().any(|robot| robot.name == *name) {
            let known = robots.iter().map(|robot| robot.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(ConfigError::key(
                format!("spaces.{name}"),
                format!("the component has no robot `{name}`, expected one of {known}"),
            ));
        }
    }
    let mut mimics = Vec::new();
    for robot in robots {
        let name = config.spaces.get(&robot.name).unwrap_or(&robot.name);
        let key = if config.spaces.contains_key(&robot.name) {
            format!("spaces.{}", robot.name)
        } else {
            "model".to_string()
        };
        let Some(space) = names.iter().position(|known| known == name) else {
            let message = format!("the model has no space `{name}`, expected one of {}", names.join(", "));
            return Err(ConfigError::key(key, message)
                .advise(format!("add the space with `motorium latent transfer --robot {name}`")));
        };
        if space == human {
            return Err(ConfigError::key(
                key,
                format!("the space `{name}` is the human's, expected a robot's"),
            ));
        }
        let joints = model.spaces()[space].columns.iter().map(|name| (name.as_str(), key.clone()));
        let driven = CommandedJoints::new(&config.joint_command, config.gravity, Some(robot), joints)?;
        mimics.push(Mimic { name: robot.name.clone(), space, driven });
    }
    Ok(Loaded { model, human, motion, mimics })
}

fn motion(path: &Path, rate: Option<f64>, columns: &[String]) -> Result<Recording, ConfigError> {
    let selection = Selection { channels: columns.to_vec(), rate, ..Selection::default() };
    motorium_recordings::read(path, &selection).map_err(|error| ConfigError::key("motion", error.to_string()))
}

//! Validated planner settings, from the model and the profile of the robot.

use motorium::prelude::*;
use motorium::state::MAX_FEET;
use motorium_control::checks::{downward_gravity, in_range};
use motorium_control::inverse_dynamics::Contact;
use motorium_control::measured::load_robot;
use motorium_robots::{Foot, Loaded, Model};
use nalgebra::Vector3;

use super::config::{GaitConfig, GroundConfig, MpcConfig};
use crate::mpc::{
    Gait, GroundModel, Landing, LegPlanner, MpcSettings, PlannedFoot, PlannerSettings, Stepping,
};

/// A robot, its planner, and the names of its feet.
pub(super) struct MpcSetup {
    pub(super) model: Model,
    pub(super) names: Vec<String>,
    pub(super) planner: LegPlanner,
    /// Duration of the initial stance, s; infinite without a gait.
    pub(super) stand_for: f64,
}

impl MpcSetup {
    pub(super) fn new(config: &MpcConfig, robot: &RobotReference) -> Result<Self, ConfigError> {
        let Loaded { model, profile, .. } = load_robot(robot)?;
        if !model.base().floating {
            let message =
                format!("robot `{}` has a fixed base, which contact forces cannot move", robot.name);
            return Err(ConfigError::key("robot", message).advise("name a robot with a floating base"));
        }
        let profile = profile.filter(|profile| !profile.feet.is_empty()).ok_or_else(|| {
            let message = format!("robot `{}` has no feet: its profile has no [feet.NAME]", robot.name);
            ConfigError::key("robot", message).advise("add a table `[feet.NAME]` with `frame` for each foot")
        })?;
        if profile.feet.len() > MAX_FEET {
            let message = format!("{} feet, at most {MAX_FEET} fit", profile.feet.len());
            return Err(ConfigError::key("robot", message));
        }
        let mut feet = Vec::new();
        for (name, foot) in &profile.feet {
            feet.push(planned_foot(&model, name, foot, config)?);
        }
        let names: Vec<String> = profile.feet.keys().cloned().collect();
        let stepping = Stepping::new(gait(config.gait.as_ref(), &names)?);
        let settings = settings(config, &model)?;
        let rest = profile
            .configuration(&model, &profile.home)
            .map_err(|error| ConfigError::new(error.to_string()))?;
        let planner = LegPlanner::new(&model, feet, stepping, settings, rest.as_slice());
        let stand_for = config.gait.as_ref().map_or(f64::INFINITY, |gait| gait.stand_for.as_secs_f64());
        Ok(Self { model, names, planner, stand_for })
    }
}

fn planned_foot(
    model: &Model,
    name: &str,
    foot: &Foot,
    config: &MpcConfig,
) -> Result<PlannedFoot, ConfigError> {
    let contact = Contact::of_foot(model, name, foot).map_err(|error| ConfigError::new(error.to_string()))?;
    let friction = in_range("friction", config.friction.unwrap_or(contact.friction), 1e-3..=10.0)?;
    let points = match foot.sole {
        None => vec![Vector3::zeros()],
        Some([x, y]) => [(0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)]
            .map(|(along, across)| Vector3::new(along * x, across * y, 0.0))
            .to_vec(),
    };
    let radius = if foot.sole.is_some() { 0.0 } else { foot.radius.unwrap_or(0.0) };
    Ok(PlannedFoot { frame: contact.frame, points, radius, friction })
}

/// Returns the gait of these feet; without a configuration, a gait that never starts.
fn gait(config: Option<&GaitConfig>, names: &[String]) -> Result<Gait, ConfigError> {
    let Some(config) = config else {
        return Gait::new(1.0, 0.5, vec![0.0; names.len()])
            .map_err(|error| ConfigError::new(error.to_string()));
    };
    if let Some(unknown) = config.offsets.keys().find(|name| !names.contains(name)) {
        let message = format!("the robot has no foot `{unknown}`");
        return Err(ConfigError::key("gait.offsets", message).advise(format!("it has {}", names.join(", "))));
    }
    let offset = |name: &String| {
        config.offsets.get(name).copied().ok_or_else(|| {
            ConfigError::key("gait.offsets", format!("foot `{name}` has no offset"))
                .advise(format!("add an offset from 0 to 1, such as `{name} = 0.5`"))
        })
    };
    let offsets = names.iter().map(offset).collect::<Result<Vec<_>, _>>()?;
    in_range("gait.clearance", config.clearance, 0.0..=10.0)?;
    in_range("gait.max_capture", config.max_capture, 0.0..=10.0)?;
    Gait::new(config.period.as_secs_f64(), config.duty, offsets)
        .map_err(|error| ConfigError::key("gait", error.to_string()))
}

fn ground(config: GroundConfig) -> Result<GroundModel, ConfigError> {
    Ok(match config {
        GroundConfig::Level => GroundModel::Level,
        GroundConfig::Fitted(fitted) => GroundModel::Fitted { smoothing: fitted.smoothing.as_secs_f64() },
        GroundConfig::Normal(normal) => {
            let given = Vector3::from(normal);
            let unit = given.try_normalize(1e-9).filter(|unit| unit.z >= 0.5);
            GroundModel::Normal(unit.ok_or_else(|| {
                let message = format!(
                    "{normal:?}, expected a normal that points up, at most 60 degrees off the vertical"
                );
                ConfigError::key("ground.normal", message)
            })?)
        }
    })
}

fn settings(config: &MpcConfig, model: &Model) -> Result<PlannerSettings, ConfigError> {
    let gravity = downward_gravity(config.gravity)?;
    let horizon = &config.horizon;
    if !(1..=40).contains(&horizon.steps) {
        let message = format!("{} steps, expected 1 to 40", horizon.steps);
        return Err(ConfigError::key("horizon.steps", message));
    }
    let step = in_range("horizon.step", horizon.step.as_secs_f64(), 1e-3..=1.0)?;
    let weights = &config.weights;
    for (name, values) in [
        ("turn", weights.turn),
        ("position", weights.position),
        ("angular_velocity", weights.angular_velocity),
        ("velocity", weights.velocity),
    ] {
        for value in values {
            in_range(&format!("weights.{name}"), value, 0.0..=1e4)?;
        }
    }
    in_range("weights.force", weights.force, 1e-6..=1e4)?;
    for value in config.velocity {
        in_range("velocity", value, f64::MIN..=f64::MAX)?;
    }
    if config.gait.is_none() && config.velocity != [0.0; 3] {
        let error = ConfigError::key("velocity", "without a gait the robot stands on all its feet");
        return Err(error.advise("add `gait`, or leave `velocity` out"));
    }
    let height = config.height.map(|height| in_range("height", height, 1e-3..=f64::MAX)).transpose()?;
    let max_force = config.max_force.unwrap_or(2.0 * model.mass() * gravity);
    let gait = config.gait.as_ref();
    Ok(PlannerSettings {
        mpc: MpcSettings {
            mass: model.mass(),
            gravity: Vector3::new(0.0, 0.0, -gravity),
            steps: horizon.steps,
            step,
            max_force: in_range("max_force", max_force, 1e-3..=f64::MAX)?,
            weights: weights.weights(),
        },
        solve_every: config.solve_every.map_or(0.0, |time| time.as_secs_f64()),
        acceleration: in_range("acceleration", config.acceleration, 1e-3..=1000.0)?,
        height,
        max_lead: in_range("max_lead", config.max_lead, 1e-3..=10.0)?,
        max_turn: in_range("max_turn", config.max_turn, 1e-3..=3.0)?,
        clearance: gait.map_or(0.0, |gait| gait.clearance),
        max_capture: gait.map_or(0.0, |gait| gait.max_capture),
        ramp: gait.map_or(0.0, |gait| gait.ramp.as_secs_f64()),
        ground: ground(config.ground)?,
        landing: Landing {
            early_from: in_range("landing.early_from", config.landing.early_from, 0.0..=1.0)?,
            search_speed: in_range("landing.search_speed", config.landing.search_speed, 0.0..=10.0)?,
            search_for: config.landing.search_for.as_secs_f64(),
        },
    })
}

//! `policy.cpg`: legs (or any joints) that swing in a gait.

use motorium::component::{Component, ConfigError, ConfigureError, Declare, StepError, Tick};
use motorium::worker::{Parameter, Setup};
use schemars::JsonSchema;
use serde::Deserialize;

use super::drive::{DriveConfig, Driven, JointDrive};
use crate::cpg::{Entrainment, Gait, NetworkSettings, Node, PhaseNetwork};

/// Configuration of `policy.cpg`.
///
/// ```toml
/// gait = "walk"
/// frequency = 1.5
/// legs = [
///     { joints = [{ joint = "left_hip", amplitude = 0.4 }, { joint = "left_knee", amplitude = 0.3, phase = 1.57 }] },
///     { joints = [{ joint = "right_hip", amplitude = 0.4 }, { joint = "right_knee", amplitude = 0.3, phase = 1.57 }] },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpgPolicyConfig {
    /// Two, four or six legs, left before right, from the front to the rear.
    pub legs: Vec<LegConfig>,
    /// The gait to begin with.
    pub gait: Gait,
    /// Strides per second, Hz. Default 1.
    #[serde(default = "one")]
    pub frequency: f64,
    /// How fast joints fall into the gait, 1/s. Default 5.
    #[serde(default = "five")]
    pub coupling: f64,
    /// How the joints are driven.
    #[serde(default)]
    pub drive: DriveConfig,
}

/// One leg.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LegConfig {
    /// Its joints that swing, at least one.
    pub joints: Vec<SwingConfig>,
}

/// How a joint swings: `offset + amplitude cos(phase of the leg + phase)`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SwingConfig {
    /// Name of the joint.
    pub joint: String,
    /// Amplitude, rad or m.
    pub amplitude: f64,
    /// About which it swings, rad or m. Default 0.
    #[serde(default)]
    pub offset: f64,
    /// Ahead of the phase of its leg, rad. Default 0.
    #[serde(default)]
    pub phase: f64,
}

fn one() -> f64 {
    1.0
}

fn five() -> f64 {
    5.0
}

/// Swings the joints of legs by a phase-amplitude network; see [`PhaseNetwork`].
///
/// It begins with the first joint state, from where the robot is, and grows out of standing. Gait, frequency and amplitude
/// are parameters; every change is smooth. With `entrainment`, the measured joints draw the network along.
#[derive(Debug)]
pub struct CpgPolicy {
    drive: JointDrive,
    network: PhaseNetwork,
    legs: Vec<usize>,
    swings: Vec<SwingConfig>,
    pattern: Vec<f64>,
    pull: Vec<f64>,
    frequency: Parameter<f64>,
    amplitude: Parameter<f64>,
    gait: Parameter<i64>,
    entrainment: Parameter<f64>,
    number_of_legs: usize,
    walking: Option<Gait>,
    scale: f64,
    gait_changes: u64,
    strides: f64,
}

impl Component for CpgPolicy {
    const KIND: &'static str = "policy.cpg";
    const SUMMARY: &'static str = "swings joints in a gait by a central pattern generator";
    type Config = CpgPolicyConfig;

    fn declare(config: &CpgPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        network(config)?;
        let default = gait_number(config)?;
        driven(config, declare)?;
        let gaits = Gait::of(config.legs.len());
        Driven::declare(declare);
        declare.float("frequency", config.frequency, 0.0..=20.0, "Hz", "strides per second");
        declare.float("amplitude", 1.0, 0.0..=2.0, "", "factor of all amplitudes; 0 stands still");
        let names: Vec<String> =
            gaits.iter().enumerate().map(|(i, gait)| format!("{i} {}", name(*gait))).collect();
        let last = gaits.len() as i64 - 1;
        declare.integer("gait", default, 0..=last, &format!("the gait: {}", names.join(", ")));
        declare.float(
            "entrainment",
            0.0,
            0.0..=20.0,
            "rad/s",
            "how strongly the measured joints draw the phases along",
        );
        Ok(())
    }

    fn configure(config: CpgPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let network = network(&config)?;
        let nodes = network.nodes();
        let driven = Driven::new(&config.drive, Some(setup.robot()?), joints(&config))?;
        let legs = config.legs.iter().enumerate();
        Ok(Self {
            drive: JointDrive::new(driven, &config.drive, setup)?,
            legs: legs.flat_map(|(leg, config)| config.joints.iter().map(move |_| leg)).collect(),
            swings: config.legs.iter().flat_map(|leg| leg.joints.iter().cloned()).collect(),
            pattern: vec![0.0; nodes],
            pull: vec![0.0; nodes],
            frequency: setup.parameter("frequency")?,
            amplitude: setup.parameter("amplitude")?,
            gait: setup.parameter("gait")?,
            entrainment: setup.parameter("entrainment")?,
            number_of_legs: config.legs.len(),
            walking: None,
            scale: f64::NAN,
            gait_changes: 0,
            strides: 0.0,
            network,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.drive.read()? {
            return Ok(());
        }
        self.obey()?;
        let dt = tick.dt();
        let frequency = self.frequency.get();
        let gain = self.entrainment.get();
        // before the robot has gone over to the movement, what it does says nothing about it
        if gain > 0.0 && frequency > 0.0 && self.drive.is_eased_in() {
            let omega = std::f64::consts::TAU * frequency;
            let entrainment = Entrainment { gain, lead: 0.0 };
            for i in 0..self.pull.len() {
                let (q, v) = (self.drive.position(i), self.drive.speed(i));
                let measured = Entrainment::measured_phase(q, v, self.swings[i].offset, omega);
                self.pull[i] = entrainment.pull(measured, self.network.phases()[i]);
            }
        } else {
            self.pull.fill(0.0);
        }
        self.network.step_entrained(dt, &self.pull);
        self.strides += frequency * dt;
        self.drive.command(dt, self.network.output(), self.network.velocity())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "gait": self.walking.map(name),
            "gait_changes": self.gait_changes,
            "strides": self.strides,
            "pattern_error_rad": self.network.pattern_error(),
        }))
    }
}

impl CpgPolicy {
    /// Takes over the parameters.
    fn obey(&mut self) -> Result<(), StepError> {
        let refused = |_| StepError::failed("the pattern generator refused its parameters");
        self.network.set_frequency(self.frequency.get()).map_err(refused)?;
        let scale = self.amplitude.get();
        if scale != self.scale {
            for (node, swing) in self.swings.iter().enumerate() {
                self.network.set_swing(node, scale * swing.amplitude, swing.offset).map_err(refused)?;
            }
            self.scale = scale;
        }
        let gait = usize::try_from(self.gait.get()).ok();
        let gait = gait.and_then(|number| Gait::of(self.number_of_legs).get(number)).copied();
        if gait != self.walking
            && let Some(gait) = gait
        {
            let phases = gait
                .phases(self.number_of_legs)
                .map_err(|_| StepError::failed("a gait for another number of legs"))?;
            for (i, leg) in self.legs.iter().enumerate() {
                self.pattern[i] = phases[*leg] + self.swings[i].phase;
            }
            self.network.set_pattern(&self.pattern).map_err(refused)?;
            self.gait_changes += u64::from(self.walking.is_some());
            self.walking = Some(gait);
        }
        Ok(())
    }
}

fn name(gait: Gait) -> &'static str {
    match gait {
        Gait::Walk => "walk",
        Gait::Trot => "trot",
        Gait::Pace => "pace",
        Gait::Bound => "bound",
        Gait::Tripod => "tripod",
    }
}

fn joints(config: &CpgPolicyConfig) -> impl Iterator<Item = (&str, String)> {
    config.legs.iter().enumerate().flat_map(|(l, leg)| {
        let named = move |(j, swing): (usize, _)| {
            let swing: &SwingConfig = swing;
            (swing.joint.as_str(), format!("legs[{l}].joints[{j}].joint"))
        };
        leg.joints.iter().enumerate().map(named)
    })
}

fn driven(config: &CpgPolicyConfig, declare: &Declare) -> Result<Driven, ConfigError> {
    Driven::new(&config.drive, declare.robot(), joints(config))
}

fn gait_number(config: &CpgPolicyConfig) -> Result<i64, ConfigError> {
    let legs = config.legs.len();
    let number = Gait::of(legs).iter().position(|gait| *gait == config.gait);
    match (number, config.gait.phases(legs)) {
        (Some(number), _) => Ok(number as i64),
        (None, Err(error)) => Err(ConfigError::key("gait", error.to_string())),
        (None, Ok(_)) => Err(ConfigError::key("gait", "this number of legs does not have it")),
    }
}

fn network(config: &CpgPolicyConfig) -> Result<PhaseNetwork, ConfigError> {
    gait_number(config)?;
    let legs = config.legs.len();
    let phases = config.gait.phases(legs).map_err(|error| ConfigError::key("gait", error.to_string()))?;
    let mut nodes = Vec::new();
    for (l, (leg, phase)) in config.legs.iter().zip(phases).enumerate() {
        if leg.joints.is_empty() {
            return Err(ConfigError::key(format!("legs[{l}].joints"), "a leg without a joint that swings"));
        }
        for (j, swing) in leg.joints.iter().enumerate() {
            if let Some(value) =
                [swing.amplitude, swing.offset, swing.phase].into_iter().find(|value| !value.is_finite())
            {
                return Err(ConfigError::key(
                    format!("legs[{l}].joints[{j}]"),
                    format!("{value} is no number to work with"),
                ));
            }
            let (amplitude, offset) = (swing.amplitude, swing.offset);
            nodes.push(Node { amplitude, offset, phase: phase + swing.phase });
        }
    }
    if !(config.coupling.is_finite() && config.coupling >= 0.0) {
        let message = format!("{}: expected a finite number of at least 0", config.coupling);
        return Err(ConfigError::key("coupling", message));
    }
    if !(0.0..=20.0).contains(&config.frequency) {
        return Err(ConfigError::key("frequency", format!("{} Hz, expected from 0 to 20", config.frequency)));
    }
    let weights = PhaseNetwork::all_to_all(&nodes, config.coupling);
    let settings = NetworkSettings { frequency: config.frequency, ..NetworkSettings::default() };
    PhaseNetwork::new(&nodes, weights, settings).map_err(|error| ConfigError::new(error.to_string()))
}

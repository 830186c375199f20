//! `policy.cpg`: legs (or any joints) that move in a gait.

mod config;
mod generator;

pub use config::{CpgModel, CpgPolicyConfig, HopfConfig, JointOscillationConfig, LegConfig, MatsuokaConfig};

use core::f64::consts::PI;

use motorium::component::{Choice, Component, ConfigureError, Episode, ParameterArray, Setup, Tick};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::transport::Parameter;

use crate::joint_command::{CommandedJoints, JointCommandWriter};
use config::{DUTY_FACTOR, FREQUENCY};
use generator::Generator;
use motorium_primitives::cpg::Gait;

/// A policy that moves the joints of legs with a phase-amplitude network
/// ([`PhaseNetwork`](motorium_primitives::cpg::PhaseNetwork)) or with Hopf, Matsuoka or Kuramoto oscillators
/// ([`OscillatorNetwork`](motorium_primitives::cpg::OscillatorNetwork)).
///
/// The movement starts with the first joint state, in the robot's current pose, and grows smoothly from rest.
/// Gait, frequency and amplitude (and the duty factor of Hopf oscillators) are parameters; every change is
/// smooth. With `entrainment`, the measured joints influence the rhythm.
#[derive(Debug)]
pub struct CpgPolicy {
    writer: JointCommandWriter,
    generator: Generator,
    /// The generator as configured.
    start: Generator,
    pull: Vec<f64>,
    frequency: Parameter<f64>,
    amplitude: Parameter<f64>,
    gait: Parameter<Choice>,
    phase_offsets: ParameterArray,
    /// Last applied offsets, and the phases of the legs that include them, rad.
    offsets: Vec<f64>,
    phases: Vec<f64>,
    entrainment: Parameter<f64>,
    duty_factor: Option<Parameter<f64>>,
    number_of_legs: usize,
    model: CpgModel,
    walking: Option<Gait>,
    scale: f64,
    gait_changes: u64,
    strides: f64,
}

impl Component for CpgPolicy {
    const KIND: &'static str = "policy.cpg";
    const SUMMARY: &'static str = "moves joints in a gait by a central pattern generator";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = CpgPolicyConfig;

    fn declare(config: &CpgPolicyConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        check_gait(config)?;
        generator(config)?;
        CommandedJoints::new(&config.joint_command, config.gravity, declare.robot(), joints(config))?;
        let gaits = Gait::for_legs(config.legs.len());
        CommandedJoints::declare(declare);
        declare.float("frequency", config.frequency, FREQUENCY, "Hz", "strides per second");
        declare.float("amplitude", 1.0, 0.0..=2.0, "", "factor of all amplitudes; 0 stands still");
        let names: Vec<&str> = gaits.iter().map(|gait| gait.name()).collect();
        declare.choice("gait", &names, config.gait.name(), "the gait");
        let offsets = vec![0.0; config.legs.len()];
        declare.array(
            "phase_offsets",
            &offsets,
            -PI..=PI,
            "rad",
            "added to the phase of each leg in the gait",
        );
        declare.float(
            "entrainment",
            0.0,
            0.0..=20.0,
            "rad/s",
            "gain with which the measured joints entrain the phases",
        );
        if config.model == CpgModel::Hopf {
            let default = config.duty_factor();
            declare.float("duty_factor", default, DUTY_FACTOR, "", "share of a stride that is stance");
        }
        Ok(())
    }

    fn configure(config: CpgPolicyConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let generator = generator(&config)?;
        let driven = CommandedJoints::new(
            &config.joint_command,
            config.gravity,
            Some(setup.robot()?),
            joints(&config),
        )?;
        let duty_factor = (config.model == CpgModel::Hopf).then(|| setup.parameter("duty_factor"));
        Ok(Self {
            writer: JointCommandWriter::new(driven, &config.joint_command, setup)?,
            pull: vec![0.0; generator.joints()],
            frequency: setup.parameter("frequency")?,
            amplitude: setup.parameter("amplitude")?,
            gait: setup.parameter("gait")?,
            phase_offsets: setup.parameter_array("phase_offsets")?,
            offsets: vec![0.0; config.legs.len()],
            phases: vec![0.0; config.legs.len()],
            entrainment: setup.parameter("entrainment")?,
            duty_factor: duty_factor.transpose()?,
            number_of_legs: config.legs.len(),
            model: config.model,
            walking: None,
            scale: f64::NAN,
            gait_changes: 0,
            strides: 0.0,
            start: generator.clone(),
            generator,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        if !self.writer.read()? {
            return Ok(());
        }
        self.apply_parameters()?;
        let dt = tick.dt();
        let gain = self.entrainment.get();
        // until the robot has eased into the movement, its motion carries no information about it
        if gain > 0.0 && self.writer.is_eased_in() {
            for (joint, pull) in self.pull.iter_mut().enumerate() {
                let (q, v) = (self.writer.position(joint), self.writer.speed(joint));
                *pull = self.generator.pull(joint, q, v, gain);
            }
        } else {
            self.pull.fill(0.0);
        }
        self.generator.step(dt, &self.pull);
        self.strides += self.frequency.get() * dt;
        self.writer.command(dt, self.generator.output(), self.generator.velocity())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        self.writer.reset();
        self.generator = self.start.clone();
        (self.walking, self.scale, self.gait_changes, self.strides) = (None, f64::NAN, 0, 0.0);
        self.offsets.fill(0.0);
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "model": self.model.name(),
            "gait": self.walking.map(Gait::name),
            "gait_changes": self.gait_changes,
            "strides": self.strides,
            "pattern_error_rad": self.generator.gait_error(),
        }))
    }
}

impl CpgPolicy {
    /// Applies the current values of the parameters.
    fn apply_parameters(&mut self) -> Result<(), StepError> {
        let refused = |_| StepError::failed("a parameter of the pattern generator is out of range");
        self.generator.set_frequency(self.frequency.get()).map_err(refused)?;
        if let Some(duty_factor) = &self.duty_factor {
            self.generator.set_duty_factor(duty_factor.get()).map_err(refused)?;
        }
        let scale = self.amplitude.get();
        if scale != self.scale {
            self.generator.set_scale(scale).map_err(refused)?;
            self.scale = scale;
        }
        let Some(gait) = Gait::for_legs(self.number_of_legs).get(self.gait.get().index()).copied() else {
            return Ok(());
        };
        let moved =
            self.offsets.iter().zip(self.phase_offsets.iter()).any(|(applied, offset)| *applied != offset);
        if self.walking == Some(gait) && !moved {
            return Ok(());
        }
        let phases =
            gait.phases(self.number_of_legs).map_err(|error| StepError::failed(error.to_string()))?;
        for (leg, offset) in self.phase_offsets.iter().enumerate() {
            self.offsets[leg] = offset;
            self.phases[leg] = phases[leg] + offset;
        }
        self.generator.set_gait(&self.phases).map_err(refused)?;
        self.gait_changes += u64::from(self.walking.is_some_and(|walking| walking != gait));
        self.walking = Some(gait);
        Ok(())
    }
}

fn joints(config: &CpgPolicyConfig) -> impl Iterator<Item = (&str, String)> {
    config.legs.iter().enumerate().flat_map(|(l, leg)| {
        let named = move |(j, oscillation): (usize, _)| {
            let oscillation: &JointOscillationConfig = oscillation;
            (oscillation.joint.as_str(), format!("legs[{l}].joints[{j}].joint"))
        };
        leg.joints.iter().enumerate().map(named)
    })
}

fn check_gait(config: &CpgPolicyConfig) -> Result<(), ConfigError> {
    let legs = config.legs.len();
    match (Gait::for_legs(legs).contains(&config.gait), config.gait.phases(legs)) {
        (true, _) => Ok(()),
        (false, Err(error)) => Err(ConfigError::key("gait", error.to_string())),
        (false, Ok(_)) => Err(ConfigError::key("gait", "this gait is not defined for this number of legs")),
    }
}

fn generator(config: &CpgPolicyConfig) -> Result<Generator, ConfigError> {
    config.check()?;
    let phases = config.gait.phases(config.legs.len());
    Generator::new(config, phases.map_err(|error| ConfigError::key("gait", error.to_string()))?)
}

//! The pattern generator of the policy, independent of the model.

use motorium::declare::ConfigError;

use super::config::{CpgModel, CpgPolicyConfig};
use motorium_primitives::cpg::{
    CpgError, Entrainment, JointOscillation, NetworkSettings, Node, OscillatorNetwork,
    OscillatorNetworkSettings, PhaseNetwork,
};

/// A phase-amplitude network or an oscillator network, with the setpoints of all joints and their rates.
#[derive(Debug, Clone)]
pub(super) struct Generator {
    model: Model,
    oscillations: Vec<JointOscillation>,
    /// Phase of every joint in the gait.
    pattern: Vec<f64>,
    frequency: f64,
}

#[derive(Debug, Clone)]
enum Model {
    Phase(Box<PhaseNetwork>),
    Oscillators(Box<OscillatorNetwork>),
}

impl Generator {
    /// Creates the generator from a checked config and the phases of the legs in its gait.
    pub(super) fn new(config: &CpgPolicyConfig, gait: &[f64]) -> Result<Self, ConfigError> {
        let legs = config.legs.iter().enumerate();
        let oscillations: Vec<JointOscillation> = legs
            .flat_map(|(leg, config)| config.joints.iter().map(move |oscillation| (leg, oscillation)))
            .map(|(leg, oscillation)| JointOscillation {
                leg,
                amplitude: oscillation.amplitude,
                offset: oscillation.offset,
                phase: oscillation.phase,
            })
            .collect();
        let model = match config.oscillator() {
            None => {
                let nodes: Vec<Node> = oscillations
                    .iter()
                    .map(|oscillation| Node {
                        amplitude: oscillation.amplitude,
                        offset: oscillation.offset,
                        phase: gait[oscillation.leg] + oscillation.phase,
                    })
                    .collect();
                let weights = PhaseNetwork::all_to_all(&nodes, config.coupling);
                let settings = NetworkSettings { frequency: config.frequency, ..NetworkSettings::default() };
                PhaseNetwork::new(&nodes, weights, settings).map(|network| Model::Phase(Box::new(network)))
            }
            Some(oscillator) => {
                let settings = OscillatorNetworkSettings {
                    frequency: config.frequency,
                    coupling: config.coupling,
                    duty_factor: config.duty_factor(),
                    ..OscillatorNetworkSettings::default()
                };
                OscillatorNetwork::new(oscillator, &oscillations, gait, settings)
                    .map(|rhythm| Model::Oscillators(Box::new(rhythm)))
            }
        };
        let refused = |error: CpgError| match config.model {
            CpgModel::Hopf | CpgModel::Matsuoka => ConfigError::key(config.model.name(), error.to_string()),
            CpgModel::Phase | CpgModel::Kuramoto => ConfigError::new(error.to_string()),
        };
        let pattern = vec![0.0; oscillations.len()];
        Ok(Self { model: model.map_err(refused)?, oscillations, pattern, frequency: config.frequency })
    }

    /// Returns the number of joints.
    pub(super) fn joints(&self) -> usize {
        self.oscillations.len()
    }

    pub(super) fn set_frequency(&mut self, frequency: f64) -> Result<(), CpgError> {
        self.frequency = frequency;
        match &mut self.model {
            Model::Phase(network) => network.set_frequency(frequency),
            Model::Oscillators(rhythm) => rhythm.set_frequency(frequency),
        }
    }

    pub(super) fn set_duty_factor(&mut self, duty_factor: f64) -> Result<(), CpgError> {
        match &mut self.model {
            Model::Phase(_) => Ok(()),
            Model::Oscillators(rhythm) => rhythm.set_duty_factor(duty_factor),
        }
    }

    /// Scales all amplitudes relative to the configured ones.
    pub(super) fn set_scale(&mut self, scale: f64) -> Result<(), CpgError> {
        for (joint, oscillation) in self.oscillations.iter().enumerate() {
            let amplitude = scale * oscillation.amplitude;
            match &mut self.model {
                Model::Phase(network) => {
                    network.set_amplitude_offset(joint, amplitude, oscillation.offset)?
                }
                Model::Oscillators(rhythm) => {
                    rhythm.set_amplitude_offset(joint, amplitude, oscillation.offset)?
                }
            }
        }
        Ok(())
    }

    /// Sets the phases of the legs.
    pub(super) fn set_gait(&mut self, gait: &[f64]) -> Result<(), CpgError> {
        match &mut self.model {
            Model::Phase(network) => {
                for (phase, oscillation) in self.pattern.iter_mut().zip(&self.oscillations) {
                    *phase = gait[oscillation.leg] + oscillation.phase;
                }
                network.set_pattern(&self.pattern)
            }
            Model::Oscillators(rhythm) => rhythm.set_gait(gait),
        }
    }

    /// Returns the entrainment of a joint's oscillator by its measured position and velocity, rad/s.
    pub(super) fn pull(&self, joint: usize, position: f64, velocity: f64, gain: f64) -> f64 {
        match &self.model {
            Model::Phase(network) if self.frequency > 0.0 => {
                let omega = std::f64::consts::TAU * self.frequency;
                let measured =
                    Entrainment::measured_phase(position, velocity, self.oscillations[joint].offset, omega);
                Entrainment { gain, lead: 0.0 }.pull(measured, network.phases()[joint])
            }
            Model::Phase(_) => 0.0,
            Model::Oscillators(rhythm) => rhythm.pull(joint, position, velocity, gain),
        }
    }

    pub(super) fn step(&mut self, dt: f64, pull: &[f64]) {
        match &mut self.model {
            Model::Phase(network) => network.step_entrained(dt, pull),
            Model::Oscillators(rhythm) => rhythm.step_entrained(dt, pull),
        }
    }

    /// Returns the setpoints of all joints.
    pub(super) fn output(&self) -> &[f64] {
        match &self.model {
            Model::Phase(network) => network.output(),
            Model::Oscillators(rhythm) => rhythm.output(),
        }
    }

    /// Returns the rates of the setpoints, per second.
    pub(super) fn velocity(&self) -> &[f64] {
        match &self.model {
            Model::Phase(network) => network.velocity(),
            Model::Oscillators(rhythm) => rhythm.velocity(),
        }
    }

    /// Returns the largest deviation of a phase from the gait, rad.
    pub(super) fn gait_error(&self) -> f64 {
        match &self.model {
            Model::Phase(network) => network.pattern_error(),
            Model::Oscillators(rhythm) => rhythm.gait_error(),
        }
    }
}

//! The `config` table of `policy.cpg`.

use motorium::declare::ConfigError;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::joint_command::{JointCommandConfig, earth};
use motorium_primitives::cpg::{Gait, HopfSettings, MatsuokaSettings, Oscillator, OscillatorNetworkSettings};

/// Configuration of `policy.cpg`.
///
/// ```toml
/// gait = "walk"
/// frequency = 1.5
/// legs = [
///     { joints = [
///         { joint = "left_hip_pitch", amplitude = 0.4 },
///         { joint = "left_knee", amplitude = 0.3, phase = 1.57 },
///     ] },
///     { joints = [
///         { joint = "right_hip_pitch", amplitude = 0.4 },
///         { joint = "right_knee", amplitude = 0.3, phase = 1.57 },
///     ] },
/// ]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CpgPolicyConfig {
    /// Two, four or six legs, left before right, from the front to the rear.
    pub legs: Vec<LegConfig>,
    /// Initial gait.
    pub gait: Gait,
    /// Oscillator model. Default "phase".
    #[serde(default)]
    pub model: CpgModel,
    /// Stride frequency, Hz. Default 1.
    #[serde(default = "one")]
    pub frequency: f64,
    /// Rate at which joints converge to the gait, 1/s. Default 5.
    #[serde(default = "five")]
    pub coupling: f64,
    /// Parameters of the oscillator model "hopf".
    #[serde(default)]
    pub hopf: Option<HopfConfig>,
    /// Parameters of the oscillator model "matsuoka".
    #[serde(default)]
    pub matsuoka: Option<MatsuokaConfig>,
    /// Gravity in the world frame, m/s^2. Default: gravity of the graph's world, or 9.81 downwards.
    #[serde(default = "earth")]
    pub gravity: [f64; 3],
    /// Gains, easing and feed-forward of joint commands.
    #[serde(default)]
    pub joint_command: JointCommandConfig,
}

/// Model of the oscillators.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CpgModel {
    /// A phase-amplitude network with one node per joint (Ijspeert).
    #[default]
    Phase,
    /// One Hopf oscillator per leg, with separate speeds for swing and stance (Righetti and Ijspeert).
    Hopf,
    /// A pair of mutually inhibiting neurons per joint (Matsuoka).
    Matsuoka,
    /// One phase oscillator per leg (Kuramoto).
    Kuramoto,
}

/// Parameters of Hopf oscillators.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HopfConfig {
    /// Rate of convergence to the limit cycle, 1/s. Default 8.
    pub convergence: f64,
    /// Sharpness of the transition between swing and stance. Default 50.
    pub sharpness: f64,
    /// Fraction of a stride spent in stance, 0.05 to 0.95. Default 0.5.
    pub duty_factor: f64,
}

impl Default for HopfConfig {
    fn default() -> Self {
        let HopfSettings { convergence, sharpness, .. } = HopfSettings::default();
        Self { convergence, sharpness, duty_factor: OscillatorNetworkSettings::default().duty_factor }
    }
}

/// Parameters of Matsuoka neurons.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MatsuokaConfig {
    /// Strength of fatigue, `beta`. Default 2.5.
    pub fatigue: f64,
    /// Mutual inhibition `w` of the two neurons, more than `1 + time_ratio`, less than `1 + fatigue`. Default
    /// 2.2.
    pub inhibition: f64,
    /// Ratio of rise time to fatigue time, `tau_1 / tau_2`. Both times are scaled to the frequency. Default
    /// 0.5.
    pub time_ratio: f64,
}

impl Default for MatsuokaConfig {
    fn default() -> Self {
        let MatsuokaSettings { fatigue, rise_time, fatigue_time, .. } = MatsuokaSettings::default();
        Self { fatigue, inhibition: 2.2, time_ratio: rise_time / fatigue_time }
    }
}

/// Oscillating joints of one leg.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LegConfig {
    /// Oscillating joints of the leg, at least one.
    pub joints: Vec<JointOscillationConfig>,
}

/// Oscillation of a joint: `offset + amplitude cos(phase of the leg + phase)`. Oscillator models other than
/// "phase" replace the cosine by their waveform.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointOscillationConfig {
    /// Name of the joint.
    pub joint: String,
    /// Amplitude of the oscillation, rad or m.
    pub amplitude: f64,
    /// Centre of the oscillation, rad or m. Default 0.
    #[serde(default)]
    pub offset: f64,
    /// Phase lead over the leg, rad. Default 0.
    #[serde(default)]
    pub phase: f64,
}

fn one() -> f64 {
    1.0
}

fn five() -> f64 {
    5.0
}

/// Range of the frequency, Hz.
pub(super) const FREQUENCY: std::ops::RangeInclusive<f64> = 0.0..=20.0;
/// Range of the duty factor.
pub(super) const DUTY_FACTOR: std::ops::RangeInclusive<f64> = 0.05..=0.95;

impl CpgPolicyConfig {
    /// Checks the numbers that no model checks, and rejects tables for other models.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        for (l, leg) in self.legs.iter().enumerate() {
            if leg.joints.is_empty() {
                return Err(ConfigError::key(
                    format!("legs[{l}].joints"),
                    "the leg has no joints, expected at least one",
                ));
            }
            for (j, oscillation) in leg.joints.iter().enumerate() {
                let all = [oscillation.amplitude, oscillation.offset, oscillation.phase];
                if let Some(value) = all.into_iter().find(|value| !value.is_finite()) {
                    let key = format!("legs[{l}].joints[{j}]");
                    return Err(ConfigError::key(key, format!("{value}, expected a finite number")));
                }
            }
        }
        if !(self.coupling.is_finite() && self.coupling >= 0.0) {
            let message = format!("{}: expected a finite number of at least 0", self.coupling);
            return Err(ConfigError::key("coupling", message));
        }
        if !FREQUENCY.contains(&self.frequency) {
            let message = format!("{} Hz, expected 0 to 20", self.frequency);
            return Err(ConfigError::key("frequency", message));
        }
        let other = |given: bool, model, key: &str| {
            (given && self.model != model).then(|| {
                ConfigError::key(
                    key,
                    format!("`model` is \"{}\", which does not use these settings", self.model.name()),
                )
                .advise(format!("set `model = \"{key}\"`, or remove `{key}`"))
            })
        };
        let hopf = other(self.hopf.is_some(), CpgModel::Hopf, "hopf");
        match hopf.or_else(|| other(self.matsuoka.is_some(), CpgModel::Matsuoka, "matsuoka")) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }

    /// Returns the fraction of a stride that is stance.
    pub(super) fn duty_factor(&self) -> f64 {
        self.hopf.unwrap_or_default().duty_factor
    }

    /// Returns the oscillators; `None` for the phase-amplitude network.
    pub(super) fn oscillator(&self) -> Option<Oscillator> {
        Some(match self.model {
            CpgModel::Phase => return None,
            CpgModel::Kuramoto => Oscillator::Kuramoto,
            CpgModel::Hopf => {
                let HopfConfig { convergence, sharpness, .. } = self.hopf.unwrap_or_default();
                Oscillator::Hopf(HopfSettings { convergence, sharpness, ..HopfSettings::default() })
            }
            CpgModel::Matsuoka => {
                let MatsuokaConfig { fatigue, inhibition, time_ratio } = self.matsuoka.unwrap_or_default();
                let usual = MatsuokaSettings::default();
                let settings =
                    MatsuokaSettings { fatigue, rise_time: time_ratio * usual.fatigue_time, ..usual };
                Oscillator::Matsuoka { settings, inhibition }
            }
        })
    }
}

impl CpgModel {
    /// Returns the name in configurations.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Phase => "phase",
            Self::Hopf => "hopf",
            Self::Matsuoka => "matsuoka",
            Self::Kuramoto => "kuramoto",
        }
    }
}

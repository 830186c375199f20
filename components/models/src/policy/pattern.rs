//! Description of a pattern generator that the action of a policy commands.

use serde::{Deserialize, Serialize};

use super::{Action, ActionKind, PolicyError};

/// A central pattern generator between the network and the drives: joints oscillate in a gait, and the action
/// commands the centre of each joint's oscillation. Two additional outputs command the frequency and the
/// amplitude: the bounds `action.clip` of these outputs are mapped to the ends of the ranges `frequency` and
/// `amplitude`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Pattern {
    /// Name of the gait, as in `policy.cpg`.
    pub gait: String,
    /// Range of the stride frequency \[Hz\], 0 to 20.
    pub frequency: [f64; 2],
    /// Range of the factor of all amplitudes, 0 to 2.
    pub amplitude: [f64; 2],
    /// Rate at which joints converge to the gait \[1/s\], at least 0. Default: 5.
    #[serde(default = "five")]
    pub coupling: f64,
    /// Oscillating joints of each leg, with the legs in the order of the gait. All oscillating joints must be
    /// joints of the action.
    pub legs: Vec<Vec<PatternJoint>>,
}

/// Oscillation of a joint: `centre + amplitude cos(phase of the leg + phase)`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct PatternJoint {
    /// Name of the joint.
    pub joint: String,
    /// Amplitude of the oscillation \[rad or m\].
    pub amplitude: f64,
    /// Phase lead relative to the leg \[rad\]. Default: 0.
    #[serde(default)]
    pub phase: f64,
}

fn five() -> f64 {
    5.0
}

impl Pattern {
    /// Number of additional outputs after the outputs of the joints: frequency and amplitude.
    pub const OUTPUTS: usize = 2;

    /// Returns the frequency \[Hz\] and the amplitude factor commanded by the additional `outputs`, which are
    /// within the bounds `clip`.
    pub fn parameters(&self, outputs: [f64; Self::OUTPUTS], clip: [f64; 2]) -> [f64; Self::OUTPUTS] {
        let value = |output: f64, range: [f64; 2]| {
            let share = (output - clip[0]) / (clip[1] - clip[0]);
            range[0] + share * (range[1] - range[0])
        };
        [value(outputs[0], self.frequency), value(outputs[1], self.amplitude)]
    }

    pub(super) fn check(&self, action: &Action) -> Result<(), PolicyError> {
        let wrong =
            |key: &str, message: String| Err(PolicyError::Value { key: format!("pattern.{key}"), message });
        if action.clip.is_none() {
            let (key, message) = ("action.clip".to_owned(), "missing, but required for a pattern".to_owned());
            return Err(PolicyError::Value { key, message });
        }
        if action.kind != ActionKind::Position {
            let key = "action.kind".to_owned();
            return Err(PolicyError::Value { key, message: "expected position for a pattern".to_owned() });
        }
        for (key, [low, high], most) in
            [("frequency", self.frequency, 20.0), ("amplitude", self.amplitude, 2.0)]
        {
            if !(0.0 <= low && low <= high && high <= most) {
                let message =
                    format!("found [{low}, {high}], expected a lower and a higher value, 0 to {most}");
                return wrong(key, message);
            }
        }
        if !(self.coupling >= 0.0 && self.coupling.is_finite()) {
            return wrong("coupling", format!("found {}, expected at least 0", self.coupling));
        }
        let joints: Vec<&PatternJoint> = self.legs.iter().flatten().collect();
        for (index, PatternJoint { joint, amplitude, phase }) in joints.iter().copied().enumerate() {
            if !action.joints.contains(joint) {
                return wrong("legs", format!("found \"{joint}\", expected a joint of the action"));
            }
            if joints[..index].iter().any(|other| other.joint == *joint) {
                return wrong("legs", format!("found \"{joint}\" twice, expected each joint once"));
            }
            if !(amplitude.is_finite() && phase.is_finite()) {
                return wrong("legs", format!("found {amplitude} and {phase}, expected finite numbers"));
            }
        }
        Ok(())
    }
}

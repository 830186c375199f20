//! Actions that are velocities of a wheeled base.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::PolicyError;

/// Ranges of a base twist, in the axes of the base. The network has one output for each given range, in the
/// order of the fields. An output of -1 commands the lower end of the range, and an output of 1 commands the
/// upper end. Velocities without a range are 0.
///
/// ```
/// use motorium_models::policy::TwistRanges;
///
/// let ranges = TwistRanges { forward: Some([-0.1, 0.5]), left: None, turn: Some([-2.0, 2.0]) };
/// assert_eq!(ranges.outputs(), 2);
/// assert_eq!(ranges.twist(&[0.0, -0.5]), [0.2, 0.0, -1.0]);
/// assert_eq!(ranges.twist(&[7.0, -7.0]), [0.5, 0.0, -2.0]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TwistRanges {
    /// Range of the forward velocity \[m/s\]. Default: not commanded.
    #[serde(default)]
    pub forward: Option<[f64; 2]>,
    /// Range of the velocity to the left \[m/s\], for a base with mecanum wheels or with pose joints.
    /// Default: not commanded.
    #[serde(default)]
    pub left: Option<[f64; 2]>,
    /// Range of the yaw rate, positive to the left \[rad/s\]. Default: not commanded.
    #[serde(default)]
    pub turn: Option<[f64; 2]>,
}

impl TwistRanges {
    /// Bounds of the network's outputs for a base twist.
    pub const BOUNDS: [f64; 2] = [-1.0, 1.0];

    /// Returns the ranges of the forward velocity, the velocity to the left \[m/s\] and the yaw rate
    /// \[rad/s\].
    pub fn axes(&self) -> [Option<[f64; 2]>; 3] {
        [self.forward, self.left, self.turn]
    }

    /// Returns the number of the network's outputs.
    pub fn outputs(&self) -> usize {
        self.axes().iter().flatten().count()
    }

    /// Returns the commanded motion of the base: forward velocity, velocity to the left \[m/s\] and yaw rate
    /// \[rad/s\].
    ///
    /// # Panics
    ///
    /// If `action` has fewer entries than [`outputs`](Self::outputs).
    pub fn twist(&self, action: &[f64]) -> [f64; 3] {
        let mut outputs = 0;
        self.axes().map(|range| {
            let Some([low, high]) = range else { return 0.0 };
            let [least, most] = Self::BOUNDS;
            let output = action[outputs].clamp(least, most);
            outputs += 1;
            output.mul_add(0.5 * (high - low), 0.5 * (high + low))
        })
    }

    /// Checks the ranges. Keys in errors start with `key`.
    pub(super) fn check(&self, key: &str) -> Result<(), PolicyError> {
        let wrong = |key: String, message: String| Err(PolicyError::Value { key, message });
        if self.outputs() == 0 {
            return wrong(key.to_owned(), "found no range, expected `forward`, `left` or `turn`".to_owned());
        }
        for (name, range) in ["forward", "left", "turn"].into_iter().zip(self.axes()) {
            if let Some([low, high]) = range
                && !(low < high && low.is_finite() && high.is_finite())
            {
                let message = format!("found [{low}, {high}], expected a lower and a higher velocity");
                return wrong(format!("{key}.{name}"), message);
            }
        }
        Ok(())
    }
}

//! Friction of a contact between two surfaces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::World;

/// Rule for combining the friction coefficients of two surfaces in contact.
///
/// For surfaces with different rules, the later one in the order `mean`, `min`, `multiply`, `max` applies.
///
/// ```
/// use motorium_robots::FrictionCombine;
///
/// let (ice, rubber) = ((0.05, Some(FrictionCombine::Min)), (0.9, None));
/// assert_eq!(FrictionCombine::combined(ice, rubber), 0.05);
/// // A surface with a friction of 0 slides on everything that has no rule.
/// assert_eq!(FrictionCombine::combined((0.0, None), rubber), 0.0);
/// assert_eq!(FrictionCombine::combined((0.5, None), rubber), 0.7);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrictionCombine {
    /// The mean of both coefficients: the default of surfaces with friction.
    Mean,
    /// The smaller coefficient.
    Min,
    /// The product of both. With a friction of 0, the default rule; the surface then slides on any other.
    Multiply,
    /// The larger coefficient.
    Max,
}

impl FrictionCombine {
    /// The rule of a surface with this coefficient of friction: `stated`, or its default.
    pub fn of_surface(friction: f64, stated: Option<Self>) -> Self {
        stated.unwrap_or(if friction > 0.0 { Self::Mean } else { Self::Multiply })
    }

    /// Coefficient of friction of a contact between two surfaces, each with its coefficient and its stated
    /// rule.
    pub fn combined((a, rule_a): (f64, Option<Self>), (b, rule_b): (f64, Option<Self>)) -> f64 {
        match Self::of_surface(a, rule_a).max(Self::of_surface(b, rule_b)) {
            Self::Mean => 0.5 * (a + b),
            Self::Min => a.min(b),
            Self::Multiply => a * b,
            Self::Max => a.max(b),
        }
    }
}

impl World {
    /// Gives all surfaces this rule, unless they have the same coefficient, and with it the same friction
    /// under every rule but `multiply`.
    pub(crate) fn combine_frictions(&mut self, rule: FrictionCombine) {
        let all = || {
            let objects = self.objects.iter().map(|object| object.friction);
            self.ground.iter().map(|ground| ground.friction).chain(objects)
        };
        if all().zip(all().skip(1)).all(|(one, other)| one == other) {
            return;
        }
        self.ground.iter_mut().for_each(|ground| ground.friction_combine = Some(rule));
        self.objects.iter_mut().for_each(|object| object.friction_combine = Some(rule));
    }
}

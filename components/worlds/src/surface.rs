//! Surfaces in contact: combination of friction coefficients, softness, and direction-dependent friction.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rule for combining the friction coefficients of two surfaces in contact.
///
/// If the rules of the two surfaces differ, the rule that comes later in the order `mean`, `min`, `multiply`,
/// `max` applies. An explicit `min` or `max` also applies to torsional and rolling friction, which otherwise
/// use the mean.
///
/// ```
/// use motorium_worlds::FrictionCombine;
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
    /// Mean of both coefficients. Default for surfaces with a friction above 0.
    Mean,
    /// The smaller coefficient.
    Min,
    /// Product of both coefficients. Default for surfaces with a friction of 0: contacts of such a surface
    /// are frictionless unless the other surface has the rule `max`.
    Multiply,
    /// The larger coefficient.
    Max,
}

impl FrictionCombine {
    /// Returns the rule of a surface: `stated` if given, otherwise the default for the surface's coefficient
    /// of friction.
    pub fn of_surface(friction: f64, stated: Option<Self>) -> Self {
        stated.unwrap_or(if friction > 0.0 { Self::Mean } else { Self::Multiply })
    }

    /// Returns the coefficient of friction of a contact. Each argument is the coefficient of one surface and
    /// the explicit rule of that surface, if any.
    pub fn combined((a, rule_a): (f64, Option<Self>), (b, rule_b): (f64, Option<Self>)) -> f64 {
        match Self::of_surface(a, rule_a).max(Self::of_surface(b, rule_b)) {
            Self::Mean => 0.5 * (a + b),
            Self::Min => a.min(b),
            Self::Multiply => a * b,
            Self::Max => a.max(b),
        }
    }

    /// Returns the torsional or rolling friction of a contact \[m\]: the smaller value under `min`, the
    /// larger under `max`, otherwise the mean. Each argument is the coefficient of one surface and the
    /// explicit rule of that surface, if any.
    ///
    /// ```
    /// use motorium_worlds::FrictionCombine;
    ///
    /// let (rubber, steel) = ((0.02, Some(FrictionCombine::Max)), (0.004, None));
    /// assert_eq!(FrictionCombine::combined_lengths(rubber, steel), 0.02);
    /// ```
    pub fn combined_lengths((a, rule_a): (f64, Option<Self>), (b, rule_b): (f64, Option<Self>)) -> f64 {
        match rule_a.max(rule_b) {
            Some(Self::Min) => a.min(b),
            Some(Self::Max) => a.max(b),
            None | Some(Self::Mean | Self::Multiply) => 0.5 * (a + b),
        }
    }
}

/// A compliant surface: a spring and a damper at each contact point, replacing rigid contact and restitution.
///
/// ```text
/// force = max(0, stiffness depth - damping d(distance)/dt)
/// ```
///
/// For example, four springs support a box that rests on four corners. Between two soft surfaces, the springs
/// act in series, and so do the dampers.
///
/// ```
/// use motorium_worlds::World;
///
/// let world: World = toml::from_str("ground = { soft = { stiffness = 2e4, damping = 50.0 } }").unwrap();
/// assert_eq!(world.ground.unwrap().soft.unwrap().stiffness, 2e4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Softness {
    /// Force per penetration depth at a contact point (N/m), above 0.
    #[schemars(range(min = 0.0))]
    pub stiffness: f64,
    /// Force per approach speed while the surfaces overlap (N s/m), from 0. Default 0.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub damping: f64,
}

impl Softness {
    /// Returns the softness of a contact between this surface and another soft surface: both springs act in
    /// series, and so do both dampers.
    pub fn behind(self, other: Self) -> Self {
        let series = |a: f64, b: f64| if a + b > 0.0 { a * b / (a + b) } else { 0.0 };
        Self {
            stiffness: series(self.stiffness, other.stiffness),
            damping: series(self.damping, other.damping),
        }
    }
}

/// Direction-dependent friction, for example of a skate, a ski or corduroy. The grain's coefficient applies
/// along `direction`, and the surface's coefficient applies across `direction`.
///
/// The maximum friction forces in all directions form an ellipse, and the friction force on a sliding body
/// dissipates as much energy as possible.
///
/// ```
/// use motorium_worlds::Object;
///
/// let text = r#"
/// name     = "skate"
/// shape    = { box = { size = [0.3, 0.02, 0.05] } }
/// mass     = 1.0
/// position = [0.0, 0.0, 0.025]
/// friction = 0.9
/// grain    = { direction = [1.0, 0.0, 0.0], friction = 0.02 }
/// "#;
/// let skate: Object = toml::from_str(text).unwrap();
/// assert_eq!(skate.grain.unwrap().friction, 0.02);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Grain {
    /// Direction of the grain, of any nonzero length, in the axes of the object or link; for the ground, in
    /// world axes.
    pub direction: [f64; 3],
    /// Coefficient of friction along `direction`, at least 0. A contact uses the mean of both surfaces'
    /// coefficients.
    #[schemars(range(min = 0.0))]
    pub friction: f64,
}

impl Grain {
    /// Returns the direction as a unit vector.
    pub fn unit(&self) -> Vector3<f64> {
        Vector3::from(self.direction).normalize()
    }
}

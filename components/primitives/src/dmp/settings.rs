//! Variants of a discrete primitive and their settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ValueError;

/// The published form of the primitive; the equations stand in the [module documentation](crate::dmp).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// Ijspeert et al. 2013. Starts with an acceleration of `K (g - y0) / T^2`; for parity with the literature.
    Classic,
    /// Pastor et al. 2009, Hoffmann et al. 2009. Starts softly, and neither `g = y0` nor a moving goal can upset it.
    GoalSafe,
    /// After Muelling et al. 2013, with zero final velocity. The goal itself travels on a minimum-jerk polynomial, so
    /// that without forcing the motion is minimum-jerk and arrives exactly on time. The default.
    #[default]
    QuinticGoal,
    /// Muelling et al. 2013 as published: as [`Variant::QuinticGoal`], but the goal is passed with a velocity that each
    /// movement chooses, for strokes and catches. A fit takes the velocity at the end of the demonstration for its.
    FinalVelocity,
}

impl Variant {
    /// Its name, as files have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classic => "classic",
            Self::GoalSafe => "goal_safe",
            Self::QuinticGoal => "quintic_goal",
            Self::FinalVelocity => "final_velocity",
        }
    }

    /// True if the goal travels on a polynomial.
    pub fn plans_goal(self) -> bool {
        matches!(self, Self::QuinticGoal | Self::FinalVelocity)
    }

    /// True if the goal can be passed with a velocity.
    pub fn may_end_in_motion(self) -> bool {
        self == Self::FinalVelocity
    }

    /// True if the pull to the goal sets in with the phase.
    pub fn eases_in(self) -> bool {
        self == Self::GoalSafe
    }
}

/// Scaling of the forcing term with the displacement `g - y0` of a new movement.
///
/// The scale is taken once, at the start of a movement: a goal that moves later moves the attractor, never the forcing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Scaling {
    /// The forcing term of the demonstration, unchanged. The default: nothing to divide by.
    #[default]
    Fixed,
    /// Each dimension by `(g - y0) / (g - y0 of the demonstration)`, at most `limit` in magnitude.
    ///
    /// A dimension in which the demonstration ended where it began keeps its forcing. A model made without a
    /// demonstration has a displacement of 1, which makes this the `(g - y0)` of Ijspeert 2013.
    Displacement {
        /// The largest magnitude of the factor, at least 1.
        limit: f64,
    },
    /// The whole forcing vector by the ratio of the lengths of the two displacements (at most `limit`) and the
    /// smallest rotation that takes the one direction to the other (Ginesi et al. 2021), so that a curve keeps its shape
    /// whichever way it points. For dimensions that share one unit, such as a position in space.
    Similarity {
        /// The largest ratio of lengths, at least 1.
        limit: f64,
    },
}

/// The settings of a discrete primitive; [`Default`] gives the values named on each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// The published form. Default [`Variant::QuinticGoal`].
    pub variant: Variant,
    /// Scaling of the forcing term with a new displacement. Default [`Scaling::Fixed`].
    pub scaling: Scaling,
    /// Number of kernels for each dimension, at least 2. Default 30.
    pub kernels: usize,
    /// Damping `D` of the transformation system; its stiffness is `K = D^2 / 4`, critically damped. Default 25.
    pub damping: f64,
    /// Decay `a_s` of the phase over one duration. Default `-ln 0.01 = 4.605`: 1 % of the phase is left at the end.
    pub decay: f64,
    /// Value of a kernel at the centre of its successor, in (0, 1). Default 0.8.
    pub overlap: f64,
    /// Rate `a_g` of the goal filter `T g' = a_g (g_commanded - g)` of [`Variant::Classic`] and [`Variant::GoalSafe`];
    /// without it the goal jumps. The variants with a quintic goal always move it smoothly and take none.
    pub goal_rate: Option<f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            variant: Variant::default(),
            scaling: Scaling::default(),
            kernels: 30,
            damping: 25.0,
            decay: -(0.01_f64.ln()),
            overlap: 0.8,
            goal_rate: None,
        }
    }
}

/// An error of making a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// A number, vector or matrix that will not do.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// A goal filter on the variant that plans its goal.
    #[error(
        "goal_rate is set, but the quintic goal plans its own way to a new goal: remove it, or choose another variant"
    )]
    NeedlessGoalRate,
}

impl Settings {
    /// Checks every number against the range in which the equations hold.
    ///
    /// # Errors
    /// The first setting that is out of range.
    pub fn check(&self) -> Result<(), ModelError> {
        let limit = match self.scaling {
            Scaling::Fixed => 1.0,
            Scaling::Displacement { limit } | Scaling::Similarity { limit } => limit,
        };
        let goal_rate = self.goal_rate.unwrap_or(1.0);
        let positive = |x: f64| x > 0.0 && x.is_finite();
        for (name, value, holds, expected) in [
            ("kernels", self.kernels as f64, self.kernels >= 2, "at least 2"),
            ("damping", self.damping, positive(self.damping), "a positive number"),
            ("decay", self.decay, positive(self.decay), "a positive number"),
            (
                "overlap",
                self.overlap,
                self.overlap > 0.0 && self.overlap < 1.0,
                "between 0 and 1, both excluded",
            ),
            ("scaling.limit", limit, limit >= 1.0, "at least 1"),
            ("goal_rate", goal_rate, positive(goal_rate), "a positive number"),
        ] {
            if !holds {
                return Err(ModelError::Value(ValueError::OutOfRange { name, value, expected }));
            }
        }
        if self.variant.plans_goal() && self.goal_rate.is_some() {
            return Err(ModelError::NeedlessGoalRate);
        }
        Ok(())
    }
}

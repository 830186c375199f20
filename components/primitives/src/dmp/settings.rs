//! Variants of a discrete primitive and their settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::ValueError;

/// Published form of the discrete primitive. The equations are in the [module documentation](crate::dmp).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Variant {
    /// Ijspeert et al. 2013. Starts with an acceleration of `K (g - y0) / T^2`. For comparison with the
    /// literature only.
    Classic,
    /// Pastor et al. 2009, Hoffmann et al. 2009. Starts smoothly and tolerates `g = y0` and a moving goal.
    GoalSafe,
    /// Muelling et al. 2013 with zero final velocity. The goal moves on a minimum-jerk polynomial, so without
    /// forcing the motion is minimum-jerk and arrives exactly on time. This is the default.
    #[default]
    QuinticGoal,
    /// Muelling et al. 2013 as published: like [`Variant::QuinticGoal`], but each movement passes the goal
    /// with a selectable velocity, for strokes and catches. A fit uses the velocity at the end of the
    /// demonstration.
    FinalVelocity,
}

impl Variant {
    /// Returns the name of the variant in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Classic => "classic",
            Self::GoalSafe => "goal_safe",
            Self::QuinticGoal => "quintic_goal",
            Self::FinalVelocity => "final_velocity",
        }
    }

    /// Returns `true` if the goal moves on a polynomial that is planned at the start.
    pub fn plans_goal(self) -> bool {
        matches!(self, Self::QuinticGoal | Self::FinalVelocity)
    }

    /// Returns `true` if the goal can be passed with a nonzero velocity.
    pub fn may_end_in_motion(self) -> bool {
        self == Self::FinalVelocity
    }

    /// Returns `true` if the pull towards the goal starts at zero and increases gradually.
    pub fn eases_in(self) -> bool {
        self == Self::GoalSafe
    }
}

/// Scaling of the forcing term with the displacement `g - y0` of a new movement.
///
/// The scale is fixed at the start of a movement. A goal that changes later moves the attractor but does not
/// change the scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum Scaling {
    /// The forcing term of the demonstration, unchanged. This is the default; it involves no division.
    #[default]
    Fixed,
    /// Scaling of each dimension by `(g - y0) / (g - y0 of the demonstration)`, at most `limit` in magnitude.
    ///
    /// If the demonstration ends at its start in a dimension, the forcing term of this dimension is not
    /// scaled. A model without a demonstration has a displacement of 1, which gives the factor `(g - y0)` of
    /// Ijspeert 2013.
    Displacement {
        /// Maximum magnitude of the factor, at least 1.
        limit: f64,
    },
    /// Scaling of the whole forcing vector by the ratio of the lengths of the two displacements (at most
    /// `limit`), with the smallest rotation between their directions (Ginesi et al. 2021). A curve keeps its
    /// shape in every direction. Only for dimensions that share one unit, such as the coordinates of a
    /// position.
    Similarity {
        /// Maximum ratio of lengths, at least 1.
        limit: f64,
    },
}

/// Settings of a discrete primitive. [`Default`] returns the values documented on each field.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Published form of the primitive. Default [`Variant::QuinticGoal`].
    pub variant: Variant,
    /// Scaling of the forcing term with a new displacement. Default [`Scaling::Fixed`].
    pub scaling: Scaling,
    /// Number of kernels for each dimension, at least 2. Default 30.
    pub kernels: usize,
    /// Damping `D` of the transformation system; its stiffness is `K = D^2 / 4`, critically damped. Default
    /// 25.
    pub damping: f64,
    /// Decay `a_s` of the phase over one duration. Default `-ln 0.01 = 4.605`: 1 % of the phase remains at
    /// the end.
    pub decay: f64,
    /// Value of each kernel at the centre of its successor, in (0, 1). Default 0.8.
    pub overlap: f64,
    /// Rate `a_g` of the goal filter `T g' = a_g (g_commanded - g)` of [`Variant::Classic`] and
    /// [`Variant::GoalSafe`]. `None`, the default, applies goal changes in a step. The variants with a
    /// quintic goal always move the goal smoothly and reject this setting.
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

/// Error returned when a model cannot be created.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// A goal rate is set, but the variant plans its goal and has no goal filter.
    #[error(
        "goal_rate is set, but a quintic goal already moves smoothly: remove goal_rate, or choose a variant without a quintic goal"
    )]
    NeedlessGoalRate,
}

impl Settings {
    /// Checks every number against the range in which the equations hold.
    ///
    /// # Errors
    /// [`ModelError`] describes the first setting that is out of range.
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

//! Shape of the path from one goal to the next.

use nalgebra::{DMatrix, Vector3};

use crate::dmp::{Demonstration, DmpModel, Regression, Settings, Variant};

/// Maximum deviation of an arc along each axis, m.
pub const MAX_APEX: f64 = 1e6;

/// Shape of the position path to a goal. The orientation always follows the shortest rotation.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum PathShape {
    /// The straight line.
    #[default]
    Straight,
    /// An arc whose midpoint deviates from the straight line by `apex`, for example to pass over an obstacle.
    Arc {
        /// Deviation at the midpoint in world axes, m; each component at most [`MAX_APEX`].
        apex: Vector3<f64>,
    },
    /// A learned primitive of three dimensions, with the variant [`Variant::QuinticGoal`], which starts
    /// smoothly and arrives on time.
    Learned(Box<DmpModel>),
}

/// Error returned when the shape of a path is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// The apex is not finite, or a component exceeds [`MAX_APEX`].
    #[error("the apex of the arc is ({:?}, {:?}, {:?}) m, expected finite numbers of at most {MAX_APEX} m", .0.x, .0.y, .0.z)]
    Apex(Vector3<f64>),
    /// The primitive does not have three dimensions.
    #[error("the learned shape has {found} dimensions, expected 3: the position of the end effector")]
    Dimensions {
        /// Number of dimensions found.
        found: usize,
    },
    /// The primitive's variant starts abruptly or arrives late.
    #[error(
        "the learned shape is a {found:?} primitive, expected QuinticGoal: all other variants start with a jolt or arrive late"
    )]
    Variant {
        /// Variant found.
        found: Variant,
    },
}

impl PathShape {
    /// Returns the primitive that moves the position.
    pub(super) fn model(&self) -> Result<DmpModel, ShapeError> {
        match self {
            Self::Straight => Ok(unshaped()),
            Self::Arc { apex } if apex.iter().all(|value| value.abs() <= MAX_APEX) => Ok(arc(*apex)),
            Self::Arc { apex } => Err(ShapeError::Apex(*apex)),
            Self::Learned(model) if model.dimensions() != 3 => {
                Err(ShapeError::Dimensions { found: model.dimensions() })
            }
            Self::Learned(model) if model.settings().variant != Variant::QuinticGoal => {
                Err(ShapeError::Variant { found: model.settings().variant })
            }
            Self::Learned(model) => Ok((**model).clone()),
        }
    }
}

/// Three dimensions without a forcing term.
pub(super) fn unshaped() -> DmpModel {
    DmpModel::new(3, Settings::default())
        .expect("the default settings are in range and there are three dimensions")
}

/// Fits the deviation `apex * 64 p^3 (1 - p)^3`, which starts and ends at rest without acceleration.
fn arc(apex: Vector3<f64>) -> DmpModel {
    const SAMPLES: usize = 301;
    let sampled = |profile: fn(f64) -> f64| {
        DMatrix::from_fn(SAMPLES, 3, |k, d| apex[d] * profile(k as f64 / (SAMPLES - 1) as f64))
    };
    let demonstration = Demonstration::with_derivatives(
        1.0,
        sampled(|p| 64.0 * (p * (1.0 - p)).powi(3)),
        sampled(|p| 192.0 * (p * (1.0 - p)).powi(2) * (1.0 - 2.0 * p)),
        sampled(|p| 384.0 * p * (1.0 - p) * (1.0 - 5.0 * p + 5.0 * p * p)),
    )
    .expect("the profile is finite, of one shape and long enough");
    DmpModel::fit(Settings::default(), &[demonstration], Regression::default())
        .expect("one demonstration with ten samples per kernel determines the weights")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dmp::DiscreteDmp;

    #[test]
    fn arc_passes_its_apex_and_returns_to_the_line() {
        let apex = Vector3::new(0.0, -0.05, 0.2);
        let mut dmp = DiscreteDmp::new(PathShape::Arc { apex }.model().unwrap());
        dmp.start(&[0.0; 3], &[0.4, 0.0, 0.0], 1.0).unwrap();
        let mut worst = 0.0_f64;
        for k in 1..=1000 {
            dmp.step(1e-3);
            let p = f64::from(k) / 1000.0;
            let expected = 64.0 * (p * (1.0 - p)).powi(3) * apex;
            worst =
                worst.max((dmp.position()[1] - expected.y).abs()).max((dmp.position()[2] - expected.z).abs());
        }
        assert!(worst < 2e-5, "off by {worst} m");
    }

    #[test]
    fn invalid_shapes_are_rejected() {
        let apex = Vector3::new(0.0, f64::NAN, 0.0);
        let error = PathShape::Arc { apex }.model().unwrap_err().to_string();
        assert_eq!(
            error,
            "the apex of the arc is (0.0, NaN, 0.0) m, expected finite numbers of at most 1000000 m"
        );
        let apex = Vector3::new(0.0, 0.0, 1e308);
        assert_eq!(PathShape::Arc { apex }.model().unwrap_err(), ShapeError::Apex(apex));
        let flat = DmpModel::new(2, Settings::default()).unwrap();
        assert_eq!(
            PathShape::Learned(Box::new(flat)).model().unwrap_err(),
            ShapeError::Dimensions { found: 2 }
        );
        let classic =
            DmpModel::new(3, Settings { variant: Variant::Classic, ..Settings::default() }).unwrap();
        let error = PathShape::Learned(Box::new(classic)).model().unwrap_err();
        assert_eq!(error, ShapeError::Variant { found: Variant::Classic });
    }
}

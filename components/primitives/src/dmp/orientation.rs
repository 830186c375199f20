//! A discrete primitive for orientations.

use motorium_robots::lie::{RotationRates, angular_motion, rotation_rates, so3};
use nalgebra::{DMatrix, UnitQuaternion, Vector3};

use super::demonstration::{Demonstration, DemonstrationError};
use super::discrete::{DiscreteDmp, MoveError};
use super::model::DmpModel;
use super::quintic::Jet;
use super::settings::ModelError;
use crate::ValueError;

/// An orientation primitive, after Ude et al. 2014 in the corrected form of Koutras and Doulgeri 2019.
///
/// The state is the error `e = 2 log(g * conj(q))` (rad, three entries), not the angular velocity. The system
/// in `e` is linear, so scaling of time and goal does not distort the path. The system is a [`DiscreteDmp`]
/// of three dimensions from `e(0) = 2 log(g * conj(q0))` to `0`. The orientation is `q = exp(-e / 2) * g`;
/// angular velocity and acceleration follow exactly from `e'` and `e''`.
///
/// The movement follows the shorter of the two rotations. The quaternion has unit length and keeps its sign
/// during a movement.
#[derive(Clone, Debug)]
pub struct OrientationDmp {
    dmp: DiscreteDmp,
    start: UnitQuaternion<f64>,
    goal: UnitQuaternion<f64>,
    orientation: UnitQuaternion<f64>,
    angular_velocity: Vector3<f64>,
    angular_acceleration: Vector3<f64>,
}

impl OrientationDmp {
    /// Creates a primitive from a model of three dimensions. Until started, the primitive rests at the
    /// identity.
    ///
    /// # Errors
    /// [`ModelError`] if the model does not have three dimensions.
    pub fn new(model: DmpModel) -> Result<Self, ModelError> {
        if model.dimensions() != 3 {
            let found = model.dimensions();
            return Err(ModelError::Value(ValueError::Size {
                name: "an orientation primitive",
                found,
                expected: 3,
            }));
        }
        Ok(Self {
            dmp: DiscreteDmp::new(model),
            start: UnitQuaternion::identity(),
            goal: UnitQuaternion::identity(),
            orientation: UnitQuaternion::identity(),
            angular_velocity: Vector3::zeros(),
            angular_acceleration: Vector3::zeros(),
        })
    }

    /// Starts a rotation from rest at `start` to `goal`, to arrive after `duration` seconds.
    ///
    /// # Errors
    /// [`MoveError`] if the duration is not positive, or a quaternion is not finite.
    pub fn start(
        &mut self,
        start: UnitQuaternion<f64>,
        goal: UnitQuaternion<f64>,
        duration: f64,
    ) -> Result<(), MoveError> {
        let vector = self.check_way(start, goal)?;
        self.dmp.start_at_velocity([(-vector).as_slice(), &[0.0; 3]], &[0.0; 3], duration)?;
        self.begin(start, vector, goal);
        Ok(())
    }

    /// Rotation from the goal to the start, as a rotation vector.
    fn check_way(
        &self,
        start: UnitQuaternion<f64>,
        goal: UnitQuaternion<f64>,
    ) -> Result<Vector3<f64>, MoveError> {
        let vector = so3::log(&(start * goal.inverse()));
        in_coordinates(vector, Vector3::zeros(), Vector3::zeros()).map(|_| vector)
    }

    fn begin(&mut self, start: UnitQuaternion<f64>, vector: Vector3<f64>, goal: UnitQuaternion<f64>) {
        self.start = start;
        self.orientation = start;
        self.goal = with_sign_of(start, so3::exp(&vector), goal);
        self.observe();
    }

    /// Starts a rotation with an initial angular velocity (rad/s) and angular acceleration (rad/s^2) in world
    /// axes.
    ///
    /// # Errors
    /// [`MoveError`] if the duration is not positive, or a number is not finite.
    pub fn start_moving(
        &mut self,
        start: UnitQuaternion<f64>,
        [velocity, acceleration]: [Vector3<f64>; 2],
        goal: UnitQuaternion<f64>,
        duration: f64,
    ) -> Result<(), MoveError> {
        let vector = so3::log(&(start * goal.inverse()));
        let phi = in_coordinates(vector, velocity, acceleration)?;
        self.dmp.start_moving(
            [(-phi.vector).as_slice(), (-phi.rate).as_slice(), (-phi.acceleration).as_slice()],
            &[0.0; 3],
            duration,
        )?;
        self.begin(start, vector, goal);
        Ok(())
    }

    /// Changes the goal during a movement. Orientation, angular velocity and, with a quintic goal, angular
    /// acceleration stay continuous.
    ///
    /// # Errors
    /// [`MoveError`] if the quaternion is not finite.
    pub fn set_goal(&mut self, goal: UnitQuaternion<f64>) -> Result<(), MoveError> {
        if goal.coords == self.goal.coords || goal.coords == -self.goal.coords {
            return Ok(());
        }
        let vector = so3::log(&(self.orientation * goal.inverse()));
        let phi = in_coordinates(vector, self.angular_velocity, self.angular_acceleration)?;
        let jet =
            |d: usize| Jet { value: -phi.vector[d], rate: -phi.rate[d], acceleration: -phi.acceleration[d] };
        let start = -so3::log(&(self.start * goal.inverse()));
        self.dmp.rebase(&[jet(0), jet(1), jet(2)], start.as_slice(), &[0.0; 3]);
        self.goal = with_sign_of(self.orientation, so3::exp(&vector), goal);
        self.observe();
        Ok(())
    }

    /// Changes the duration during a movement; see [`DiscreteDmp::set_duration`].
    ///
    /// # Errors
    /// [`MoveError`] if the duration is not positive.
    pub fn set_duration(&mut self, duration: f64) -> Result<(), MoveError> {
        self.dmp.set_duration(duration)?;
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.dmp.step(dt);
        self.observe();
    }

    /// Returns the orientation, a unit quaternion.
    pub fn orientation(&self) -> UnitQuaternion<f64> {
        self.orientation
    }

    /// Returns the angular velocity in world axes, rad/s.
    pub fn angular_velocity(&self) -> Vector3<f64> {
        self.angular_velocity
    }

    /// Returns the angular acceleration in world axes, rad/s^2.
    pub fn angular_acceleration(&self) -> Vector3<f64> {
        self.angular_acceleration
    }

    /// Returns the goal, with the quaternion sign for which the path is continuous.
    pub fn goal(&self) -> UnitQuaternion<f64> {
        self.goal
    }

    /// Returns the underlying primitive in error coordinates.
    pub fn coordinates(&self) -> &DiscreteDmp {
        &self.dmp
    }

    fn observe(&mut self) {
        let negated = |values: &[f64]| -Vector3::from_column_slice(values);
        let phi = RotationRates {
            vector: negated(self.dmp.position()),
            rate: negated(self.dmp.velocity()),
            acceleration: negated(self.dmp.acceleration()),
        };
        self.orientation = so3::exp(&phi.vector) * self.goal;
        self.orientation.renormalize_fast();
        (self.angular_velocity, self.angular_acceleration) = angular_motion(&phi);
    }
}

/// Converts recorded orientations, evenly spaced over `duration` seconds, to a demonstration for
/// [`DmpModel::fit`]. The coordinates of the demonstration are errors with respect to the last sample. Sign
/// changes of the quaternions have no effect. Rotations of more than half a revolution between start and goal
/// are preserved.
///
/// # Errors
/// [`DemonstrationError`] in the same cases as [`Demonstration::from_positions`].
pub fn orientation_demonstration(
    duration: f64,
    orientations: &[UnitQuaternion<f64>],
) -> Result<Demonstration, DemonstrationError> {
    let mut errors = DMatrix::zeros(orientations.len(), 3);
    let goal = orientations.last().copied().unwrap_or_default();
    let mut later = Vector3::zeros();
    for (k, orientation) in orientations.iter().enumerate().rev() {
        later = nearest_turn(so3::log(&(goal * orientation.inverse())), later);
        errors.row_mut(k).tr_copy_from(&later);
    }
    Demonstration::from_positions(duration, errors)
}

/// Among the rotation vectors of the same rotation, returns the one nearest to a neighbour in time.
fn nearest_turn(vector: Vector3<f64>, neighbour: Vector3<f64>) -> Vector3<f64> {
    let angle = vector.norm();
    // a rotation near zero has no defined axis and uses its neighbour's
    let axis = if angle > 1e-9 { vector / angle } else { neighbour.try_normalize(1e-9).unwrap_or_default() };
    let turns = ((neighbour.dot(&axis) - angle) / std::f64::consts::TAU).round();
    vector + axis * (turns * std::f64::consts::TAU)
}

fn in_coordinates(
    vector: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
) -> Result<RotationRates, MoveError> {
    // the logarithm is at most pi long, where the Jacobian is regular: the inverse exists unless a number is
    // not finite
    rotation_rates(vector, velocity, acceleration)
        .filter(|phi| phi.vector.iter().all(|value| value.is_finite()))
        .ok_or(MoveError::NotFinite { name: "orientation", value: vector.sum() })
}

/// Returns `goal` or `-goal`, such that `turn * goal` is `orientation` and not its negative.
fn with_sign_of(
    orientation: UnitQuaternion<f64>,
    turn: UnitQuaternion<f64>,
    goal: UnitQuaternion<f64>,
) -> UnitQuaternion<f64> {
    if (turn * goal).coords.dot(&orientation.coords) < 0.0 {
        UnitQuaternion::new_unchecked(-goal.into_inner())
    } else {
        goal
    }
}

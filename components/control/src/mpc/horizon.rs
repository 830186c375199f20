//! Components of a horizon of centroidal motion.

use nalgebra::Vector3;

/// Motion of a whole robot about its centre of mass, axes of the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CentroidalState {
    /// Rotation vector by which the base is turned from the reference at the beginning of the horizon
    /// \[rad\].
    pub turn: Vector3<f64>,
    /// Centre of mass \[m\].
    pub position: Vector3<f64>,
    /// Angular momentum about the centre of mass \[kg m2/s\].
    pub angular_momentum: Vector3<f64>,
    /// Velocity of the centre of mass \[m/s\].
    pub velocity: Vector3<f64>,
}

impl Default for CentroidalState {
    fn default() -> Self {
        let zero = Vector3::zeros();
        Self { turn: zero, position: zero, angular_momentum: zero, velocity: zero }
    }
}

/// Costs of errors, in heading axes: ahead, left, up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MpcWeights {
    /// Weight of the orientation about each axis \[1/rad\]. Default 1, 1, 1.
    pub turn: Vector3<f64>,
    /// Weight of the centre of mass \[1/m\]. Default 10, 10, 20.
    pub position: Vector3<f64>,
    /// Weight of the mean angular velocity `I^-1 k` \[1/(rad/s)\]. Default 0.05, 0.05, 0.05.
    pub angular_velocity: Vector3<f64>,
    /// Weight of the velocity of the centre of mass \[1/(m/s)\]. Default 0.5, 0.5, 0.5.
    pub velocity: Vector3<f64>,
    /// Weight of the deviation of a force from its share of the weight, in units of the robot's weight.
    /// Default 0.5.
    pub force: f64,
}

impl Default for MpcWeights {
    fn default() -> Self {
        Self {
            turn: Vector3::repeat(1.0),
            position: Vector3::new(10.0, 10.0, 20.0),
            angular_velocity: Vector3::repeat(0.05),
            velocity: Vector3::repeat(0.5),
            force: 0.5,
        }
    }
}

/// Settings of a [`CentroidalMpc`](super::CentroidalMpc).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MpcSettings {
    /// Mass of the robot \[kg\]. Default 1.
    pub mass: f64,
    /// Acceleration of gravity, axes of the world \[m/s2\]. Default 9.81 down.
    pub gravity: Vector3<f64>,
    /// Number of steps of the horizon. Default 10.
    pub steps: usize,
    /// Time of a step \[s\]. Default 0.03.
    pub step: f64,
    /// Largest normal force at a point \[N\]. Default infinite.
    pub max_force: f64,
    /// Costs of errors.
    pub weights: MpcWeights,
}

impl Default for MpcSettings {
    fn default() -> Self {
        Self {
            mass: 1.0,
            gravity: Vector3::new(0.0, 0.0, -9.81),
            steps: 10,
            step: 0.03,
            max_force: f64::INFINITY,
            weights: MpcWeights::default(),
        }
    }
}

/// A step of the horizon: the reference at its end, and the points that touch the ground during it.
#[derive(Clone, Debug, PartialEq)]
pub struct HorizonStep {
    /// Centre of mass \[m\].
    pub position: Vector3<f64>,
    /// Its velocity \[m/s\].
    pub velocity: Vector3<f64>,
    /// Angular velocity of the reference \[rad/s\].
    pub angular_velocity: Vector3<f64>,
    /// Heading of the reference: its angle about the vertical \[rad\].
    pub heading: f64,
    /// Position of each point in contact \[m\]; `None` for the others.
    pub points: Vec<Option<Vector3<f64>>>,
    /// Reference point of the torques \[m\].
    pub(super) centre: Vector3<f64>,
}

impl HorizonStep {
    pub(super) fn of_points(points: usize) -> Self {
        let zero = Vector3::zeros();
        Self {
            position: zero,
            velocity: zero,
            angular_velocity: zero,
            heading: 0.0,
            points: vec![None; points],
            centre: zero,
        }
    }
}

//! State, settings and steps of a horizon of centroidal motion.

use motorium_control::with_defaults;
use nalgebra::Vector3;

with_defaults! {
    /// Motion of a whole robot about its centre of mass, in world axes.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct CentroidalState;

    /// Rotation vector of the base relative to the reference at the beginning of the horizon \[rad\].
    pub turn: Vector3<f64> = Vector3::zeros();
    /// Position of the centre of mass \[m\].
    pub position: Vector3<f64> = Vector3::zeros();
    /// Angular momentum about the centre of mass \[kg m2/s\].
    pub angular_momentum: Vector3<f64> = Vector3::zeros();
    /// Velocity of the centre of mass \[m/s\].
    pub velocity: Vector3<f64> = Vector3::zeros();
}

with_defaults! {
    /// Weights of the cost terms, in heading axes: forward, left, up.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MpcWeights;

    /// Weight of the orientation about each axis \[1/rad\]. Default 1, 1, 1.
    pub turn: Vector3<f64> = Vector3::repeat(1.0);
    /// Weight of the position of the centre of mass \[1/m\]. Default 10, 10, 20.
    pub position: Vector3<f64> = Vector3::new(10.0, 10.0, 20.0);
    /// Weight of the mean angular velocity `I^-1 k`, with the angular momentum `k` \[1/(rad/s)\]. Default
    /// 0.05, 0.05, 0.05.
    pub angular_velocity: Vector3<f64> = Vector3::repeat(0.05);
    /// Weight of the velocity of the centre of mass \[1/(m/s)\]. Default 0.5, 0.5, 0.5.
    pub velocity: Vector3<f64> = Vector3::repeat(0.5);
    /// Weight of the deviation of each force from an equal distribution of the robot's weight, in units of
    /// that weight. Default 0.5.
    pub force: f64 = 0.5;
}

with_defaults! {
    /// Settings of a [`CentroidalMpc`](super::CentroidalMpc).
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MpcSettings;

    /// Mass of the robot \[kg\]. Default 1.
    pub mass: f64 = 1.0;
    /// Gravitational acceleration in world axes \[m/s2\]. Default: 9.81 down.
    pub gravity: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
    /// Number of steps of the horizon. Default 10.
    pub steps: usize = 10;
    /// Duration of a step \[s\]. Default 0.03.
    pub step: f64 = 0.03;
    /// Maximum normal force at a point \[N\]. Default: infinite.
    pub max_force: f64 = f64::INFINITY;
    /// Weights of the cost terms.
    pub weights: MpcWeights = MpcWeights::default();
}

/// A step of the horizon: the reference at its end, and the contact points during it.
#[derive(Clone, Debug, PartialEq)]
pub struct HorizonStep {
    /// Position of the reference centre of mass \[m\].
    pub position: Vector3<f64>,
    /// Velocity of the reference centre of mass \[m/s\].
    pub velocity: Vector3<f64>,
    /// Angular velocity of the reference \[rad/s\].
    pub angular_velocity: Vector3<f64>,
    /// Heading of the reference, its angle about the vertical \[rad\].
    pub heading: f64,
    /// Position of each contact point \[m\]; `None` if it is not in contact.
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

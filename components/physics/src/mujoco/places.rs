//! Indices of motorium's coordinates in MuJoCo's vectors.

use motorium_robots::Coordinate;
use motorium_worlds::ObjectMass;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Indices of motorium's coordinates in MuJoCo's position and velocity vectors.
pub(super) struct Places {
    pub(super) articulations: Vec<ArticulationPlaces>,
    pub(super) objects: Vec<ObjectPlace>,
    /// Mass properties of the movable objects.
    pub(super) masses: Vec<Option<ObjectMass>>,
}

pub(super) struct ArticulationPlaces {
    pub(super) base: Option<(usize, usize)>,
    /// One entry per body of the model.
    pub(super) joints: Vec<(usize, usize)>,
    pub(super) coordinates: Vec<Coordinate>,
    /// Body of each independent joint.
    pub(super) drives: Vec<usize>,
}

#[derive(Clone, Copy, Debug)]
pub(super) enum ObjectPlace {
    /// A movable object.
    Free(usize, usize),
    /// An object at a fixed pose.
    Placed(usize),
}

/// Returns position and rotation at the start of a slice of MuJoCo's positions.
pub(super) fn pose_at(qpos: &[f64]) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let rotation = Quaternion::new(qpos[3], qpos[4], qpos[5], qpos[6]);
    (Vector3::from_column_slice(&qpos[..3]), UnitQuaternion::new_normalize(rotation))
}

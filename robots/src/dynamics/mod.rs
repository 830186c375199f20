//! Inverse and forward dynamics by recursion in body frames (Featherstone, "Rigid Body Dynamics Algorithms", 2008).

mod crba;
mod forward;
mod rnea;

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::Model;

pub use forward::SingularMassMatrix;

/// What the recursions keep for one body, in its own frame.
#[derive(Clone, Debug)]
struct BodyWork {
    /// Pose in the parent body.
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Spatial velocity and acceleration of the body frame's origin.
    linear: Vector3<f64>,
    angular: Vector3<f64>,
    linear_acceleration: Vector3<f64>,
    angular_acceleration: Vector3<f64>,
    /// Force and moment about the origin.
    force: Vector3<f64>,
    moment: Vector3<f64>,
    /// Mass, first moment and inertia about the origin of the body and all that hangs on it.
    composite_mass: f64,
    composite_moment: Vector3<f64>,
    composite_inertia: Matrix3<f64>,
}

/// Workspace for the dynamics of one [`Model`]. Nothing allocates after [`new`](Self::new).
///
/// `q`, `v`, `a` and `tau` are nv long; methods panic on any other length. `gravity` is the acceleration of free fall in
/// the world \[m/s2\], usually `(0, 0, -9.81)`. Joint damping, friction and limits play no part.
#[derive(Clone, Debug)]
pub struct Dynamics {
    bodies: Vec<BodyWork>,
    /// Mass matrix and its Cholesky factor, for forward dynamics.
    mass: DMatrix<f64>,
}

impl Dynamics {
    /// A workspace for `model`.
    pub fn new(model: &Model) -> Self {
        let zero = Vector3::zeros();
        let work = BodyWork {
            rotation: Matrix3::identity(),
            translation: zero,
            linear: zero,
            angular: zero,
            linear_acceleration: zero,
            angular_acceleration: zero,
            force: zero,
            moment: zero,
            composite_mass: 0.0,
            composite_moment: zero,
            composite_inertia: Matrix3::zeros(),
        };
        Self { bodies: vec![work; model.bodies().len()], mass: DMatrix::zeros(model.nv(), model.nv()) }
    }

    fn place(&mut self, model: &Model, q: &[f64]) {
        assert_eq!(q.len(), model.nq(), "length of q");
        assert_eq!(self.bodies.len(), model.bodies().len(), "the workspace was made for another model");
        for (node, work) in model.nodes().iter().zip(&mut self.bodies) {
            (work.rotation, work.translation) = node.pose(q);
        }
    }
}

//! Inverse and forward dynamics (Featherstone, "Rigid Body Dynamics Algorithms", 2008).
//!
//! Each algorithm uses the cheaper of two coordinate systems. Newton-Euler runs in the frames of the bodies.
//! Algorithms with composite or articulated inertias run in *base coordinates*, which are the axes and origin
//! of the base. In base coordinates, adding the inertia of a child to its parent needs no transformation, and
//! the pose of a floating base cancels.

mod aba;
mod base_sweep;
mod contact;
mod coriolis;
mod crba;
mod crba_local;
mod derivatives;
mod external;
mod factor;
mod forward;
mod momentum;
mod recursion;
mod regressor;
mod rnea;

use nalgebra::DMatrix;

use crate::Model;
use crate::model::flat::Positions;
use crba_local::CrbaWorkspace;
use recursion::{Articulated, BodyDerivatives, Composite, Local};

pub use contact::{ConstrainedDynamics, ConstrainedError, Constraint};
pub use derivatives::Derivatives;
pub use external::Wrench;
pub use factor::{MassFactor, SingularMassMatrix};
pub use momentum::Momentum;
pub use regressor::PARAMETERS;

/// Workspace for the dynamics of one [`Model`]. Only [`new`](Self::new) allocates.
///
/// `q` has nq entries; `v`, `a` and `tau` have nv entries. Methods panic on any other length. `gravity` is
/// the gravitational acceleration in the world \[m/s2\], usually `(0, 0, -9.81)`. Joint damping, friction and
/// limits are not included. Rotors of drives are included as an armature on the diagonal of the mass matrix,
/// without gyroscopic effects.
///
/// ```
/// use motorium_robots::{Dynamics, load};
/// use nalgebra::Vector3;
///
/// let model = load("panda", std::path::Path::new("."))?.model;
/// let gravity = Vector3::new(0.0, 0.0, -9.81);
/// let (q, v, a) = (model.neutral(), vec![0.1; model.nv()], vec![1.0; model.nv()]);
/// let (mut tau, mut found) = (vec![0.0; model.nv()], vec![0.0; model.nv()]);
/// let mut dynamics = Dynamics::new(&model);
///
/// // The efforts for an acceleration, and the acceleration for these efforts.
/// dynamics.rnea(&model, &q, &v, &a, gravity, &mut tau);
/// dynamics.forward(&model, &q, &v, &tau, gravity, &mut found)?;
/// assert!(a.iter().zip(&found).all(|(a, found)| (a - found).abs() < 1e-8));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Dynamics {
    positions: Positions,
    /// Newton-Euler state, one per body, the base first.
    local: Vec<Local>,
    /// Recursions in base coordinates, likewise.
    composite: Vec<Composite>,
    articulated: Vec<Articulated>,
    crba: CrbaWorkspace,
    body_derivatives: Vec<BodyDerivatives>,
    mass: DMatrix<f64>,
    factor: MassFactor,
    zero: Vec<f64>,
    scratch: Vec<f64>,
}

impl Dynamics {
    /// Creates a workspace for `model`.
    pub fn new(model: &Model) -> Self {
        let slots = model.bodies().len() + 1;
        Self {
            positions: Positions::new(model.bodies().len()),
            local: vec![Local::START; slots],
            composite: vec![Composite::START; slots],
            body_derivatives: vec![BodyDerivatives::START; slots],
            crba: CrbaWorkspace::new(model.flat()),
            articulated: vec![Articulated::START; slots],
            mass: DMatrix::zeros(model.nv(), model.nv()),
            factor: MassFactor::new(model),
            zero: vec![0.0; model.nv()],
            scratch: vec![0.0; model.nv()],
        }
    }

    #[inline(always)]
    fn check(&self, model: &Model, q: &[f64]) {
        assert_eq!(q.len(), model.nq(), "length of q");
        assert_eq!(
            self.local.len(),
            model.bodies().len() + 1,
            "the workspace was made for a different model"
        );
    }

    #[inline(always)]
    fn set_positions(&mut self, model: &Model, q: &[f64]) {
        self.check(model, q);
        self.positions.update(&model.flat().nodes, q);
    }
}

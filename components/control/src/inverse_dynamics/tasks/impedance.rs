//! Springs and dampers as an alternative to rates: accelerations caused by forces.

use motorium_robots::{MassFactor, Model};
use nalgebra::{DMatrix, DVector, Vector3, Vector6};

use super::Feedback;
use crate::inverse_dynamics::InverseDynamics;

/// A spring and a damper that pull a frame to its target.
///
/// The task requests the acceleration caused by the forces `f = K e + D e'` at the frame without contacts: `J
/// M^-1 J' f`, from the torques `J' f`, instead of `kp e + kd e'`. A push `p` on the frame of a fixed-base
/// robot therefore displaces it by `p / K`, independently of its inertia. Choose stiffness and damping for
/// that inertia: with a step of `dt`, a damping beyond `2 / dt` times the inertia is unstable. Light wrists
/// have little inertia.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::{CartesianAcceleration, CartesianImpedance, Feedback};
/// use motorium_robots::load;
///
/// let iiwa = load("iiwa14", std::path::Path::new("."))?.model;
/// let hand = iiwa.frame("iiwa_link_ee")?;
/// let soft = CartesianImpedance { stiffness: 300.0, damping: 50.0, rotational_stiffness: 20.0, rotational_damping: 3.0 };
/// let task = CartesianAcceleration::new(&iiwa, hand, Feedback::critical(10.0)).impedance(soft);
/// # let _ = task;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianImpedance {
    /// Stiffness along each axis \[N/m\].
    pub stiffness: f64,
    /// Damping along each axis \[N s/m\].
    pub damping: f64,
    /// Stiffness about each axis \[N m/rad\].
    pub rotational_stiffness: f64,
    /// Damping about each axis \[N m s/rad\].
    pub rotational_damping: f64,
}

impl CartesianImpedance {
    /// Spring and damper of the position, and of the orientation, as a feedback in forces.
    pub(super) fn feedback(&self) -> [Feedback; 2] {
        [
            Feedback { kp: self.stiffness, kd: self.damping },
            Feedback { kp: self.rotational_stiffness, kd: self.rotational_damping },
        ]
    }
}

/// Accelerations caused by forces on a robot without contacts.
#[derive(Clone, Debug)]
pub(super) struct Mobility {
    factor: MassFactor,
    moving: DVector<f64>,
}

impl Mobility {
    pub(super) fn new(model: &Model) -> Self {
        Self { factor: MassFactor::new(model), moving: DVector::zeros(model.nv()) }
    }

    /// `J M^-1 J' f` of a wrench `f` at a frame with the Jacobian `J`; nothing for a robot without inertia
    /// somewhere.
    pub(super) fn of_frame(
        &mut self,
        dynamics: &InverseDynamics,
        jacobian: &DMatrix<f64>,
        force: &Vector3<f64>,
        torque: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let wrench = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        self.moving.gemv_tr(1.0, jacobian, &wrench, 0.0);
        if !self.solve(dynamics) {
            return (Vector3::zeros(), Vector3::zeros());
        }
        let mut found = Vector6::zeros();
        found.gemv(1.0, jacobian, &self.moving, 0.0);
        (found.fixed_rows::<3>(0).into(), found.fixed_rows::<3>(3).into())
    }

    fn solve(&mut self, dynamics: &InverseDynamics) -> bool {
        let factored = self.factor.factor(dynamics.mass()).is_ok();
        if factored {
            self.factor.solve(self.moving.as_mut_slice());
        }
        factored
    }
}

//! The workspace of one articulation.

use motorium_robots::{Dynamics, Kinematics, Momentum};
use nalgebra::DMatrix;

use super::actuators::Actuators;
use super::integrator::JointSpaceIntegrator;
use crate::contact::{ImpulseTarget, MovedByImpulses};
use crate::joint::JointProperties;
use crate::robot::{Articulation, RobotSetup};
use crate::{BuildError, Integrator};

/// The workspace of an articulation.
pub(super) struct Part {
    pub(super) integrator: JointSpaceIntegrator,
    pub(super) dynamics: Dynamics,
    /// Kinematics of the next state between the integration steps of a step.
    pub(super) kinematics: Kinematics,
    /// Generalized force of the rotors (nv).
    pub(super) rotor_force: Vec<f64>,
    /// Generalized external force during the next step (nv).
    pub(super) external: Vec<f64>,
    pub(super) actuators: Actuators,
    pub(super) frame_jacobian: DMatrix<f64>,
    /// Momentum at the start of an integration step in the air.
    pub(super) momentum: Option<Momentum>,
    /// True if the modes must be guessed again.
    pub(super) pending: bool,
    pub(super) settled: bool,
    /// Length of the next integration step \[s\]; zero if its step is complete.
    pub(super) h: f64,
    /// Joints whose effort was clamped in the step, and joints at a limit at its end.
    pub(super) saturated: usize,
    pub(super) at_limit: usize,
    /// Integration method of steps in which nothing touches the articulation.
    pub(super) method: Integrator,
}

impl Part {
    pub(super) fn new(
        own: &Articulation,
        setup: &RobotSetup,
        joints: &[JointProperties],
        method: Integrator,
    ) -> Result<Self, BuildError> {
        let model = own.model();
        Ok(Self {
            actuators: Actuators::new(setup, joints)?,
            integrator: JointSpaceIntegrator::new(model, joints.to_vec()),
            dynamics: Dynamics::new(model),
            kinematics: Kinematics::new(model),
            rotor_force: vec![0.0; model.nv()],
            external: vec![0.0; model.nv()],
            frame_jacobian: DMatrix::zeros(6, model.nv()),
            momentum: None,
            pending: false,
            settled: false,
            h: 0.0,
            saturated: 0,
            at_limit: 0,
            method,
        })
    }
}

impl Part {
    /// Clears the drive states left by the last steps.
    pub(super) fn forget_drives(&mut self) {
        self.integrator.forget();
        self.actuators.reset();
        self.external.fill(0.0);
    }
}

impl MovedByImpulses for Part {
    fn target(&mut self) -> ImpulseTarget<'_> {
        self.integrator.target()
    }
}

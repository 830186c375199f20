//! What a joint drive is told: setpoint, feed-forward effort and gains.

use motorium_robots::{Dynamics, Gains, Model};
use nalgebra::{DVector, Vector3};

use crate::JointSetpoint;

/// One command for every independent joint; the drive applies
/// `effort + kp (position - q) + kd (velocity - v)`.
#[derive(Clone, Debug, PartialEq)]
pub struct JointCommand {
    /// Position setpoint \[rad or m\].
    pub position: DVector<f64>,
    /// Velocity setpoint \[rad/s or m/s\].
    pub velocity: DVector<f64>,
    /// Feed-forward effort \[Nm or N\].
    pub effort: DVector<f64>,
    /// Stiffness \[Nm/rad or N/m\].
    pub kp: DVector<f64>,
    /// Damping \[Nms/rad or Ns/m\].
    pub kd: DVector<f64>,
}

/// Why a command cannot be composed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ComposeError {
    /// A gain array of another length than the robot.
    #[error("{what} has {found} entries, expected {expected}: one per independent joint")]
    Length {
        /// `kp` or `kd`.
        what: &'static str,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
    },
    /// A gain that is negative or not a number.
    #[error("{what} of joint \"{joint}\" is {value}, expected a finite number >= 0")]
    Gain {
        /// `kp` or `kd`.
        what: &'static str,
        /// The joint.
        joint: String,
        /// The offending gain.
        value: f64,
    },
}

/// Composes the command of one tick from a setpoint and the measured configuration.
#[derive(Clone, Debug)]
pub struct CommandComposer {
    gravity: Option<Vector3<f64>>,
    inertia: Option<Inertia>,
    dynamics: Dynamics,
    command: JointCommand,
}

/// What the compensation of inertia remembers.
#[derive(Clone, Debug)]
struct Inertia {
    /// Time constant of the acceleration, s.
    smoothing: f64,
    /// Velocity setpoint of the tick before, once there was one.
    velocity: DVector<f64>,
    known: bool,
    acceleration: DVector<f64>,
}

impl CommandComposer {
    /// For `model`, with `gains` and, if `gravity` \[m/s^2, world axes\] is given, its compensation.
    ///
    /// # Errors
    /// [`ComposeError`] names the gain that cannot be used.
    pub fn new(model: &Model, gains: &Gains, gravity: Option<Vector3<f64>>) -> Result<Self, ComposeError> {
        let zeros = DVector::zeros(model.nv());
        let command = JointCommand {
            position: zeros.clone(),
            velocity: zeros.clone(),
            effort: zeros.clone(),
            kp: zeros.clone(),
            kd: zeros,
        };
        let mut composer = Self { gravity, inertia: None, dynamics: Dynamics::new(model), command };
        composer.set_gains(model, gains)?;
        Ok(composer)
    }

    /// Adds what it takes to accelerate the robot as the setpoint does, and to hold it against centrifugal and Coriolis
    /// forces: `effort = M(q) a + C(q, v) v + g(q)`, with `v` the velocity setpoint and `a` its rate, smoothed over the
    /// time constant `smoothing` \[s\] so that the noise of a setpoint found from measurements is not amplified.
    #[must_use]
    pub fn with_inertia(mut self, smoothing: f64) -> Self {
        let zeros = self.command.velocity.map(|_| 0.0);
        self.inertia =
            Some(Inertia { smoothing, velocity: zeros.clone(), known: false, acceleration: zeros });
        self
    }

    /// Takes over how the setpoint moves, once per tick of `dt` \[s\] and before [`compose`](Self::compose). Without
    /// [`with_inertia`](Self::with_inertia) it does nothing.
    pub fn follow(&mut self, setpoint: &JointSetpoint, dt: f64) {
        let Some(inertia) = &mut self.inertia else { return };
        let share = if inertia.known { dt / (dt + inertia.smoothing) } else { 0.0 };
        let moving = inertia.velocity.iter_mut().zip(setpoint.velocity());
        for (acceleration, (before, now)) in inertia.acceleration.iter_mut().zip(moving) {
            *acceleration += share * ((now - *before) / dt - *acceleration);
            *before = *now;
        }
        inertia.known = true;
    }

    /// Forgets how the setpoint moved: it begins anew, at rest.
    pub fn rest(&mut self) {
        if let Some(inertia) = &mut self.inertia {
            inertia.known = false;
            inertia.acceleration.fill(0.0);
        }
    }

    /// Changes the gains from the next command on.
    ///
    /// # Errors
    /// [`ComposeError`] names the gain that cannot be used; the previous ones stay.
    pub fn set_gains(&mut self, model: &Model, gains: &Gains) -> Result<(), ComposeError> {
        for (what, gains) in [("kp", &gains.kp), ("kd", &gains.kd)] {
            let (found, expected) = (gains.len(), model.nv());
            if found != expected {
                return Err(ComposeError::Length { what, found, expected });
            }
            if let Some(index) = gains.iter().position(|gain| !gain.is_finite() || *gain < 0.0) {
                let joint = model.joint_names()[index].clone();
                return Err(ComposeError::Gain { what, joint, value: gains[index] });
            }
        }
        self.command.kp.copy_from(&gains.kp);
        self.command.kd.copy_from(&gains.kd);
        Ok(())
    }

    /// The command that follows `setpoint` at the measured joint positions `q` \[rad or m\]. The feed-forward effort
    /// is taken at `q` and kept within the model's effort limits.
    ///
    /// # Panics
    /// If `q` has not one entry per independent joint.
    pub fn compose(&mut self, model: &Model, q: &[f64], setpoint: &JointSetpoint) -> &JointCommand {
        self.command.position.copy_from_slice(setpoint.position());
        self.command.velocity.copy_from_slice(setpoint.velocity());
        let effort = self.command.effort.as_mut_slice();
        match (&self.inertia, self.gravity) {
            (Some(inertia), gravity) => {
                let (v, a) = (setpoint.velocity(), inertia.acceleration.as_slice());
                self.dynamics.rnea(model, q, v, a, gravity.unwrap_or_default(), effort);
            }
            (None, Some(gravity)) => self.dynamics.gravity(model, q, gravity, effort),
            (None, None) => return &self.command,
        }
        for (effort, limit) in self.command.effort.iter_mut().zip(model.effort_limit()) {
            *effort = effort.max(-limit).min(*limit);
        }
        &self.command
    }

    /// The last command.
    pub fn command(&self) -> &JointCommand {
        &self.command
    }
}

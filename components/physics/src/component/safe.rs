//! The safe states of the drives, in force when no command may be applied.

use motorium::plan::SafeState;
use motorium_robots::{Dynamics, Model, Profile};

use crate::{JointCommand, Simulator};

/// Damping of the brake \[Nms/rad or Ns/m\]: so large that the effort limit acts until the joint stands.
const BRAKE: f64 = 1e6;

/// A joint slower than this counts as standing \[rad/s or m/s\].
const STANDS: f64 = 1e-3;

/// The safe state in force and the gains it holds with.
pub(super) struct SafeStates {
    /// Gains where the last command had none, per joint: those of the robot's profile.
    gains: Vec<(f64, f64)>,
    in_force: Option<SafeState>,
    gravity: Vec<f64>,
}

impl SafeStates {
    pub(super) fn new(simulation: &dyn Simulator, profile: Option<&Profile>) -> Self {
        let model: &Model = simulation.model();
        let mut gains: Vec<_> = match profile.and_then(|profile| profile.gains(model).ok()) {
            Some(gains) => gains.kp.iter().copied().zip(gains.kd.iter().copied()).collect(),
            None => model.effort_limit().iter().map(|limit| default_gains(*limit)).collect(),
        };
        // Rotors hold nothing in place.
        gains.resize(simulation.joint_names().len(), (0.0, 0.0));
        Self { gains, in_force: None, gravity: vec![0.0; model.nv()] }
    }

    /// Holds each joint of a braked robot that has come to stand.
    fn hold_what_stands(&self, simulation: &mut dyn Simulator) {
        for (i, (kp, kd)) in self.gains.iter().copied().enumerate() {
            let (position, velocity) = (simulation.positions()[i], simulation.velocities()[i]);
            let effort = self.effort(simulation.model(), i);
            let command = &mut simulation.commands_mut()[i];
            if command.kp == 0.0 && velocity.abs() < STANDS {
                *command = JointCommand { effort, ..JointCommand::hold(position, kp, kd) };
            }
        }
    }

    /// Effort of drive `i` against gravity \[Nm or N\]; zero for a rotor.
    fn effort(&self, model: &Model, i: usize) -> f64 {
        model.joints_of_v(&self.gravity).get(i).copied().unwrap_or(0.0)
    }

    /// Leaves the safe state: a command was applied.
    pub(super) fn leave(&mut self) {
        self.in_force = None;
    }

    /// Puts the drives into the safe state `state` at its first step, and leaves them there. Without a state (a command
    /// that cannot be followed), they hold.
    pub(super) fn apply(
        &mut self,
        state: Option<SafeState>,
        simulation: &mut dyn Simulator,
        dynamics: &mut Dynamics,
    ) {
        // A command that cannot be followed leaves a safe state as it is.
        let state = state.or(self.in_force).unwrap_or(SafeState::Hold);
        if self.in_force == Some(state) {
            if state == SafeState::Brake {
                self.hold_what_stands(simulation);
            }
            return;
        }
        self.in_force = Some(state);
        let g = simulation.gravity();
        dynamics.gravity(simulation.model(), simulation.configuration(), g, &mut self.gravity);
        for (i, (kp, kd)) in self.gains.iter().copied().enumerate() {
            let position = simulation.positions()[i];
            let effort = self.effort(simulation.model(), i);
            let command = &mut simulation.commands_mut()[i];
            *command = match state {
                // With gravity compensation, or soft gains would let the arm sag.
                SafeState::Hold => {
                    let (kp, kd) = if command.kp > 0.0 { (command.kp, command.kd) } else { (kp, kd) };
                    JointCommand { effort, ..JointCommand::hold(position, kp, kd) }
                }
                SafeState::Damp => JointCommand { kd, ..JointCommand::default() },
                SafeState::ZeroTorque => JointCommand::default(),
                SafeState::Brake => JointCommand { kd: BRAKE, effort, ..JointCommand::default() },
            };
        }
    }
}

/// For a robot without gains: full effort at a twentieth of a radian (or metre), and a tenth of that per second.
fn default_gains(effort_limit: f64) -> (f64, f64) {
    let kp = if effort_limit.is_finite() { 20.0 * effort_limit } else { 1000.0 };
    (kp, 0.1 * kp)
}

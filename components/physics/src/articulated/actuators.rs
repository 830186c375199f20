//! Non-ideal actuators of drives.

use core::ops::Range;

use motorium_robots::{
    Actuator, ActuatorError, ActuatorNetwork, ActuatorSettings, Delay, DriveCommand, Motor,
};

use super::integrator::JointSpaceIntegrator;
use crate::joint::JointProperties;
use crate::robot::{Robot, RobotSetup};
use crate::{BuildError, JointSetpoint};

/// The non-ideal actuators of a robot. A robot without any costs no computation.
#[derive(Clone, Debug, Default)]
pub(super) struct Actuators {
    joints: Vec<Driven>,
    /// Commands forwarded by the actuators, one per joint.
    commands: Vec<JointSetpoint>,
}

/// A joint with an actuator.
#[derive(Clone, Debug)]
struct Driven {
    joint: usize,
    settings: ActuatorSettings,
    /// States at the start of the step, and after its completed part.
    now: Actuator,
    next: Actuator,
    delay: Delay<JointSetpoint>,
    network: Option<ActuatorNetwork>,
    /// Position error and velocity that the network measured at the start of the step.
    measured: [f64; 2],
    /// The command that the drive follows during the step.
    acting: JointSetpoint,
    /// The command at the motor in the current integration step.
    at_motor: DriveCommand,
}

/// The state of [`Actuators`] that later steps depend on.
#[derive(Clone, Debug)]
pub(super) struct ActuatorsState(Vec<(Actuator, Delay<JointSetpoint>, Option<ActuatorNetwork>)>);

impl Actuators {
    /// Creates the actuators in `setup` for joints with the properties `joints`.
    pub(super) fn new(setup: &RobotSetup, joints: &[JointProperties]) -> Result<Self, BuildError> {
        let mut driven = Vec::new();
        for ((joint, settings), properties) in setup.actuators.iter().enumerate().zip(joints) {
            let Some(settings) = settings else { continue };
            let joint_name = || setup.model.joint_names()[joint].clone();
            let actuator = Actuator::new(settings, properties.effort_limit)
                .map_err(|error| BuildError::Actuator { joint: joint_name(), error })?;
            let delay = Delay::new(settings.delay, JointSetpoint::default());
            let network = settings.network.clone().map(ActuatorNetwork::new);
            driven.push(Driven {
                joint,
                settings: settings.clone(),
                now: actuator,
                next: actuator,
                delay,
                network,
                measured: [0.0; 2],
                acting: JointSetpoint::default(),
                at_motor: DriveCommand::effort(0.0),
            });
        }
        let commands = if driven.is_empty() { 0 } else { joints.len() };
        Ok(Self { joints: driven, commands: vec![JointSetpoint::default(); commands] })
    }

    /// Returns the settings, one per joint; empty if all actuators are ideal.
    pub(super) fn settings(&self) -> Vec<Option<ActuatorSettings>> {
        let mut settings = vec![None; self.commands.len()];
        self.joints.iter().for_each(|driven| settings[driven.joint] = Some(driven.settings.clone()));
        settings
    }

    /// Changes the settings of the existing actuators. Their networks, efforts, heat and delayed commands are
    /// kept.
    pub(super) fn set_settings(
        &mut self,
        settings: &[Option<ActuatorSettings>],
    ) -> Result<(), ActuatorError> {
        for driven in &mut self.joints {
            let Some(Some(settings)) = settings.get(driven.joint) else { continue };
            driven.now.set_settings(settings)?;
            if driven.settings.delay != settings.delay {
                driven.delay.set_delay(settings.delay);
            }
            driven.settings.clone_from(settings);
        }
        Ok(())
    }

    /// Changes the effort limits.
    pub(super) fn set_limits(&mut self, joints: &[JointProperties]) {
        for driven in &mut self.joints {
            driven.now.set_limit(joints[driven.joint].effort_limit);
        }
    }

    pub(super) fn reset(&mut self) {
        for driven in &mut self.joints {
            driven.now.reset();
            driven.delay.reset();
            if let Some(network) = &mut driven.network {
                network.reset();
            }
        }
    }

    /// Returns `true` if a motor moves relative to its joint.
    pub(super) fn have_drivetrains(&self) -> bool {
        self.joints.iter().any(|driven| driven.now.drivetrain().is_some())
    }

    /// Begins a step of `drives`: selects the commands that act during the step and evaluates the networks.
    pub(super) fn begin(&mut self, robot: &Robot, drives: &Range<usize>) {
        let (q, v) = (&robot.positions()[drives.clone()], &robot.velocities()[drives.clone()]);
        let commands = &robot.commands[drives.clone()];
        for driven in &mut self.joints {
            let joint = Motor { position: q[driven.joint], velocity: v[driven.joint] };
            driven.next = driven.now;
            driven.next.begin(joint);
            driven.acting = driven.delay.acting(commands[driven.joint]);
            let Driven { acting, next, measured, network, .. } = driven;
            let Some(network) = network else { continue };
            // The drive measures its motor. A command without `kp` has no position setpoint, so the error is
            // zero.
            let Motor { position, velocity } = next.motor().unwrap_or(joint);
            let error = if acting.kp > 0.0 { acting.position - position } else { 0.0 };
            *measured = [error, velocity];
            let effort = network.effort(error, velocity);
            let wanted = if acting.kp > 0.0 { acting.effort + effort } else { acting.effort };
            *acting = JointSetpoint { effort: wanted, kp: 0.0, kd: 0.0, ..*acting };
        }
    }

    /// Returns the commands forwarded by the actuators for an integration step of `h` \[s\] from the joint
    /// positions `q` and velocities `v`. Also sets the effort bounds of that step.
    pub(super) fn pass<'a>(
        &'a mut self,
        commands: &'a [JointSetpoint],
        (q, v, h): (&[f64], &[f64], f64),
        integrator: &mut JointSpaceIntegrator,
    ) -> &'a [JointSetpoint] {
        if self.joints.is_empty() {
            return commands;
        }
        self.commands.copy_from_slice(commands);
        for Driven { joint, next, acting, at_motor, .. } in &mut self.joints {
            let law = next.law(v[*joint], h);
            *at_motor = drive_command(acting, integrator.joints()[*joint].effort_limit);
            let state = Motor { position: q[*joint], velocity: v[*joint] };
            if let Some(law) = next.joint_law(at_motor, state, h) {
                // The drive brakes its motor, not the joint.
                self.commands[*joint] =
                    JointSetpoint { effort: law.effort, kd: law.slope, ..JointSetpoint::default() };
                integrator.set_bounds(*joint, [law.low, law.high]);
                continue;
            }
            // A fraction of the whole law, plus a term that does not depend on the end of the step.
            self.commands[*joint] = JointSetpoint {
                effort: law.share * acting.effort + law.carried,
                kp: law.share * acting.kp,
                kd: law.share * acting.kd,
                ..*acting
            };
            integrator.set_bounds(*joint, [law.low, law.high]);
        }
        &self.commands
    }

    /// Records the efforts of an integration step of `h` \[s\].
    pub(super) fn apply(&mut self, efforts: &[f64], h: f64) {
        for Driven { joint, next, at_motor, .. } in &mut self.joints {
            if next.drivetrain().is_some() {
                next.apply_load(at_motor, efforts[*joint], h);
            } else {
                next.apply(efforts[*joint], h);
            }
        }
    }

    /// Ends a step of `dt` \[s\] that ran with `commands`.
    pub(super) fn commit(&mut self, commands: &[JointSetpoint], dt: f64) {
        for driven in &mut self.joints {
            driven.now = driven.next;
            driven.delay.advance(commands[driven.joint], dt);
            let [error, velocity] = driven.measured;
            if let Some(network) = &mut driven.network {
                network.advance(error, velocity, dt);
            }
        }
    }

    pub(super) fn save(&self) -> ActuatorsState {
        let saved = |driven: &Driven| (driven.now, driven.delay.clone(), driven.network.clone());
        ActuatorsState(self.joints.iter().map(saved).collect())
    }

    /// Restores a saved state. Returns `false` if the state is from different actuators. Effort limits and
    /// settings are not part of the state and do not change.
    pub(super) fn restore(&mut self, state: &ActuatorsState) -> bool {
        let fits = state.0.len() == self.joints.len();
        if fits {
            for (driven, (now, delay, network)) in self.joints.iter_mut().zip(&state.0) {
                driven.now.resume(now);
                (driven.delay, driven.network) = (delay.clone(), network.clone());
                driven.delay.set_delay(driven.settings.delay);
            }
        }
        fits
    }
}

/// Converts the command of a drive with this effort limit into a command at its motor.
fn drive_command(command: &JointSetpoint, limit: f64) -> DriveCommand {
    let JointSetpoint { position, velocity, effort, kp, kd, min_velocity, max_velocity, .. } = *command;
    DriveCommand {
        position,
        velocity,
        effort,
        kp,
        kd,
        velocity_limits: [min_velocity, max_velocity],
        braking: command.braking_slope(limit.abs()),
    }
}

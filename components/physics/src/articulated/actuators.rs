//! The actuators of the drives that are not ideal.

use motorium_robots::{Actuator, Delay};

use super::integrator::JointSpaceIntegrator;
use crate::joint::JointProperties;
use crate::robot::RobotSetup;
use crate::{BuildError, JointCommand};

/// The actuators of a robot. Without any, nothing is computed.
#[derive(Clone, Debug, Default)]
pub(super) struct Actuators {
    joints: Vec<Driven>,
    /// The commands as the actuators pass them on, one per joint.
    commands: Vec<JointCommand>,
}

/// A joint with an actuator.
#[derive(Clone, Debug)]
struct Driven {
    joint: usize,
    /// Before the step, and after the part of it that is done.
    now: Actuator,
    next: Actuator,
    delay: Delay<JointCommand>,
}

/// The state of [`Actuators`] that later steps depend on.
#[derive(Clone, Debug)]
pub(super) struct ActuatorsState(Vec<(Actuator, Delay<JointCommand>)>);

impl Actuators {
    /// Those of the setup, for joints with these properties.
    pub(super) fn new(setup: &RobotSetup, joints: &[JointProperties]) -> Result<Self, BuildError> {
        let mut driven = Vec::new();
        for ((joint, settings), properties) in setup.actuators.iter().enumerate().zip(joints) {
            let Some(settings) = settings else { continue };
            let joint_name = || setup.model.joint_names()[joint].clone();
            let actuator = Actuator::new(settings, properties.effort_limit)
                .map_err(|error| BuildError::Actuator { joint: joint_name(), error })?;
            let delay = Delay::new(settings.delay, JointCommand::default());
            driven.push(Driven { joint, now: actuator, next: actuator, delay });
        }
        let commands = if driven.is_empty() { 0 } else { joints.len() };
        Ok(Self { joints: driven, commands: vec![JointCommand::default(); commands] })
    }

    /// Takes over other effort limits.
    pub(super) fn set_limits(&mut self, joints: &[JointProperties]) {
        for driven in &mut self.joints {
            driven.now.set_limit(joints[driven.joint].effort_limit);
        }
    }

    pub(super) fn reset(&mut self) {
        for driven in &mut self.joints {
            driven.now.reset();
            driven.delay.reset();
        }
    }

    /// Begins a step.
    pub(super) fn begin(&mut self) {
        self.joints.iter_mut().for_each(|driven| driven.next = driven.now);
    }

    /// The commands of an integration step of `h` \[s\] that begins with the joint velocities `v`, as far as the actuators pass
    /// them on, and the bounds of the efforts in it.
    pub(super) fn pass<'a>(
        &'a mut self,
        commands: &'a [JointCommand],
        (v, h): (&[f64], f64),
        integrator: &mut JointSpaceIntegrator,
    ) -> &'a [JointCommand] {
        if self.joints.is_empty() {
            return commands;
        }
        self.commands.copy_from_slice(commands);
        for Driven { joint, next, delay, .. } in &self.joints {
            let command = delay.acting(commands[*joint]);
            let law = next.law(v[*joint], h);
            // A share of the whole law, and a part that does not depend on the end of the step.
            self.commands[*joint] = JointCommand {
                effort: law.share * command.effort + law.carried,
                kp: law.share * command.kp,
                kd: law.share * command.kd,
                ..command
            };
            integrator.set_bounds(*joint, [law.low, law.high]);
        }
        &self.commands
    }

    /// Takes in the efforts of an integration step of `h` \[s\].
    pub(super) fn apply(&mut self, efforts: &[f64], h: f64) {
        for Driven { joint, next, .. } in &mut self.joints {
            next.apply(efforts[*joint], h);
        }
    }

    /// Ends a step of `dt` \[s\] in which `commands` were given.
    pub(super) fn commit(&mut self, commands: &[JointCommand], dt: f64) {
        for driven in &mut self.joints {
            driven.now = driven.next;
            driven.delay.advance(commands[driven.joint], dt);
        }
    }

    pub(super) fn save(&self) -> ActuatorsState {
        ActuatorsState(self.joints.iter().map(|driven| (driven.now, driven.delay.clone())).collect())
    }

    /// Goes back to a saved state; `false` where it is that of other actuators.
    pub(super) fn restore(&mut self, state: &ActuatorsState) -> bool {
        let fits = state.0.len() == self.joints.len();
        if fits {
            for (driven, (now, delay)) in self.joints.iter_mut().zip(&state.0) {
                (driven.now, driven.delay) = (*now, delay.clone());
            }
        }
        fits
    }
}

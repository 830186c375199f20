//! Inner loops of the drives.

use motorium::declare::StepError;
use motorium_robots::Motor;

use super::DriveSimulation;
use super::actuation::{BRAKE, Effort};

impl DriveSimulation {
    /// Runs the inner loop of every drive on the newest state of its joint, `h` \[s\] after the previous one.
    pub(super) fn run_loops(&mut self, now_ns: u64, h: f64) -> Result<(), StepError> {
        let Some(state) = self.joint_state.latest() else { return Ok(()) };
        let joints = self.axes.len();
        if state.count() != joints {
            let message = format!("joint state: expected {joints} joints, found {}", state.count());
            return Err(StepError::failed(message));
        }
        let mut command = self.command.loan()?;
        command.set_count(joints);
        command.position_mut().fill(0.0);
        command.velocity_mut().fill(0.0);
        command.kp_mut().fill(0.0);
        for (i, axis) in self.axes.iter_mut().enumerate() {
            let joint = Motor { position: state.position()[i], velocity: state.velocity()[i] };
            let load = state.effort()[i];
            let motor = axis.actuation.as_mut().map_or(joint, |actuation| actuation.motor(joint, load, h));
            let position = axis.gear.to_drive(motor.position);
            let torque = axis.drive.step(position, motor.velocity * axis.gear.ratio, now_ns);
            let wanted = torque * axis.gear.ratio;
            let is_braked = self.config.brakes && !axis.drive.has_torque();
            let brake = if is_braked { BRAKE } else { 0.0 };
            let ideal = Effort { effort: wanted, damping: brake };
            let actuation = axis.actuation.as_mut();
            let Effort { effort, damping } =
                actuation.map_or(ideal, |actuation| actuation.effort(wanted, brake, joint, h));
            (command.effort_mut()[i], command.kd_mut()[i]) = (effort, damping);
        }
        command.publish()
    }
}

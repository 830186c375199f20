//! Rounding of commands to the resolution of their fields.

use super::codec::Drive;
use crate::drive::Command;

/// Rounding of one drive's commands, with compensation by the torque field.
///
/// The fields of a command have 12 or 16 bits, and no integer represents a velocity or torque of exactly
/// zero. Rounding each field separately would permanently deflect a joint by half a torque step over its
/// stiffness. Instead, the torque field compensates the rounding of positions, velocities and gains at the
/// newest state of the drive. The rounding error of the torque is added to the torque of the next cycle
/// (error diffusion). The mean torque is therefore exact, and each individual torque is off by at most one
/// step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rounding {
    /// Accumulated torque that has not been sent, N m.
    rest: f64,
}

impl Rounding {
    /// Returns the command to send at this position \[rad\] and velocity \[rad/s\] of the drive. Without a
    /// state, the command is not compensated. Values beyond a range are clamped without compensation.
    pub(super) fn command(&mut self, wanted: &Command, drive: &Drive, state: Option<(f64, f64)>) -> Command {
        let Some((position, velocity)) = state else { return *wanted };
        let (ranges, fields) = (drive.ranges(), drive.fields());
        let wanted = ranges.clamped(wanted);
        let rounded = fields.rounded(&wanted);
        let lost = wanted.torque_at(position, velocity) - rounded.torque_at(position, velocity);
        let torque = rounded.torque + lost + self.rest;
        let sent = Command { torque, ..rounded };
        let step = ranges.torque.resolution(12);
        self.rest = (torque - fields.rounded(&sent).torque).clamp(-step, step);
        sent
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::Ranges;

    const STATE: (f64, f64) = (0.731_3, -0.117);

    fn ranges() -> Ranges {
        Ranges::new(12.5, 30.0, 10.0)
    }

    fn drive() -> Drive {
        Drive::damiao(1, 0x11, ranges())
    }

    fn wanted() -> Command {
        Command { position: 0.753_1, velocity: 0.041, kp: 61.7, kd: 1.234, torque: 0.777 }
    }

    /// Torques that a drive applies at `STATE` for this command, cycle by cycle.
    fn torques(wanted: Command) -> impl Iterator<Item = f64> {
        let mut rounding = Rounding::default();
        std::iter::repeat_with(move || {
            let sent = rounding.command(&wanted, &drive(), Some(STATE));
            drive().fields().rounded(&sent).torque_at(STATE.0, STATE.1)
        })
    }

    #[test]
    fn mean_torque_matches_the_command_within_one_step() {
        for command in [wanted(), Command::default(), Command { kp: 0.0, kd: 0.0, ..wanted() }] {
            let (goal, step) = (command.torque_at(STATE.0, STATE.1), ranges().torque.resolution(12));
            let torques: Vec<f64> = torques(command).take(1000).collect();
            let mean = torques.iter().sum::<f64>() / 1000.0;
            assert!((mean - goal).abs() <= step / 1000.0, "{mean} instead of {goal}");
            assert!(torques.iter().all(|torque| (torque - goal).abs() <= step), "{goal}: {torques:?}");
        }
    }

    #[test]
    fn separate_rounding_leaves_a_permanent_torque_error() {
        let (goal, rounded) = (wanted().torque_at(STATE.0, STATE.1), drive().fields().rounded(&wanted()));
        assert!((rounded.torque_at(STATE.0, STATE.1) - goal).abs() > 0.2 * ranges().torque.resolution(12));
    }

    #[test]
    fn clamped_torque_is_not_compensated_later() {
        let strong = Command { torque: 14.0, ..Command::default() };
        assert!(torques(strong).take(100).all(|torque| (torque - 10.0).abs() < 0.02));
        let stiff = Command { kp: 900.0, ..wanted() };
        let goal = Command { kp: 500.0, ..wanted() }.torque_at(STATE.0, STATE.1);
        assert!(torques(stiff).take(100).all(|torque| torque <= goal.min(20.0) + 0.02));
        // no error remains after the clamping ends
        let mut rounding = Rounding::default();
        for _ in 0..100 {
            rounding.command(&strong, &drive(), Some(STATE));
        }
        assert!(rounding.rest.abs() <= ranges().torque.resolution(12));
    }

    #[test]
    fn without_a_state_commands_are_not_compensated() {
        assert_eq!(Rounding::default().command(&wanted(), &drive(), None), wanted());
    }
}

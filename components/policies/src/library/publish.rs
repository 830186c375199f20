//! Publication of a step.

use motorium::declare::StepError;
use motorium::state::PoseTarget;
use nalgebra::Vector3;

use super::LibraryPolicy;
use super::episode::{Stage, ease};

impl LibraryPolicy {
    /// Publishes the current setpoint: in a movement, in transit to the next, or at rest.
    pub(super) fn publish(&mut self) -> Result<(), StepError> {
        let transit = match self.stage {
            Stage::Transit(time) => time / self.transit,
            _ => 1.0,
        };
        let [part, slope] = ease(transit);
        let in_movement =
            matches!(self.stage, Stage::Moving | Stage::Finished | Stage::Rest { after: true, .. });
        let frame = &self.current.frame;
        let joints = self.end_effector.is_none();
        for d in 0..self.position.len() {
            (self.position[d], self.velocity[d]) = match (in_movement, joints) {
                (true, _) => (self.generator.position()[d], self.generator.velocity()[d]),
                (false, true) => {
                    let way = frame.start[d] - self.from[d];
                    (self.from[d] + part * way, slope / self.transit * way)
                }
                (false, false) => (frame.start[d], 0.0),
            };
        }
        if let Some(setpoint) = &mut self.setpoint {
            let mut out = setpoint.loan()?;
            out.set_count(self.position.len());
            out.position_mut().copy_from_slice(&self.position);
            out.velocity_mut().copy_from_slice(&self.velocity);
            out.effort_mut().fill(0.0);
            return out.publish();
        }
        let (Some((_, plane)), Some(target)) = (&self.end_effector, &mut self.target) else { return Ok(()) };
        let mut point = plane.point(&self.position, self.index);
        let mut velocity = plane.velocity(&self.velocity);
        if !in_movement {
            // off the plane and back, in addition to the straight line
            let from = Vector3::new(self.from[0], self.from[1], self.from[2]);
            let (way, off) = (point - from, plane.normal() * plane.lift);
            let (bump, bump_slope) = (4.0 * part * (1.0 - part), 4.0 * (1.0 - 2.0 * part) * slope);
            point = from + way * part + off * bump;
            velocity = (way * slope + off * bump_slope) / self.transit;
        }
        self.published = point;
        let mut out = target.loan()?;
        *out = PoseTarget {
            position: point.into(),
            orientation: self.orientation.coords.into(),
            linear_velocity: velocity.into(),
            angular_velocity: [0.0; 3],
            goal: self.begun + 1,
            at_goal: u64::from(matches!(self.stage, Stage::Finished)),
        };
        out.publish()
    }
}

//! Goals of the fingers, which move together with the end effector.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{ConfigError, Declare, StepError};
use motorium::state::MotionGoal;
use motorium::transport::Output;

use super::waypoints::Waypoints;

/// Name of the output.
const PORT: &str = "fingers";

/// Publishes the gripper position of each goal when the movement to it starts.
#[derive(Debug)]
pub(super) struct FingerOutput {
    output: Output<MotionGoal>,
    /// Number of started goals whose grippers were published.
    published: u64,
}

impl FingerOutput {
    pub(super) fn declare(waypoints: &Waypoints, declare: &mut Declare) {
        if waypoints.has_grippers() {
            declare
                .output::<MotionGoal>(PORT, "positions of the fingers' joints, for each goal with a gripper");
        }
    }

    /// Returns `None` if no goal has a gripper.
    pub(super) fn open(waypoints: &Waypoints, setup: &mut Setup) -> Result<Option<Self>, ConfigureError> {
        if !waypoints.has_grippers() {
            return Ok(None);
        }
        let output = setup.output::<MotionGoal>(PORT)?;
        if !output.is_wired() {
            let message = format!("goals have a `gripper`, but the output `{PORT}` is not wired");
            let advice =
                format!("add `{PORT} = \"TOPIC\"` to `publish`, and to `subscribe` of the controller");
            return Err(ConfigError::key("goals", message).advise(advice).into());
        }
        Ok(Some(Self { output, published: 0 }))
    }

    /// Publishes the newest gripper of the goals that have started since the last call. `segment` is the
    /// current segment, `goals` the number of started goals. A speed factor above 1 shortens the motion.
    pub(super) fn publish(
        &mut self,
        waypoints: &Waypoints,
        segment: usize,
        goals: u64,
        speed: f64,
    ) -> Result<(), StepError> {
        let started = goals.saturating_sub(std::mem::replace(&mut self.published, goals));
        let Some((positions, duration)) = waypoints.fingers(segment, started) else { return Ok(()) };
        let mut goal = self.output.loan()?;
        *goal = MotionGoal::new(goals);
        goal.duration = duration.as_secs_f64() / speed.max(1.0);
        for (joint, position) in positions {
            goal.set_joint(*joint, *position);
        }
        goal.publish()
    }

    /// Starts over with the first goal.
    pub(super) fn reset(&mut self) {
        self.published = 0;
    }
}

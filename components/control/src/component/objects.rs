//! The objects of the world that limits keep links away from, as they move.

use motorium::prelude::*;
use motorium::state::ObjectPoses;
use motorium_robots::Object;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::config::QpControllerConfig;
use super::setup::ControllerSetup;
use crate::limits::RowLimit;

/// Name of the input.
pub(super) const INPUT: &str = "object_poses";

/// The poses of the objects, for limits that need them.
pub(super) struct MovingObjects {
    /// `None` where no limit is about an object that moves.
    input: Option<Input<ObjectPoses>>,
    /// Pose of each object of the world at the start.
    starts: Vec<Isometry3<f64>>,
}

impl MovingObjects {
    /// Declares the input where a limit needs it.
    pub(super) fn declare(config: &QpControllerConfig, parts: &ControllerSetup, declare: &mut Declare) {
        if Self::are_needed(config, parts) {
            declare.input::<ObjectPoses>(
                INPUT,
                "poses of the objects of the world that the links keep away from",
            );
        }
    }

    /// Opens it.
    pub(super) fn configure(
        config: &QpControllerConfig,
        parts: &ControllerSetup,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let input = if Self::are_needed(config, parts) { Some(setup.input(INPUT)?) } else { None };
        Ok(Self { input, starts: parts.world.objects.iter().map(Object::pose).collect() })
    }

    fn are_needed(config: &QpControllerConfig, parts: &ControllerSetup) -> bool {
        let world = &parts.world;
        config.limits.collision.as_ref().is_some_and(|collision| collision.has_moving_objects(world))
            || parts.tasks(0.0).any(|(_, task)| task.has_moving_objects(world))
    }

    /// Moves the obstacles of the limits that `each` visits, if there is a newer message. Before the first one the objects stand where
    /// the world has them.
    pub(super) fn update(
        &mut self,
        mut each: impl FnMut(&mut dyn FnMut(&mut dyn RowLimit)),
    ) -> Result<(), StepError> {
        let Some(poses) = self.input.as_mut().and_then(Input::next_unread) else { return Ok(()) };
        for index in 0..poses.count() {
            let object = poses.object()[index] as usize;
            if object >= self.starts.len() {
                return Err(StepError::failed("the poses of objects are those of another world"));
            }
            let position = [poses.position_x()[index], poses.position_y()[index], poses.position_z()[index]];
            let orientation = Quaternion::new(
                poses.orientation_w()[index],
                poses.orientation_x()[index],
                poses.orientation_y()[index],
                poses.orientation_z()[index],
            );
            // half the length of a unit quaternion is no rounding error
            let Some(rotation) = UnitQuaternion::try_new(orientation, 0.5) else {
                return Err(StepError::failed("the orientation of an object is no unit quaternion"));
            };
            let pose = Isometry3::from_parts(Translation3::from(position), rotation);
            each(&mut |limit| limit.move_object(object, &pose));
        }
        Ok(())
    }

    /// Puts the obstacles back to where the world has them, for a new episode.
    pub(super) fn reset(&mut self, mut each: impl FnMut(&mut dyn FnMut(&mut dyn RowLimit))) {
        for (object, pose) in self.starts.iter().enumerate().filter(|_| self.input.is_some()) {
            each(&mut |limit| limit.move_object(object, pose));
        }
    }
}

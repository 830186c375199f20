//! The objects of the world that limits keep links away from, as they move.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use motorium::prelude::*;
use motorium::state::ObjectPoses;
use motorium_robots::Object;
use nalgebra::Isometry3;
use serde_json::{Value, json};

use super::checks::pose_of;
use super::config::QpControllerConfig;
use super::setup::ControllerSetup;
use crate::limits::RowLimit;

/// Name of the input.
pub(super) const INPUT: &str = "object_poses";

/// Time between two looks of the helper thread at what was refused.
const LOOK: Duration = Duration::from_millis(50);

/// The poses of the objects, for limits that need them. The controller refuses an invalid pose, one with a number that is not finite or with an
/// orientation that is no unit quaternion: for the limits the object stays where its last valid pose was.
pub(super) struct MovingObjects {
    /// `None` where no limit is about an object that moves.
    input: Option<Input<ObjectPoses>>,
    /// Pose of each object of the world at the start.
    starts: Vec<Isometry3<f64>>,
    refusals: Arc<Refusals>,
    /// Poses that were refused in this episode, and the first of them.
    refused: u64,
    first: Option<Refused>,
}

/// An invalid pose that was refused, and the object it was of.
#[derive(Clone, Copy, Debug)]
struct Refused {
    object: usize,
    position: [f64; 3],
    /// x, y, z, w.
    orientation: [f64; 4],
}

/// Numbers of poses that were refused so far, between the steps and the thread that tells of them.
struct Refusals {
    /// Name of each object of the world.
    names: Vec<String>,
    counts: Vec<AtomicU64>,
}

impl Refusals {
    /// Tells where refusals began since the last look: each line of a component is an event of the run.
    fn tell(&self, told: &mut [u64], is_refused: &mut [bool]) {
        for (object, name) in self.names.iter().enumerate() {
            let count = self.counts[object].load(Ordering::Relaxed);
            let more = count > told[object];
            if more && !is_refused[object] {
                eprintln!(
                    "object `{name}`: an invalid pose is refused; the object counts as being where its last valid pose was"
                );
            }
            if !more && is_refused[object] {
                eprintln!("object `{name}`: no more poses are refused, {count} were");
            }
            (told[object], is_refused[object]) = (count, more);
        }
    }
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
        let objects = &parts.world.objects;
        let refusals = Arc::new(Refusals {
            names: objects.iter().map(|object| object.name.clone()).collect(),
            counts: objects.iter().map(|_| AtomicU64::new(0)).collect(),
        });
        let mut input = None;
        if Self::are_needed(config, parts) {
            input = Some(setup.input(INPUT)?);
            let shared = Arc::clone(&refusals);
            setup.helper("object-poses", move |stop| {
                let (mut told, mut is_refused) =
                    (vec![0; shared.names.len()], vec![false; shared.names.len()]);
                loop {
                    let last_round = stop.wait(LOOK);
                    shared.tell(&mut told, &mut is_refused);
                    if last_round {
                        return;
                    }
                }
            })?;
        }
        Ok(Self {
            input,
            starts: objects.iter().map(Object::pose).collect(),
            refusals,
            refused: 0,
            first: None,
        })
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
            let orientation = [
                poses.orientation_x()[index],
                poses.orientation_y()[index],
                poses.orientation_z()[index],
                poses.orientation_w()[index],
            ];
            match pose_of(position, orientation) {
                Some(pose) => each(&mut |limit| limit.move_object(object, &pose)),
                None => {
                    self.refused += 1;
                    self.first.get_or_insert(Refused { object, position, orientation });
                    self.refusals.counts[object].fetch_add(1, Ordering::Relaxed);
                }
            }
        }
        Ok(())
    }

    /// Puts the obstacles back to where the world has them, for a new episode.
    pub(super) fn reset(&mut self, mut each: impl FnMut(&mut dyn FnMut(&mut dyn RowLimit))) {
        (self.refused, self.first) = (0, None);
        for (object, pose) in self.starts.iter().enumerate().filter(|_| self.input.is_some()) {
            each(&mut |limit| limit.move_object(object, pose));
        }
    }

    /// Its entry in the result of a run.
    pub(super) fn add_to(&self, result: &mut Value) {
        if self.input.is_some() {
            let first = self.first.map(|Refused { object, position, orientation }| {
                format!(
                    "object `{}` at {position:?} with the orientation {orientation:?}, expected finite numbers and a unit quaternion x, y, z, w",
                    self.refusals.names[object]
                )
            });
            result["object_poses_refused"] = json!({ "count": self.refused, "first": first });
        }
    }
}

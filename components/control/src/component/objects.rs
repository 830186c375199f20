//! Moving objects of the world that the links must avoid.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use motorium::prelude::*;
use motorium::state::ObjectPoses;
use motorium_worlds::Object;
use nalgebra::Isometry3;
use serde_json::{Value, json};

use super::config::QpControllerConfig;
use super::setup::{ControllerSetup, OBJECTS_INPUT};
use crate::checks::pose_of;
use crate::limits::RowLimit;

/// Poll interval of the helper thread that reports rejected poses.
const LOOK: Duration = Duration::from_millis(50);

/// Poses of the objects for limits that need them. A pose that is not finite, or whose orientation is not a
/// unit quaternion, is rejected. The limits then use the object's last valid pose.
pub(super) struct MovingObjects {
    /// `None` if no limit involves a moving object.
    input: Option<Input<ObjectPoses>>,
    /// Initial pose of each object of the world.
    starts: Vec<Isometry3<f64>>,
    refusals: Arc<Refusals>,
    /// Number of rejected poses in this episode, and the first of them.
    refused: u64,
    first: Option<Refused>,
}

/// A rejected pose and its object.
#[derive(Clone, Copy, Debug)]
struct Refused {
    object: usize,
    position: [f64; 3],
    /// x, y, z, w.
    orientation: [f64; 4],
}

/// Counts of rejected poses, shared between the steps and the reporting thread.
struct Refusals {
    /// Name of each object of the world.
    names: Vec<String>,
    counts: Vec<AtomicU64>,
}

impl Refusals {
    /// Reports the objects whose poses started or stopped being rejected since the last poll. Each printed
    /// line is an event of the run.
    fn report(&self, reported: &mut [u64], is_refused: &mut [bool]) {
        for (object, name) in self.names.iter().enumerate() {
            let count = self.counts[object].load(Ordering::Relaxed);
            let more = count > reported[object];
            if more && !is_refused[object] {
                eprintln!("object `{name}`: invalid pose rejected; the last valid pose is used");
            }
            if !more && is_refused[object] {
                eprintln!("object `{name}`: poses are valid again after {count} rejected ones");
            }
            (reported[object], is_refused[object]) = (count, more);
        }
    }
}

impl MovingObjects {
    /// Declares the input if a limit requires it.
    pub(super) fn declare(config: &QpControllerConfig, parts: &ControllerSetup, declare: &mut Declare) {
        if Self::are_needed(config, parts) {
            declare.input::<ObjectPoses>(OBJECTS_INPUT, "poses of the objects that the links must avoid");
        }
    }

    /// Opens the input.
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
            input = Some(setup.input(OBJECTS_INPUT)?);
            let shared = Arc::clone(&refusals);
            setup.helper("object-poses", move |stop| {
                let (mut reported, mut is_refused) =
                    (vec![0; shared.names.len()], vec![false; shared.names.len()]);
                loop {
                    let last_round = stop.wait(LOOK);
                    shared.report(&mut reported, &mut is_refused);
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

    /// Moves the obstacles of the limits visited by `each` if there is a newer message. Before the first
    /// message the objects are at the poses in the world description.
    pub(super) fn update(
        &mut self,
        mut each: impl FnMut(&mut dyn FnMut(&mut dyn RowLimit)),
    ) -> Result<(), StepError> {
        let Some(poses) = self.input.as_mut().and_then(Input::next_unread) else { return Ok(()) };
        for index in 0..poses.count() {
            let object = poses.object()[index] as usize;
            if object >= self.starts.len() {
                return Err(StepError::failed("the object poses are from another world"));
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

    /// Resets the obstacles to their poses in the world description, for a new episode.
    pub(super) fn reset(&mut self, mut each: impl FnMut(&mut dyn FnMut(&mut dyn RowLimit))) {
        (self.refused, self.first) = (0, None);
        for (object, pose) in self.starts.iter().enumerate().filter(|_| self.input.is_some()) {
            each(&mut |limit| limit.move_object(object, pose));
        }
    }

    /// Adds the number of rejected poses to the result of a run.
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

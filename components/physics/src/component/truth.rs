//! True values for sensors, in addition to joint states: contact points on the robot, and poses of the
//! world's objects.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{Declare, StepError};
use motorium::state::{ContactImpulses, Contacts, MAX_OBJECTS, ObjectPoses};
use motorium::transport::Output;

use super::build::BuiltRobot;
use super::touched::{Push, Touched};
use crate::{Engine, Simulation, Simulator, World};

/// The outputs of true values other than joint state and base state. An output that is not wired costs
/// nothing.
pub(super) struct Truth {
    /// One entry for each robot.
    robots: Vec<Touched>,
    objects: Option<Output<ObjectPoses>>,
    /// Sorted object names with their indices in the world.
    names: Vec<(String, u32)>,
    /// One entry for each published object.
    ids: Vec<crate::ObjectId>,
}

/// Declares the outputs: contacts and their impulses for each robot, and poses if there are objects.
pub(super) fn declare(robots: &[BuiltRobot], world: &World, declare: &mut Declare) {
    for robot in robots {
        let doc = "contact points on the robot after the step";
        declare.output::<Contacts>(&robot.port("contacts"), doc);
        let doc = "impulses of contacts and pushes on the links since the start of the episode";
        declare.output::<ContactImpulses>(&robot.port("contact_impulses"), doc);
    }
    if !world.objects.is_empty() {
        declare.output::<ObjectPoses>("object_poses", "poses of the objects after the step");
    }
}

impl Truth {
    /// Opens the outputs declared by [`declare`].
    pub(super) fn open<E: Engine>(
        robots: &[BuiltRobot],
        simulation: &Simulation<E>,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let world = &simulation.world;
        let touched = robots.iter().map(|robot| Touched::open(robot, simulation, setup));
        let touched = touched.collect::<Result<_, _>>()?;
        let mut names: Vec<_> =
            (0..).zip(&world.objects).map(|(index, object)| (object.name.clone(), index)).collect();
        names.sort();
        let ids = world.objects.iter().take(MAX_OBJECTS).filter_map(|object| simulation.object(&object.name));
        let ids = ids.collect();
        Ok(Self {
            robots: touched,
            objects: if world.objects.is_empty() { None } else { Some(setup.output("object_poses")?) },
            names,
            ids,
        })
    }

    /// Accumulates the effect of contacts and pushes in a step of `dt` \[s\].
    pub(super) fn accumulate<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push> + Clone,
        dt: f64,
    ) {
        self.robots.iter_mut().for_each(|own| own.accumulate(simulation, pushes.clone(), dt));
    }

    /// Starts an episode.
    pub(super) fn reset(&mut self) {
        self.robots.iter_mut().for_each(Touched::reset);
    }

    /// Reports the contacts of the links after the last step, and the numbers of contacts and impulses that
    /// did not fit into messages.
    pub(super) fn report<E: Engine>(&self, simulation: &Simulation<E>, result: &mut serde_json::Value) {
        let contacts = self.robots.iter().map(|own| own.report(simulation));
        let contacts = contacts.flat_map(|rows| rows.as_array().cloned().unwrap_or_default());
        result["contacts"] = contacts.collect();
        result["contacts_left_out"] = self.robots.iter().map(Touched::left_out).sum::<u64>().into();
    }

    /// Publishes the state after a step.
    pub(super) fn publish<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push> + Clone,
    ) -> Result<(), StepError> {
        let Self { robots, objects, names, ids } = self;
        for own in robots {
            own.publish(simulation, pushes.clone(), names)?;
        }
        if let Some(output) = objects.as_mut().filter(|output| output.is_wired()) {
            let mut poses = output.loan()?;
            poses.set_count(ids.len());
            for (index, id) in ids.iter().enumerate() {
                let pose = simulation.object_pose(*id);
                let (position, orientation) = (pose.translation.vector, pose.rotation.coords);
                poses.object_mut()[index] = id.index() as u32;
                poses.position_x_mut()[index] = position.x;
                poses.position_y_mut()[index] = position.y;
                poses.position_z_mut()[index] = position.z;
                poses.orientation_x_mut()[index] = orientation.x;
                poses.orientation_y_mut()[index] = orientation.y;
                poses.orientation_z_mut()[index] = orientation.z;
                poses.orientation_w_mut()[index] = orientation.w;
            }
            poses.publish()?;
        }
        Ok(())
    }
}

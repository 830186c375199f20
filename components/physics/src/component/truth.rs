//! True values that sensors measure besides the joints: contact points on the robot, poses of the objects of the world.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{Declare, StepError};
use motorium::state::{Contacts, MAX_CONTACTS, MAX_OBJECTS, ObjectPoses};
use motorium::transport::Output;
use motorium_robots::FrameId;
use nalgebra::{Point3, Vector3};

use super::build::BuiltRobot;
use crate::{Engine, Simulation, Simulator, World};

/// `other` of a contact with the ground.
const GROUND: u32 = u32::MAX;

/// `other` of a push of the graph.
const PUSH: u32 = u32::MAX - 1;

/// `other` of a contact with a link of another robot.
const OTHER_ROBOT: u32 = 65_535;

/// `other` of a contact with the link of index 0 of the same robot.
const FIRST_LINK: u32 = 65_536;

/// The outputs of the truth that is no joint state and no base state. An output that is not wired costs nothing.
pub(super) struct Truth {
    /// One for each robot.
    contacts: Vec<Touched>,
    objects: Option<Output<ObjectPoses>>,
    /// Names of the objects, sorted, with their indices in the world.
    names: Vec<(String, u32)>,
    /// One for each object that is published.
    ids: Vec<crate::ObjectId>,
}

/// The contacts of one robot.
struct Touched {
    output: Output<Contacts>,
    articulation: usize,
    /// Number of links before its own among those of its articulation.
    first: u32,
    /// Names of its links, sorted, with their indices among the links of its model.
    links: Vec<(String, u32)>,
}

/// Declares the outputs: contacts of each robot, poses where there are objects.
pub(super) fn declare(robots: &[BuiltRobot], world: &World, declare: &mut Declare) {
    for robot in robots {
        let doc = "contact points on the robot after the step";
        declare.output::<Contacts>(&robot.port("contacts"), doc);
    }
    if !world.objects.is_empty() {
        declare.output::<ObjectPoses>("object_poses", "poses of the objects after the step");
    }
}

impl Truth {
    /// Opens the outputs that [`declare`] declared.
    pub(super) fn open<E: Engine>(
        robots: &[BuiltRobot],
        simulation: &Simulation<E>,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let world = &simulation.world;
        let mut contacts = Vec::new();
        for robot in robots {
            let (model, prefix) = (&robot.loaded.model, robot.prefix());
            let named = (0..).zip(model.frames()).map(|(i, frame)| (format!("{prefix}{}", frame.name), i));
            let mut links: Vec<(String, u32)> = named.collect();
            let frames = simulation.articulations()[robot.articulation].model();
            let first = frames.frame(&links[0].0).map_err(ConfigureError::failed)?.index() as u32;
            links.sort();
            let output = setup.named_output(&robot.port("contacts"))?;
            contacts.push(Touched { output, articulation: robot.articulation, first, links });
        }
        let mut names: Vec<_> =
            (0..).zip(&world.objects).map(|(index, object)| (object.name.clone(), index)).collect();
        names.sort();
        let ids = world.objects.iter().take(MAX_OBJECTS).filter_map(|object| simulation.object(&object.name));
        let ids = ids.collect();
        Ok(Self {
            contacts,
            objects: if world.objects.is_empty() { None } else { Some(setup.output("object_poses")?) },
            names,
            ids,
        })
    }

    /// Publishes the state after a step.
    pub(super) fn publish<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push> + Clone,
    ) -> Result<(), StepError> {
        let Self { contacts, objects, names, ids } = self;
        for own in contacts.iter_mut().filter(|own| own.output.is_wired()) {
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

/// A push: the link by its articulation and its index there, point in the axes of the link, arm from it and force in those
/// of the world.
type Push = ((usize, FrameId), Point3<f64>, Vector3<f64>, Vector3<f64>);

impl Touched {
    fn publish<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push>,
        names: &[(String, u32)],
    ) -> Result<(), StepError> {
        let Self { output, articulation, first, links } = self;
        let mut points = output.loan()?;
        let mut count = 0;
        points.set_count(MAX_CONTACTS);
        let mut add = |link: u32, other: u32, (point, force, depth): (&Point3<f64>, &Vector3<f64>, f64)| {
            if count == MAX_CONTACTS {
                return;
            }
            points.link_mut()[count] = link;
            points.other_mut()[count] = other;
            points.position_x_mut()[count] = point.x;
            points.position_y_mut()[count] = point.y;
            points.position_z_mut()[count] = point.z;
            points.force_x_mut()[count] = force.x;
            points.force_y_mut()[count] = force.y;
            points.force_z_mut()[count] = force.z;
            points.depth_mut()[count] = depth;
            count += 1;
        };
        for (link, point, arm, force) in pushes {
            let index = (link.1.index() as u32).checked_sub(*first);
            let index = index.filter(|index| link.0 == *articulation && (*index as usize) < links.len());
            let Some(index) = index else { continue };
            let at = simulation.frame_pose_of(link) * point + arm;
            add(index, PUSH, (&at, &force, 0.0));
        }
        simulation.visit_contacts(&mut |contact| {
            let on_second = contact.normal * contact.force + contact.friction;
            for (link, other, force) in
                [(contact.second, contact.first, on_second), (contact.first, contact.second, -on_second)]
            {
                let Some(link) = find(links, link) else { continue };
                let other = find(links, other)
                    .map(|link| FIRST_LINK + link)
                    .or_else(|| find(names, other))
                    .unwrap_or(if matches!(other, "ground" | "terrain") { GROUND } else { OTHER_ROBOT });
                add(link, other, (&contact.point, &force, contact.depth));
            }
        });
        points.set_count(count);
        points.publish()?;
        Ok(())
    }
}

/// The number that stands with a name in a sorted list.
fn find(sorted: &[(String, u32)], name: &str) -> Option<u32> {
    let place = sorted.binary_search_by(|(other, _)| other.as_str().cmp(name)).ok()?;
    Some(sorted[place].1)
}

//! True values that sensors measure besides the joints: contact points on the robot, poses of the objects of the world.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{Declare, StepError};
use motorium::state::{ContactImpulses, Contacts, MAX_CONTACTS, MAX_IMPULSES, MAX_OBJECTS, ObjectPoses};
use motorium::transport::Output;
use motorium_robots::FrameId;
use nalgebra::{Point3, Vector3};

use crate::{Engine, Simulation, Simulator, World};

/// `other` of a contact with the ground.
const GROUND: u32 = u32::MAX;

/// `other` of a push of the graph.
const PUSH: u32 = u32::MAX - 1;

/// `other` of a contact with the link of index 0 of the same robot.
const FIRST_LINK: u32 = 65_536;

/// The outputs of the truth that is no joint state and no base state. An output that is not wired costs nothing.
pub(super) struct Truth {
    contacts: Option<Output<Contacts>>,
    impulses: Option<Accumulated>,
    objects: Option<Output<ObjectPoses>>,
    /// Names of the links, sorted, with their indices among the links of the model.
    links: Vec<(String, u32)>,
    /// Names of the objects, sorted, with their indices in the world.
    names: Vec<(String, u32)>,
    /// One for each object that is published.
    ids: Vec<crate::ObjectId>,
}

/// Declares the outputs: contacts of a robot that is alone, poses where there are objects.
pub(super) fn declare(robots: usize, world: &World, declare: &mut Declare) {
    if robots == 1 {
        declare.output::<Contacts>("contacts", "contact points on the robot after the step");
        let doc = "impulses of contacts and pushes on the links since the start of the episode";
        declare.output::<ContactImpulses>("contact_impulses", doc);
    }
    if !world.objects.is_empty() {
        declare.output::<ObjectPoses>("object_poses", "poses of the objects after the step");
    }
}

impl Truth {
    /// Opens the outputs that [`declare`] declared.
    pub(super) fn open<E: Engine>(
        robots: usize,
        simulation: &Simulation<E>,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let world = &simulation.world;
        let mut links: Vec<_> = (0..)
            .zip(simulation.model().frames())
            .map(|(index, frame)| (frame.name.clone(), index))
            .collect();
        let mut names: Vec<_> =
            (0..).zip(&world.objects).map(|(index, object)| (object.name.clone(), index)).collect();
        links.sort();
        names.sort();
        let ids = world.objects.iter().take(MAX_OBJECTS).filter_map(|object| simulation.object(&object.name));
        let ids = ids.collect();
        Ok(Self {
            contacts: if robots == 1 { Some(setup.output("contacts")?) } else { None },
            impulses: if robots == 1 { Some(Accumulated::open(links.len(), setup)?) } else { None },
            objects: if world.objects.is_empty() { None } else { Some(setup.output("object_poses")?) },
            links,
            names,
            ids,
        })
    }

    /// Adds up what contacts and pushes did in a step of `dt` \[s\].
    pub(super) fn accumulate<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = (FrameId, Point3<f64>, Vector3<f64>, Vector3<f64>)>,
        dt: f64,
    ) {
        let Some(impulses) = self.impulses.as_mut().filter(|impulses| impulses.output.is_wired()) else {
            return;
        };
        for (link, point, arm, force) in pushes {
            let at = simulation.frame_pose(link) * point + arm;
            impulses.add(link.index() as u32, &(force * dt), &(at.coords.cross(&force) * dt));
        }
        simulation.engine.visit_impulses(dt, &mut |name, impulse, moment| {
            if let Some(link) = find(&self.links, name) {
                impulses.add(link, impulse, moment);
            }
        });
    }

    /// Starts an episode.
    pub(super) fn reset(&mut self) {
        if let Some(impulses) = &mut self.impulses {
            impulses.touched.clear();
        }
    }

    /// Publishes the state after a step.
    pub(super) fn publish<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = (FrameId, Point3<f64>, Vector3<f64>, Vector3<f64>)>,
    ) -> Result<(), StepError> {
        let Self { contacts, impulses, objects, links, names, ids } = self;
        if let Some(impulses) = impulses {
            impulses.publish()?;
        }
        if let Some(output) = contacts.as_mut().filter(|output| output.is_wired()) {
            let mut points = output.loan()?;
            let mut count = 0;
            points.set_count(MAX_CONTACTS);
            let mut add =
                |link: u32, other: u32, (point, force, depth): (&Point3<f64>, &Vector3<f64>, f64)| {
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
                let at = simulation.frame_pose(link) * point + arm;
                add(link.index() as u32, PUSH, (&at, &force, 0.0));
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
                        .unwrap_or(GROUND);
                    add(link, other, (&contact.point, &force, contact.depth));
                }
            });
            points.set_count(count);
            points.publish()?;
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

/// The impulses on the links since the start of an episode.
struct Accumulated {
    output: Output<ContactImpulses>,
    /// Link, impulse and moment, in the order in which the links were first touched.
    touched: Vec<(u32, Vector3<f64>, Vector3<f64>)>,
}

impl Accumulated {
    fn open(links: usize, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let touched = Vec::with_capacity(links.min(MAX_IMPULSES));
        Ok(Self { output: setup.output("contact_impulses")?, touched })
    }

    fn add(&mut self, link: u32, impulse: &Vector3<f64>, moment: &Vector3<f64>) {
        if let Some((_, impulses, moments)) = self.touched.iter_mut().find(|(other, ..)| *other == link) {
            *impulses += impulse;
            *moments += moment;
        } else if self.touched.len() < self.touched.capacity() {
            self.touched.push((link, *impulse, *moment));
        }
    }

    fn publish(&mut self) -> Result<(), StepError> {
        if !self.output.is_wired() {
            return Ok(());
        }
        let mut sums = self.output.loan()?;
        sums.set_count(self.touched.len());
        for (index, (link, impulse, moment)) in self.touched.iter().enumerate() {
            sums.link_mut()[index] = *link;
            sums.impulse_x_mut()[index] = impulse.x;
            sums.impulse_y_mut()[index] = impulse.y;
            sums.impulse_z_mut()[index] = impulse.z;
            sums.moment_x_mut()[index] = moment.x;
            sums.moment_y_mut()[index] = moment.y;
            sums.moment_z_mut()[index] = moment.z;
        }
        sums.publish()
    }
}

/// The number that stands with a name in a sorted list.
fn find(sorted: &[(String, u32)], name: &str) -> Option<u32> {
    let place = sorted.binary_search_by(|(other, _)| other.as_str().cmp(name)).ok()?;
    Some(sorted[place].1)
}

//! The contacts of a robot: contact points, and their impulses since the start of an episode.

use std::collections::BTreeMap;

use motorium::component::{ConfigureError, Setup};
use motorium::declare::StepError;
use motorium::state::{ContactImpulses, Contacts, MAX_CONTACTS, MAX_IMPULSES};
use motorium::transport::Output;
use motorium_robots::FrameId;
use nalgebra::{Point3, Vector3};

use super::build::BuiltRobot;
use super::merging::{Entry, Merger};
use crate::{Engine, Simulation, Simulator};

/// Value of `other` for a contact with the ground.
const GROUND: u32 = u32::MAX;

/// Value of `other` for a push of the graph.
const PUSH: u32 = u32::MAX - 1;

/// Value of `other` for a contact with a link of another robot.
const OTHER_ROBOT: u32 = 65_535;

/// Value of `other` for a contact with link 0 of the same robot.
const FIRST_LINK: u32 = 65_536;

/// A push: articulation and link index, point in link axes, and, in world axes, the arm from that point and
/// the force.
pub(super) type Push = ((usize, FrameId), Point3<f64>, Vector3<f64>, Vector3<f64>);

/// The contacts of one robot.
pub(super) struct Touched {
    contacts: Output<Contacts>,
    impulses: Output<ContactImpulses>,
    place: Place,
    /// Sorted link names with their indices among the links of the model.
    links: Vec<(String, u32)>,
    /// Link, impulse and moment since the start of the episode, in the order of first contact.
    sums: Vec<(u32, Vector3<f64>, Vector3<f64>)>,
    merger: Merger,
    /// Number of contact points, and of impulses on links since the start of the episode, that did not fit
    /// into messages.
    cut: Cut,
}

/// Numbers of entries that did not fit into messages.
#[derive(Clone, Copy, Default)]
struct Cut {
    contacts: u64,
    impulses: u64,
}

/// The robot's range of the links of its articulation.
#[derive(Clone, Copy)]
struct Place {
    articulation: usize,
    /// Number of links before the robot's first link.
    first: u32,
    /// Number of the robot's links.
    count: u32,
}

impl Place {
    /// Returns the index of a link among the robot's links.
    fn index(&self, (articulation, link): (usize, FrameId)) -> Option<u32> {
        let index = (link.index() as u32).checked_sub(self.first)?;
        (articulation == self.articulation && index < self.count).then_some(index)
    }
}

impl Touched {
    /// Opens the outputs of a robot.
    pub(super) fn open<E: Engine>(
        robot: &BuiltRobot,
        simulation: &Simulation<E>,
        setup: &mut Setup,
    ) -> Result<Self, ConfigureError> {
        let (model, prefix) = (&robot.loaded.model, robot.prefix());
        let named = (0..).zip(model.frames()).map(|(i, frame)| (format!("{prefix}{}", frame.name), i));
        let mut links: Vec<(String, u32)> = named.collect();
        let frames = simulation.articulations()[robot.articulation].model();
        let first = frames.frame(&links[0].0).map_err(ConfigureError::failed)?.index() as u32;
        links.sort();
        let (articulation, count) = (robot.articulation, links.len() as u32);
        Ok(Self {
            contacts: setup.named_output(&robot.port("contacts"))?,
            impulses: setup.named_output(&robot.port("contact_impulses"))?,
            place: Place { articulation, first, count },
            sums: Vec::with_capacity(links.len().min(MAX_IMPULSES)),
            links,
            merger: Merger::new(MAX_CONTACTS),
            cut: Cut::default(),
        })
    }

    /// Accumulates the effect of contacts and pushes in a step of `dt` \[s\].
    pub(super) fn accumulate<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push>,
        dt: f64,
    ) {
        let Self { impulses, place, links, sums, cut, .. } = self;
        if !impulses.is_wired() {
            return;
        }
        for (link, point, arm, force) in pushes {
            let Some(index) = place.index(link) else { continue };
            let at = simulation.frame_pose_of(link) * point + arm;
            cut.impulses += add(sums, index, &(force * dt), &(at.coords.cross(&force) * dt));
        }
        simulation.engine.visit_impulses(dt, &mut |name, impulse, moment| {
            if let Some(link) = find(links, name) {
                cut.impulses += add(sums, link, impulse, moment);
            }
        });
    }

    /// Starts an episode.
    pub(super) fn reset(&mut self) {
        self.sums.clear();
        self.cut = Cut::default();
    }

    /// Publishes the contact points and the sums; `names` are the sorted object names. If the message has no
    /// room for all points, some points of a link are [merged](Merger).
    pub(super) fn publish<E: Engine>(
        &mut self,
        simulation: &Simulation<E>,
        pushes: impl Iterator<Item = Push> + Clone,
        names: &[(String, u32)],
    ) -> Result<(), StepError> {
        self.publish_impulses()?;
        let Self { contacts, place, links, merger, cut, .. } = self;
        if !contacts.is_wired() {
            return Ok(());
        }
        let mut points = contacts.loan()?;
        let mut visit = |add: &mut dyn FnMut(&Entry)| {
            for (link, point, arm, force) in pushes.clone() {
                let Some(index) = place.index(link) else { continue };
                let point = simulation.frame_pose_of(link) * point + arm;
                add(&Entry { link: index, other: PUSH, point, force, depth: 0.0 });
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
                    add(&Entry { link, other, point: contact.point, force, depth: contact.depth });
                }
            });
        };
        let mut count = 0;
        points.set_count(MAX_CONTACTS);
        let left_out = merger.fill(&mut visit, &mut |entry| {
            points.link_mut()[count] = entry.link;
            points.other_mut()[count] = entry.other;
            points.position_x_mut()[count] = entry.point.x;
            points.position_y_mut()[count] = entry.point.y;
            points.position_z_mut()[count] = entry.point.z;
            points.force_x_mut()[count] = entry.force.x;
            points.force_y_mut()[count] = entry.force.y;
            points.force_z_mut()[count] = entry.force.z;
            points.depth_mut()[count] = entry.depth;
            count += 1;
        });
        points.set_count(count);
        points.cut = left_out;
        cut.contacts += left_out;
        points.publish()?;
        Ok(())
    }

    /// Returns the number of contact points without a separate entry and of impulses omitted from messages,
    /// in this episode.
    pub(super) fn left_out(&self) -> u64 {
        self.cut.contacts + self.cut.impulses
    }

    /// Returns the contact force between each link and each other part after the last step, by name.
    pub(super) fn report<E: Engine>(&self, simulation: &Simulation<E>) -> serde_json::Value {
        let mut forces = BTreeMap::<(String, String), Vector3<f64>>::new();
        simulation.visit_contacts(&mut |contact| {
            let on_second = contact.normal * contact.force + contact.friction;
            let pair =
                [(contact.second, contact.first, on_second), (contact.first, contact.second, -on_second)];
            for (link, other, force) in
                pair.into_iter().filter(|(link, ..)| find(&self.links, link).is_some())
            {
                *forces.entry((link.to_owned(), other.to_owned())).or_default() += force;
            }
        });
        let rows = forces.into_iter().map(|((link, other), force)| {
            serde_json::json!({ "link": link, "other": other, "force": [force.x, force.y, force.z] })
        });
        rows.collect()
    }

    fn publish_impulses(&mut self) -> Result<(), StepError> {
        if !self.impulses.is_wired() {
            return Ok(());
        }
        let mut sums = self.impulses.loan()?;
        sums.set_count(self.sums.len());
        sums.cut = self.cut.impulses;
        for (index, (link, impulse, moment)) in self.sums.iter().enumerate() {
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

/// Adds an impulse on a link and its moment to the sums. Returns 1 if there is no room for the link, and 0
/// otherwise.
fn add(
    sums: &mut Vec<(u32, Vector3<f64>, Vector3<f64>)>,
    link: u32,
    impulse: &Vector3<f64>,
    moment: &Vector3<f64>,
) -> u64 {
    if let Some((_, impulses, moments)) = sums.iter_mut().find(|(other, ..)| *other == link) {
        *impulses += impulse;
        *moments += moment;
    } else if sums.len() < sums.capacity() {
        sums.push((link, *impulse, *moment));
    } else {
        return 1;
    }
    0
}

/// Returns the number stored with a name in a sorted list.
fn find(sorted: &[(String, u32)], name: &str) -> Option<u32> {
    let place = sorted.binary_search_by(|(other, _)| other.as_str().cmp(name)).ok()?;
    Some(sorted[place].1)
}

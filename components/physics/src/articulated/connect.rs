//! Connections between parts in the articulated engine.

use motorium_robots::Model;
use nalgebra::{Isometry3, Translation3};

use super::Articulated;
use crate::contact::{ImpulseSums, Member, Owner};
use crate::robot::Robot;
use crate::{ConnectError, Connection, World};

impl Articulated {
    /// Connects two parts in their current poses.
    pub(super) fn connect_parts(
        &mut self,
        (robot, world): (&Robot, &World),
        Connection { parts: [first, second], kind, point }: &Connection,
        lasting: bool,
    ) -> Result<(), ConnectError> {
        if !point.iter().all(|number| number.is_finite()) {
            return Err(ConnectError::Point(*point));
        }
        let unknown = |name: &String| ConnectError::Unknown {
            name: name.clone(),
            nearest: nearest(robot, world, name),
        };
        let a = self.part(robot, world, first).ok_or_else(|| unknown(first))?;
        let b = self.part(robot, world, second).ok_or_else(|| unknown(second))?;
        if a.0.owner == b.0.owner {
            return Err(ConnectError::Rigid { first: first.clone(), second: second.clone() });
        }
        let frame = a.1 * Isometry3::from(Translation3::from(*point));
        let there = self.pose_of(robot, b.0.owner).inverse() * self.pose_of(robot, a.0.owner) * frame;
        let colliders = self.scene.colliders().colliders.len();
        let sums = |name: &String| {
            let is_object = world.objects.iter().any(|object| object.name == *name);
            let link = find_link(robot, name).filter(|_| !is_object && name != "world");
            link.map(|link| ImpulseSums::link(colliders, &robot.articulations, link))
        };
        self.scene.connect([a.0, b.0], [frame, there], [sums(first), sums(second)], (*kind, lasting));
        self.place_colliders(robot);
        Ok(())
    }

    /// Removes the connections between two parts.
    pub(super) fn disconnect_parts(
        &mut self,
        robot: &Robot,
        world: &World,
        [first, second]: [&str; 2],
    ) -> bool {
        let parts = (self.part(robot, world, first), self.part(robot, world, second));
        let (Some(a), Some(b)) = parts else { return false };
        self.scene.disconnect([a.0, b.0])
    }

    /// Returns the member that a link, an object or the world moves with, and its frame in that member.
    fn part(&self, robot: &Robot, world: &World, name: &str) -> Option<(Member, Isometry3<f64>)> {
        if name == "world" {
            return Some((Member { owner: Owner::World, fixed: None }, Isometry3::identity()));
        }
        if let Some(index) = world.objects.iter().position(|object| object.name == name) {
            return Some(self.scene.member_of_object(index));
        }
        let (of, link) = find_link(robot, name)?;
        let model: &Model = &robot.articulations[of].model;
        let frame = &model.frames()[link];
        let owner = match frame.body {
            Some(body) => Owner::Body(of, body),
            None if model.base().floating && !frame.in_world => Owner::Base(of),
            None => Owner::World,
        };
        Some((Member { owner, fixed: None }, frame.placement))
    }

    /// Returns the current pose of a part.
    fn pose_of(&self, robot: &Robot, owner: Owner) -> Isometry3<f64> {
        match owner {
            Owner::World => Isometry3::identity(),
            Owner::Base(of) => robot.base_pose(of),
            Owner::Body(of, body) => robot.articulations[of].kinematics.body_pose(body),
            Owner::Object(object) => self.scene.objects.now[object].pose,
        }
    }
}

/// Returns the articulation of a link and the index of the link in it.
fn find_link(robot: &Robot, name: &str) -> Option<(usize, usize)> {
    let links = robot.articulations.iter().enumerate();
    links.into_iter().find_map(|(of, own)| Some((of, own.model.frame(name).ok()?.index())))
}

/// Returns the link or object with the most similar name.
fn nearest(robot: &Robot, world: &World, name: &str) -> Option<String> {
    let links =
        robot.articulations.iter().flat_map(|own| own.model.frames()).map(|frame| frame.name.as_str());
    let objects = world.objects.iter().map(|object| object.name.as_str());
    motorium_robots::nearest(name, links.chain(objects).chain(["world"])).map(str::to_owned)
}

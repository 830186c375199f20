//! Connections: bilateral contact points.

use motorium_robots::Kinematics;
use nalgebra::{Isometry3, Point3, Vector3};

use super::colliders::{Collider, Member, Owner};
use super::objects::FreeBody;
use super::point::{ContactPoint, Held, UNKNOWN};
use super::surface::SurfaceLaw;
use crate::ConnectionKind;

/// Key bit of connections.
const CONNECTION: u64 = 1 << 61;

/// A connection of two parts.
#[derive(Clone, Debug)]
pub(crate) struct Joined {
    pub(crate) members: [Member; 2],
    /// The shared frame in the frame of each part.
    pub(crate) frames: [Isometry3<f64>; 2],
    pub(crate) kind: ConnectionKind,
    /// True if the connection survives a reset of the simulation.
    pub(crate) lasting: bool,
    /// Indices of the [sums](super::sums::ImpulseSums) that accumulate the impulse on each part.
    sums: [Option<usize>; 2],
    number: u64,
}

/// All connections, and their points in the current poses.
#[derive(Clone, Debug, Default)]
pub(crate) struct Connections {
    all: Vec<Joined>,
    points: Vec<ContactPoint>,
    /// Number of the next connection.
    next: u64,
}

impl Connections {
    /// Adds a connection. `links` are the indices of the [sums](super::sums::ImpulseSums::link) of its links.
    pub(crate) fn add(
        &mut self,
        colliders: &[Collider],
        members: [Member; 2],
        frames: [Isometry3<f64>; 2],
        links: [Option<usize>; 2],
        (kind, lasting): (ConnectionKind, bool),
    ) {
        let object = |Member { owner, .. }: Member| {
            let own = |collider: &Collider| collider.owner == owner && owner != Owner::World;
            colliders.iter().position(own)
        };
        let sums = [0, 1].map(|side| links[side].or_else(|| object(members[side])));
        self.all.push(Joined { members, frames, kind, lasting, sums, number: self.next });
        self.next += 1;
        self.points.reserve(self.most());
    }

    /// Removes the connections between these two parts. Returns `false` if they have none.
    pub(crate) fn remove(&mut self, parts: [Member; 2]) -> bool {
        let before = self.all.len();
        self.all.retain(|joined| !joins(joined, parts));
        before > self.all.len()
    }

    /// Removes connections that do not survive a reset.
    pub(crate) fn reset(&mut self) {
        self.all.retain(|joined| joined.lasting);
    }

    /// Returns the largest number of points.
    pub(crate) fn most(&self) -> usize {
        2 * self.all.len()
    }

    pub(crate) fn save(&self) -> (Vec<Joined>, u64) {
        (self.all.clone(), self.next)
    }

    pub(crate) fn restore(&mut self, (all, next): &(Vec<Joined>, u64)) {
        self.all.clone_from(all);
        self.next = *next;
        self.points.reserve(self.most());
    }

    /// Returns `true` if the two parts are connected.
    pub(crate) fn joins(&self, parts: [Member; 2]) -> bool {
        self.all.iter().any(|joined| joins(joined, parts))
    }

    /// Computes the points in the current poses.
    pub(super) fn update_points<'a>(
        &mut self,
        (kinematics, bases): (impl Fn(usize) -> &'a Kinematics, &[Isometry3<f64>]),
        objects: &[FreeBody],
    ) {
        self.points.clear();
        for joined in &self.all {
            let pose = |owner: Owner| match owner {
                Owner::World => Isometry3::identity(),
                Owner::Base(of) => bases[of],
                Owner::Body(of, body) => kinematics(of).body_pose(body),
                Owner::Object(object) => objects[object].pose,
            };
            let [a, b] = [0, 1].map(|side| pose(joined.members[side].owner) * joined.frames[side]);
            let apart = a.translation.vector - b.translation.vector;
            let point = Point3::from(0.5 * (a.translation.vector + b.translation.vector));
            let mut add = |turning: bool, error: Vector3<f64>| {
                self.points.push(ContactPoint {
                    key: CONNECTION | joined.number << 1 | u64::from(turning),
                    // A part may have no collider: see `sums`.
                    colliders: (usize::MAX, usize::MAX),
                    owners: (joined.members[0].owner, joined.members[1].owner),
                    point,
                    normal: Vector3::x(),
                    distance: 0.0,
                    speed: 0.0,
                    law: SurfaceLaw::NONE,
                    held: Some(Held { turning, error }),
                    h: UNKNOWN,
                    kept: false,
                });
            };
            add(false, apart);
            if joined.kind == ConnectionKind::Fixed {
                add(true, (a.rotation * b.rotation.inverse()).scaled_axis());
            }
        }
    }

    /// Returns the points of connections with a moving side.
    pub(super) fn points(&self, moves: impl Fn(Owner) -> bool) -> impl Iterator<Item = &ContactPoint> {
        self.points.iter().filter(move |point| moves(point.owners.0) || moves(point.owners.1))
    }

    /// Returns the indices of the sums of both parts of the point with this key.
    pub(super) fn sums(&self, key: u64) -> [Option<usize>; 2] {
        let number = (key & !CONNECTION) >> 1;
        self.all.iter().find(|joined| joined.number == number).map_or([None; 2], |joined| joined.sums)
    }
}

fn joins(joined: &Joined, [a, b]: [Member; 2]) -> bool {
    joined.members == [a, b] || joined.members == [b, a]
}

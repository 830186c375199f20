//! The connections of a scene.

use nalgebra::Isometry3;

use super::ContactScene;
use crate::ConnectionKind;
use crate::contact::{Member, Owner};

impl ContactScene {
    /// Adds the points of connections that may be active in the next integration step.
    pub(super) fn add_connections(&mut self) {
        let Self { detector, connections, lengths, articulations, .. } = self;
        detector.add_connections(connections, |owner| match owner {
            Owner::World => false,
            Owner::Base(of) | Owner::Body(of, _) => lengths[of] > 0.0,
            Owner::Object(object) => lengths[*articulations + object] > 0.0,
        });
    }

    /// Connects two parts; each comes with the shared frame in the part's frame. `links` are the indices of
    /// the [sums](crate::contact::ImpulseSums::link) of the links among them.
    pub(crate) fn connect(
        &mut self,
        members: [Member; 2],
        frames: [Isometry3<f64>; 2],
        links: [Option<usize>; 2],
        kind: (ConnectionKind, bool),
    ) {
        self.connections.add(&self.colliders.colliders, members, frames, links, kind);
        self.make_room();
        self.objects.wake();
    }

    /// Removes the connections between two parts. Returns `false` if the parts are not connected.
    pub(crate) fn disconnect(&mut self, members: [Member; 2]) -> bool {
        self.objects.wake();
        // The parts may be near each other, and their distance has not been checked.
        self.detector.forget();
        self.connections.remove(members)
    }

    pub(super) fn make_room(&mut self) {
        let held = self.connections.most();
        self.detector.make_room(held);
        let contacts = self.detector.capacity() * if self.colliders.resist_turning() { 2 } else { 1 };
        self.impulses.make_room(contacts + held);
    }

    /// Returns the member of a connection that carries an object of the world, and the pose of the object in
    /// the frame of its owner.
    pub(crate) fn member_of_object(&self, index: usize) -> (Member, Isometry3<f64>) {
        match self.objects.movable[index] {
            Some(movable) => {
                let body = &self.objects.now[movable];
                let pose = body.axes.map_or_else(Isometry3::identity, |axes| axes.inverse());
                (Member { owner: Owner::Object(movable), fixed: None }, pose)
            }
            None => (Member { owner: Owner::World, fixed: Some(index) }, self.object_pose(index)),
        }
    }
}

//! The connections of a scene.

use nalgebra::Isometry3;

use super::ContactScene;
use crate::ConnectionKind;
use crate::contact::Owner;

impl ContactScene {
    /// Adds the points of connections that may be at work in the next integration step.
    pub(super) fn add_connections(&mut self) {
        let Self { detector, connections, lengths, articulations, .. } = self;
        detector.add_connections(connections, |owner| match owner {
            Owner::World => false,
            Owner::Base(of) | Owner::Body(of, _) => lengths[of] > 0.0,
            Owner::Object(object) => lengths[*articulations + object] > 0.0,
        });
    }

    /// Connects two parts, each with the frame that they share as it lies in it.
    pub(crate) fn connect(
        &mut self,
        owners: [Owner; 2],
        frames: [Isometry3<f64>; 2],
        kind: (ConnectionKind, bool),
    ) {
        self.connections.add(&self.colliders.colliders, owners, frames, kind);
        self.make_room();
        self.objects.wake();
    }

    /// Takes the connections of two parts away; `false` where there are none.
    pub(crate) fn disconnect(&mut self, owners: [Owner; 2]) -> bool {
        self.objects.wake();
        // They may be near one another, and were not looked at.
        self.detector.forget();
        self.connections.remove(owners)
    }

    pub(super) fn make_room(&mut self) {
        let held = self.connections.most();
        self.detector.make_room(held);
        let contacts = self.detector.capacity() * if self.colliders.resist_turning() { 2 } else { 1 };
        self.impulses.make_room(contacts + held);
    }

    /// The part of the simulation that an object of the world moves with, and its pose there.
    pub(crate) fn owner_of_object(&self, index: usize) -> (Owner, Isometry3<f64>) {
        match self.objects.movable[index] {
            Some(movable) => (Owner::Object(movable), Isometry3::identity()),
            None => (Owner::World, self.object_pose(index)),
        }
    }
}

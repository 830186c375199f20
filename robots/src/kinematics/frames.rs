//! Poses, velocities and accelerations of frames.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::Kinematics;
use crate::math::{M3, V3};
use crate::model::flat::FlatModel;
use crate::{FrameId, Model, Reference, Twist};

impl Kinematics {
    /// Returns the pose of `frame` in the world.
    pub fn pose(&self, model: &Model, frame: FrameId) -> Isometry3<f64> {
        let (rotation, position) = self.placement(model, frame);
        isometry(&rotation, position)
    }

    /// Returns the pose in the world of the body frame of body `index` in [`Model::bodies`].
    pub fn body_pose(&self, index: usize) -> Isometry3<f64> {
        let body = &self.bodies[index + 1];
        isometry(&(body.rotation * self.align[index].transpose()), body.position)
    }

    /// Returns the velocity of a body's origin and the angular velocity of the body, in world axes. `index`
    /// is an index in [`Model::bodies`], or `None` for the base. The result is zero after
    /// [`update`](Self::update), which has no velocity argument.
    pub fn body_velocity(&self, index: Option<usize>) -> Twist {
        let body = &self.bodies[index.map_or(0, |index| index + 1)];
        Twist { linear: body.linear.into(), angular: body.angular.into() }
    }

    /// Returns the position of a body's origin in the world \[m\]. `index` is an index in [`Model::bodies`],
    /// or `None` for the base.
    pub fn body_position(&self, index: Option<usize>) -> Vector3<f64> {
        self.bodies[index.map_or(0, |index| index + 1)].position.into()
    }

    /// Returns the velocity of `frame`'s origin and the angular velocity of `frame`, in world axes
    /// ([`Reference::LocalWorldAligned`]). The result is zero after [`update`](Self::update), which has no
    /// velocity argument.
    pub fn velocity(&self, model: &Model, frame: FrameId) -> Twist {
        self.velocity_in(model, frame, Reference::LocalWorldAligned)
    }

    /// Returns the velocity of `frame` at the reference point and in the axes that `reference` selects. The
    /// result is zero after [`update`](Self::update), which has no velocity argument.
    pub fn velocity_in(&self, model: &Model, frame: FrameId, reference: Reference) -> Twist {
        let placement = &model.flat().frame_placements[frame.index()];
        let body = self.carrier(placement);
        let arm = body.rotation * placement.position;
        let linear = body.linear + body.angular.cross(arm);
        express(reference, &(body.rotation, placement.rotation), body.position + arm, (linear, body.angular))
    }

    /// Returns the classical acceleration of `frame`'s origin and the angular acceleration of `frame`, in
    /// world axes: `J a + Jdot v`, with `J` the Jacobian in [`Reference::LocalWorldAligned`].
    ///
    /// After [`update_with_velocity`](Self::update_with_velocity), `a` is zero and the result is the drift
    /// `Jdot v`.
    pub fn acceleration(&self, model: &Model, frame: FrameId) -> Twist {
        let placement = &model.flat().frame_placements[frame.index()];
        let body = self.carrier(placement);
        let arm = body.rotation * placement.position;
        let linear =
            body.linear_rate + body.angular_rate.cross(arm) + body.angular.cross(body.angular.cross(arm));
        Twist { linear: linear.into(), angular: body.angular_rate.into() }
    }

    /// Returns the time derivative of [`velocity_in`](Self::velocity_in): `J a + Jdot v`, with `J` the
    /// Jacobian in `reference`.
    ///
    /// In [`Reference::LocalWorldAligned`], this is the classical [`acceleration`](Self::acceleration). In
    /// [`Reference::Local`] and [`Reference::World`], it is the spatial acceleration, which lacks the term `w
    /// x v` of the origin's motion. After [`update_with_velocity`](Self::update_with_velocity), `a` is zero
    /// and the result is the drift `Jdot v`.
    pub fn acceleration_in(&self, model: &Model, frame: FrameId, reference: Reference) -> Twist {
        let classical = self.acceleration(model, frame);
        if reference == Reference::LocalWorldAligned {
            return classical;
        }
        let placement = &model.flat().frame_placements[frame.index()];
        let body = self.carrier(placement);
        let arm = body.rotation * placement.position;
        let velocity = body.linear + body.angular.cross(arm);
        let linear = V3::from(classical.linear) - body.angular.cross(velocity);
        express(
            reference,
            &(body.rotation, placement.rotation),
            body.position + arm,
            (linear, body.angular_rate),
        )
    }

    /// Returns the node frame of a slot in the world.
    pub(crate) fn slot_pose(&self, slot: usize) -> (M3, V3) {
        let body = if slot == FlatModel::WORLD { &self.world } else { &self.bodies[slot] };
        (body.rotation, body.position)
    }

    /// Returns orientation and origin of `frame` in the world.
    pub(super) fn placement(&self, model: &Model, frame: FrameId) -> (M3, V3) {
        let placement = &model.flat().frame_placements[frame.index()];
        let body = self.carrier(placement);
        (body.rotation * placement.rotation, body.rotation * placement.position + body.position)
    }
}

/// Converts a motion at `point` in world axes to the point and axes of `reference`.
fn express(
    reference: Reference,
    (body, placement): &(M3, M3),
    point: V3,
    (linear, angular): (V3, V3),
) -> Twist {
    let (linear, angular) = match reference {
        Reference::LocalWorldAligned => (linear, angular),
        Reference::Local => (placement.tr_mul(body.tr_mul(linear)), placement.tr_mul(body.tr_mul(angular))),
        Reference::World => (linear + point.cross(angular), angular),
    };
    Twist { linear: linear.into(), angular: angular.into() }
}

fn isometry(rotation: &M3, position: V3) -> Isometry3<f64> {
    let matrix = Rotation3::from_matrix_unchecked(Matrix3::from(*rotation));
    Isometry3::from_parts(
        Translation3::from(nalgebra::Vector3::from(position)),
        UnitQuaternion::from_rotation_matrix(&matrix),
    )
}

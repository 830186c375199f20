//! Forward kinematics and frame Jacobians.

use nalgebra::{
    Dim, Isometry3, Matrix, Matrix3, Rotation3, StorageMut, Translation3, UnitQuaternion, Vector3,
};

use crate::model::tree::BASE;
use crate::{FrameId, Model, Reference, Twist};

/// Pose and velocity of one body in the world, at its frame's origin.
#[derive(Clone, Debug)]
struct BodyState {
    rotation: Matrix3<f64>,
    position: Vector3<f64>,
    /// Joint axis in world axes.
    axis: Vector3<f64>,
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

/// Workspace for the kinematics of one [`Model`]. Nothing allocates after [`new`](Self::new).
///
/// Call [`update`](Self::update) or [`update_with_velocity`](Self::update_with_velocity), then ask. Methods panic on slices
/// and matrices of another size than the model's, and on a model with another number of bodies.
#[derive(Clone, Debug)]
pub struct Kinematics {
    bodies: Vec<BodyState>,
}

impl Kinematics {
    /// A workspace for `model`. Poses are valid after the first update only.
    pub fn new(model: &Model) -> Self {
        let state = BodyState {
            rotation: Matrix3::identity(),
            position: Vector3::zeros(),
            axis: Vector3::zeros(),
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        };
        Self { bodies: vec![state; model.bodies().len()] }
    }

    /// Forward kinematics of all bodies at `q` (nq). Velocities become zero.
    pub fn update(&mut self, model: &Model, q: &[f64]) {
        self.place(model, q);
        for body in &mut self.bodies {
            body.linear = Vector3::zeros();
            body.angular = Vector3::zeros();
        }
    }

    /// Forward kinematics of all bodies at `q` (nq) moving with `v` (nv).
    pub fn update_with_velocity(&mut self, model: &Model, q: &[f64], v: &[f64]) {
        assert_eq!(v.len(), model.nv(), "length of v");
        self.place(model, q);
        for (index, node) in model.nodes().iter().enumerate() {
            let (mut linear, mut angular) = (Vector3::zeros(), Vector3::zeros());
            if node.parent != BASE {
                let parent = &self.bodies[node.parent];
                angular = parent.angular;
                linear = parent.linear + angular.cross(&(self.bodies[index].position - parent.position));
            }
            let body = &mut self.bodies[index];
            let joint = body.axis * node.rate(v);
            if node.prismatic {
                linear += joint
            } else {
                angular += joint
            }
            body.linear = linear;
            body.angular = angular;
        }
    }

    fn place(&mut self, model: &Model, q: &[f64]) {
        assert_eq!(q.len(), model.nq(), "length of q");
        assert_eq!(self.bodies.len(), model.bodies().len(), "the workspace was made for another model");
        for (index, node) in model.nodes().iter().enumerate() {
            let (mut rotation, mut position) = node.pose(q);
            if node.parent != BASE {
                let parent = &self.bodies[node.parent];
                position = parent.rotation * position + parent.position;
                rotation = parent.rotation * rotation;
            }
            let body = &mut self.bodies[index];
            body.axis = rotation * node.axis;
            body.rotation = rotation;
            body.position = position;
        }
    }

    /// Pose of `frame` in the world.
    pub fn pose(&self, model: &Model, frame: FrameId) -> Isometry3<f64> {
        let frame = &model.frames()[frame.index()];
        match frame.body {
            Some(body) => self.body_pose(body) * frame.placement,
            None => frame.placement,
        }
    }

    /// Pose of the body frame of body `index` of [`Model::bodies`] in the world.
    pub fn body_pose(&self, index: usize) -> Isometry3<f64> {
        let body = &self.bodies[index];
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(body.rotation));
        Isometry3::from_parts(Translation3::from(body.position), rotation)
    }

    /// Velocity of `frame`'s origin and its angular velocity, in world axes ([`Reference::LocalWorldAligned`]).
    /// Zero after [`update`](Self::update).
    pub fn velocity(&self, model: &Model, frame: FrameId) -> Twist {
        let frame = &model.frames()[frame.index()];
        let Some(body) = frame.body.map(|index| &self.bodies[index]) else { return Twist::zero() };
        let arm = body.rotation * frame.placement.translation.vector;
        Twist { linear: body.linear + body.angular.cross(&arm), angular: body.angular }
    }

    /// Velocity of `frame` with the point and axes of `reference`. Zero after [`update`](Self::update).
    pub fn velocity_in(&self, model: &Model, frame: FrameId, reference: Reference) -> Twist {
        let twist = self.velocity(model, frame);
        match reference {
            Reference::LocalWorldAligned => twist,
            Reference::Local => {
                let (rotation, _) = self.frame_placement(model, frame);
                Twist { linear: rotation.tr_mul(&twist.linear), angular: rotation.tr_mul(&twist.angular) }
            }
            Reference::World => {
                let (_, position) = self.frame_placement(model, frame);
                Twist { linear: twist.linear + position.cross(&twist.angular), angular: twist.angular }
            }
        }
    }

    /// Jacobian of `frame` (6 x nv, linear rows first): `jacobian * v` is its velocity in `reference`.
    ///
    /// `out` may be any 6 x nv matrix or view; it is overwritten. Columns of joints that do not move the frame are zero.
    pub fn jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        model: &Model,
        frame: FrameId,
        reference: Reference,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        assert_eq!(out.shape(), (6, model.nv()), "shape of the Jacobian");
        out.fill(0.0);
        let Some(body) = model.frames()[frame.index()].body else { return };
        let (rotation, position) = self.frame_placement(model, frame);
        let point = if reference == Reference::World { Vector3::zeros() } else { position };
        let mut index = body;
        while index != BASE {
            let node = &model.nodes()[index];
            let state = &self.bodies[index];
            let (mut linear, mut angular) = if node.prismatic {
                (state.axis, Vector3::zeros())
            } else {
                (state.axis.cross(&(point - state.position)), state.axis)
            };
            if reference == Reference::Local {
                linear = rotation.tr_mul(&linear);
                angular = rotation.tr_mul(&angular);
            }
            for row in 0..3 {
                out[(row, node.column)] += node.multiplier * linear[row];
                out[(row + 3, node.column)] += node.multiplier * angular[row];
            }
            index = node.parent;
        }
    }

    /// Orientation and origin of `frame` in the world.
    fn frame_placement(&self, model: &Model, frame: FrameId) -> (Matrix3<f64>, Vector3<f64>) {
        let frame = &model.frames()[frame.index()];
        let rotation = frame.placement.rotation.to_rotation_matrix().into_inner();
        let translation = frame.placement.translation.vector;
        match frame.body.map(|index| &self.bodies[index]) {
            Some(body) => (body.rotation * rotation, body.rotation * translation + body.position),
            None => (rotation, translation),
        }
    }
}

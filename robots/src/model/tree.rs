//! The model flattened for the inner loops: one plain record a body, parents first, nothing to look up.

use nalgebra::{Matrix3, Vector3};

use super::{Body, JointKind};
use crate::spatial::skew;

/// No parent body: the fixed base.
pub(crate) const BASE: usize = usize::MAX;

/// One body and the joint above it, in the form the recursions use.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    /// Parent body, or [`BASE`].
    pub(crate) parent: usize,
    /// Translation along the axis instead of rotation about it.
    pub(crate) prismatic: bool,
    /// Unit axis in the body frame.
    pub(crate) axis: Vector3<f64>,
    /// Column of `q`, and position = multiplier * q\[column\] + offset.
    pub(crate) column: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
    /// Body frame at joint position zero, in the parent body.
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Rodrigues' formula folded into the placement: R(x) = rotation + sin x * sine + (1 - cos x) * versine.
    sine: Matrix3<f64>,
    versine: Matrix3<f64>,
    /// Direction of a prismatic axis in the parent body.
    slide: Vector3<f64>,
    /// Mass, first moment of mass and inertia about the origin of the body frame.
    pub(crate) mass: f64,
    pub(crate) moment: Vector3<f64>,
    pub(crate) inertia: Matrix3<f64>,
}

impl Node {
    pub(crate) fn new(body: &Body) -> Self {
        let joint = &body.joint;
        let axis = joint.axis.into_inner();
        let rotation = joint.placement.rotation.to_rotation_matrix().into_inner();
        let k = skew(&axis);
        Self {
            parent: body.parent.unwrap_or(BASE),
            prismatic: joint.kind == JointKind::Prismatic,
            axis,
            column: joint.coordinate.index(),
            multiplier: joint.coordinate.multiplier(),
            offset: joint.coordinate.offset(),
            rotation,
            translation: joint.placement.translation.vector,
            sine: rotation * k,
            versine: rotation * k * k,
            slide: rotation * axis,
            mass: body.inertia.mass,
            moment: body.inertia.com * body.inertia.mass,
            inertia: body.inertia.about_origin(),
        }
    }

    /// Orientation and origin of the body frame in the parent body's frame.
    #[inline]
    pub(crate) fn pose(&self, q: &[f64]) -> (Matrix3<f64>, Vector3<f64>) {
        let x = self.multiplier * q[self.column] + self.offset;
        if self.prismatic {
            (self.rotation, self.translation + self.slide * x)
        } else {
            let (sin, cos) = x.sin_cos();
            (self.rotation + self.sine * sin + self.versine * (1.0 - cos), self.translation)
        }
    }

    /// Velocity (or acceleration) of the joint itself, from that of its column.
    #[inline]
    pub(crate) fn rate(&self, v: &[f64]) -> f64 {
        self.multiplier * v[self.column]
    }
}

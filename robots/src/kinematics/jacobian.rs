//! Jacobians of frames.

use nalgebra::{Dim, Matrix, Point3, StorageMut, Vector3};

use super::{BodyState, Kinematics};
use crate::math::{M3, V3};
use crate::model::flat::FlatModel;
use crate::{FrameId, Model, Reference};

impl Kinematics {
    /// Computes the Jacobian of `frame` (6 x nv, linear rows first). `jacobian * v` is the velocity of the
    /// frame in `reference`.
    ///
    /// `out` may be any 6 x nv matrix or view, and is overwritten. Columns of joints that do not move the
    /// frame are zero.
    pub fn jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        model: &Model,
        frame: FrameId,
        reference: Reference,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        assert_eq!(out.shape(), (6, model.nv()), "shape of the Jacobian");
        clear(out);
        let flat = model.flat();
        let placement = &flat.frame_placements[frame.index()];
        if placement.slot == FlatModel::WORLD {
            return;
        }
        let (rotation, position) = self.placement(model, frame);
        let point = if reference == Reference::World { V3::ZERO } else { position };
        let axes = (reference == Reference::Local).then_some(rotation);
        if flat.floating {
            let base = &self.bodies[0];
            for (column, axis) in [base.rotation.x, base.rotation.y, base.rotation.z].into_iter().enumerate()
            {
                write(out, column, &axes, (axis, V3::ZERO), 1.0);
                write(out, column + 3, &axes, (axis.cross(point - base.position), axis), 1.0);
            }
        }
        let Some(body) = placement.slot.checked_sub(1) else { return };
        for &slot in flat.chain(body) {
            let (node, state) = (&flat.nodes[slot - 1], &self.bodies[slot]);
            write(out, node.column, &axes, column(node.prismatic, state, point), node.multiplier);
        }
    }

    /// Computes the Jacobian of `frame` at `q` (nq). The result equals [`jacobian`](Self::jacobian) after an
    /// update at `q`, but only the bodies that carry `frame` are processed. All other results of the last
    /// update become invalid.
    pub fn jacobian_at<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &mut self,
        model: &Model,
        q: &[f64],
        frame: FrameId,
        reference: Reference,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        if reference == Reference::Local {
            self.local_jacobian(model, q, frame, out);
        } else {
            self.place_carriers(model, q, frame);
            self.jacobian(model, frame, reference, out);
        }
    }

    /// Computes the Jacobian from the frame to the base, in the frame's axes, without world poses.
    fn local_jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &mut self,
        model: &Model,
        q: &[f64],
        frame: FrameId,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        self.check(model, q);
        assert_eq!(out.shape(), (6, model.nv()), "shape of the Jacobian");
        clear(out);
        let flat = model.flat();
        let placement = &flat.frame_placements[frame.index()];
        if placement.slot == FlatModel::WORLD {
            return;
        }
        let chain = placement.slot.checked_sub(1).map_or(&[][..], |body| flat.chain(body));
        self.positions.update_chain(&flat.nodes, chain, q);
        // the frame's pose relative to the current body of the traversal
        let (mut rotation, mut position) = (placement.rotation, placement.position);
        for (place, &slot) in chain.iter().enumerate().rev() {
            let node = &flat.nodes[slot - 1];
            // z and z x position, in the frame's axes
            let axis = V3::new(rotation.x.z, rotation.y.z, rotation.z.z) * node.multiplier;
            let entries = if node.prismatic {
                (axis, V3::ZERO)
            } else {
                let turning = V3::new(-position.y, position.x, 0.0) * node.multiplier;
                (rotation.tr_mul(turning), axis)
            };
            write(out, node.column, &None, entries, 1.0);
            if place > 0 || flat.floating {
                let (r, p) = node.pose(self.positions.get(place));
                rotation = r * rotation;
                position = p + r * position;
            }
        }
        if flat.floating {
            for column in 0..3 {
                let mut axis = [0.0; 3];
                axis[column] = 1.0;
                let axis = V3::from_slice(&axis);
                let turn = rotation.tr_mul(axis);
                write(out, column, &None, (turn, V3::ZERO), 1.0);
                write(out, column + 3, &None, (rotation.tr_mul(axis.cross(position)), turn), 1.0);
            }
        }
    }

    /// Updates only the bodies that carry `frame` to the configuration `q` (nq). Afterwards, the
    /// [`pose`](Self::pose) and [`jacobian`](Self::jacobian) of `frame` are valid. Frames on bodies that do
    /// not carry `frame`, and all velocities, are unchanged.
    pub fn place_carriers(&mut self, model: &Model, q: &[f64], frame: FrameId) {
        self.check(model, q);
        let flat = model.flat();
        (self.bodies[0].rotation, self.bodies[0].position) = flat.base_pose(q);
        let slot = flat.frame_placements[frame.index()].slot;
        if slot == FlatModel::WORLD || slot == 0 {
            return;
        }
        let chain = flat.chain(slot - 1);
        self.positions.update_chain(&flat.nodes, chain, q);
        let mut parent = 0;
        for (place, &slot) in chain.iter().enumerate() {
            let (rotation, translation) = flat.nodes[slot - 1].pose(self.positions.get(place));
            let (r, p) = (self.bodies[parent].rotation, self.bodies[parent].position);
            let body = &mut self.bodies[slot];
            body.rotation = r * rotation;
            body.position = p + r * translation;
            parent = slot;
        }
    }

    /// Computes the Jacobian of `frame` relative to the frame `base` (6 x nv, linear rows first). This
    /// Jacobian maps `v` to the velocity of `frame`'s origin as seen from `base`, in the axes of `base`.
    ///
    /// `scratch` is a second 6 x nv matrix that is overwritten.
    pub fn relative_jacobian<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &self,
        model: &Model,
        base: FrameId,
        frame: FrameId,
        scratch: &mut Matrix<f64, R, C, S>,
        out: &mut Matrix<f64, R, C, S>,
    ) {
        self.jacobian(model, frame, Reference::World, out);
        self.jacobian(model, base, Reference::World, scratch);
        let (axes, _) = self.placement(model, base);
        let (_, point) = self.placement(model, frame);
        for column in 0..model.nv() {
            let entry = |row: usize| out[(row, column)] - scratch[(row, column)];
            let angular = V3::new(entry(3), entry(4), entry(5));
            let linear = V3::new(entry(0), entry(1), entry(2)) + angular.cross(point);
            out.column_mut(column).fill(0.0);
            write(out, column, &Some(axes), (linear, angular), 1.0);
        }
    }

    /// Adds the transposed Jacobian of a point, multiplied by `sign`, to the first three columns of `out`.
    /// `out` has one row per entry of `v` (nv). Each of the three columns belongs to one direction in `axes`.
    /// The point is fixed to body `body` (`None` for the base) and is currently at `point` in the world
    /// \[m\].
    pub fn add_point_jacobian(
        &self,
        model: &Model,
        body: Option<usize>,
        point: &Point3<f64>,
        (axes, sign): (&[Vector3<f64>; 3], f64),
        out: &mut [[f64; 4]],
    ) {
        assert_eq!(out.len(), model.nv(), "rows of the Jacobian");
        let flat = model.flat();
        let point = V3::from(point.coords);
        let axes = axes.map(|axis| V3::from(axis) * sign);
        if flat.floating {
            let base = &self.bodies[0];
            let arm = point - base.position;
            for (part, axis) in axes.into_iter().enumerate() {
                let linear = base.rotation.tr_mul(axis).array();
                let angular = base.rotation.tr_mul(arm.cross(axis)).array();
                for (row, entry) in linear.into_iter().chain(angular).enumerate() {
                    out[row][part] += entry;
                }
            }
        }
        let Some(body) = body else { return };
        for &slot in flat.chain(body) {
            let (node, state) = (&flat.nodes[slot - 1], &self.bodies[slot]);
            let (linear, _) = column(node.prismatic, state, point);
            let linear = linear * node.multiplier;
            for (entry, axis) in out[node.column].iter_mut().zip(axes) {
                *entry += linear.dot(axis);
            }
        }
    }

    /// Adds to `row` (nv) the velocity along `direction`, per unit of each joint velocity, of a point fixed
    /// to `slot` and currently at `point` in the world.
    pub(crate) fn add_point_slope(
        &self,
        model: &Model,
        slot: usize,
        point: V3,
        direction: V3,
        row: &mut [f64],
    ) {
        self.add_point_slope_strided(model, slot, (point, direction), row, 1);
    }

    /// Adds the slope to every `stride`-th entry: a row of a column-major matrix.
    pub(crate) fn add_point_slope_strided(
        &self,
        model: &Model,
        slot: usize,
        (point, direction): (V3, V3),
        row: &mut [f64],
        stride: usize,
    ) {
        if slot == FlatModel::WORLD {
            return;
        }
        let flat = model.flat();
        if flat.floating {
            let base = &self.bodies[0];
            let linear = base.rotation.tr_mul(direction);
            let angular = base.rotation.tr_mul((point - base.position).cross(direction));
            for (column, entry) in linear.array().into_iter().chain(angular.array()).enumerate() {
                row[column * stride] += entry;
            }
        }
        let Some(body) = slot.checked_sub(1) else { return };
        for &slot in flat.chain(body) {
            let (node, state) = (&flat.nodes[slot - 1], &self.bodies[slot]);
            let (linear, _) = column(node.prismatic, state, point);
            row[node.column * stride] += node.multiplier * linear.dot(direction);
        }
    }
}

/// Returns the linear and angular velocity of `point` per unit of the joint's velocity.
#[inline(always)]
pub(super) fn column(prismatic: bool, body: &BodyState, point: V3) -> (V3, V3) {
    let axis = body.rotation.z;
    if prismatic { (axis, V3::ZERO) } else { (axis.cross(point - body.position), axis) }
}

/// Clears all six rows entry by entry; nalgebra's `fill` uses an iterator that is not vectorised.
#[inline(always)]
fn clear<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(out: &mut Matrix<f64, R, C, S>) {
    for column in 0..out.ncols() {
        for row in 0..6 {
            out[(row, column)] = 0.0;
        }
    }
}

/// Adds to a column, rotated into `axes` if given.
#[inline(always)]
fn write<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
    out: &mut Matrix<f64, R, C, S>,
    column: usize,
    axes: &Option<M3>,
    (linear, angular): (V3, V3),
    multiplier: f64,
) {
    let (linear, angular) = match axes {
        Some(axes) => (axes.tr_mul(linear), axes.tr_mul(angular)),
        None => (linear, angular),
    };
    for (row, entry) in linear.array().into_iter().chain(angular.array()).enumerate() {
        out[(row, column)] += multiplier * entry;
    }
}

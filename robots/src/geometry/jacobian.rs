//! Derivatives of distances with respect to the motion of the robot.

use nalgebra::{DMatrix, Vector3};

use super::distance::Proximity;
use super::pairs::CollisionModel;
use crate::math::V3;
use crate::{Kinematics, Model};

impl CollisionModel {
    /// Computes the gradient of a distance with respect to the robot's motion. For a robot velocity `v` and
    /// fixed obstacles, `row . v` is the rate of change of `proximity.distance` \[m/s\]. `row` has nv entries
    /// and is overwritten.
    ///
    /// `kinematics` must be at the configuration for which the distance was computed. The gradient is exact
    /// if the nearest points are unique. Between parallel faces or edges, it is the gradient at the points in
    /// `proximity`.
    pub fn distance_jacobian(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        proximity: &Proximity,
        row: &mut [f64],
    ) {
        assert_eq!(row.len(), model.nv(), "length of the row");
        row.fill(0.0);
        let normal = V3::from(proximity.normal.into_inner());
        for ((solid, point), sign) in
            self.pairs[proximity.pair].into_iter().zip(proximity.points).zip([-1.0, 1.0])
        {
            let point = V3::from(Vector3::from(point.coords));
            kinematics.add_point_slope(model, self.slots[solid], point, normal * sign, row);
        }
    }

    /// Computes the gradients of several distances like [`distance_jacobian`](Self::distance_jacobian), and
    /// writes one gradient per row of `out`. Surplus rows are unchanged.
    ///
    /// Panics if `out` has too few rows, or not nv columns.
    pub fn distance_jacobians(
        &self,
        model: &Model,
        kinematics: &Kinematics,
        proximities: &[Proximity],
        out: &mut DMatrix<f64>,
    ) {
        assert!(out.nrows() >= proximities.len() && out.ncols() == model.nv(), "shape of the Jacobian");
        let rows = out.nrows();
        for (index, proximity) in proximities.iter().enumerate() {
            out.row_mut(index).fill(0.0);
            let normal = V3::from(proximity.normal.into_inner());
            let ends = self.pairs[proximity.pair].into_iter().zip(proximity.points).zip([-1.0, 1.0]);
            for ((solid, point), sign) in ends {
                let point = V3::from(Vector3::from(point.coords));
                let entries = &mut out.as_mut_slice()[index..];
                kinematics.add_point_slope_strided(
                    model,
                    self.slots[solid],
                    (point, normal * sign),
                    entries,
                    rows,
                );
            }
        }
    }
}

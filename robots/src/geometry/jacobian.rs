//! Derivatives of distances with respect to the motion of the robot.

use nalgebra::{DMatrix, Vector3};

use super::distance::Proximity;
use super::pairs::CollisionModel;
use crate::algebra::V3;
use crate::{Kinematics, Model};

impl CollisionModel {
    /// Slope of a distance: `row . v` is the rate at which `proximity.distance` grows \[m/s\] while the robot moves
    /// with `v` and obstacles stand still. `row` is nv long; it is overwritten.
    ///
    /// `kinematics` must stand where the distance was measured. The slope is exact wherever the nearest points are
    /// unique; between parallel faces or edges it is that of the points found.
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

    /// [`distance_jacobian`](Self::distance_jacobian) of several: one row each. Rows of `out` beyond them are not
    /// touched.
    ///
    /// Panics when `out` has fewer rows than there are proximities, or not nv columns.
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

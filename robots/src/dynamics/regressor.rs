//! The inertial-parameter regressor. It expresses the efforts as a linear function of the masses, first
//! moments and inertias of the bodies.

use nalgebra::{DMatrix, DVector, Vector3};

use super::Dynamics;
use crate::Model;
use crate::math::{M3, Spatial, V3};

/// Number of inertial parameters of one body: mass, mass times centre of mass (x, y, z), then the inertia
/// about the origin of the body frame as xx, xy, yy, xz, yz, zz (Pinocchio's order). All vectors and tensors
/// are in the axes of the body frame.
pub const PARAMETERS: usize = 10;

impl Model {
    /// Returns the inertial parameters, ten per body in the order of [`bodies`](Self::bodies). A floating
    /// base comes first.
    pub fn inertial_parameters(&self) -> DVector<f64> {
        let base = self.base().floating.then_some(&self.base().inertia);
        let all = base.into_iter().chain(self.bodies().iter().map(|body| &body.inertia));
        let numbers: Vec<f64> = all
            .flat_map(|inertia| {
                let (h, i) = (inertia.com * inertia.mass, inertia.about_origin());
                [
                    inertia.mass,
                    h.x,
                    h.y,
                    h.z,
                    i[(0, 0)],
                    i[(0, 1)],
                    i[(1, 1)],
                    i[(0, 2)],
                    i[(1, 2)],
                    i[(2, 2)],
                ]
            })
            .collect();
        DVector::from_vec(numbers)
    }

    /// Returns the number of columns of the regressor: ten per body, including a floating base.
    pub fn parameter_count(&self) -> usize {
        PARAMETERS * (self.bodies().len() + usize::from(self.base().floating))
    }
}

impl Dynamics {
    /// Computes the regressor of inverse dynamics (nv x [`Model::parameter_count`]), such that `rnea(q, v, a)
    /// = out * model.inertial_parameters()`. The regressor excludes rotor inertias: for a joint with a rotor,
    /// `rnea` returns this product plus armature times acceleration.
    pub fn regressor(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        gravity: Vector3<f64>,
        out: &mut DMatrix<f64>,
    ) {
        assert_eq!(out.shape(), (model.nv(), model.parameter_count()), "shape of the regressor");
        // Computes the motions of all bodies, in their node frames; the efforts are not used.
        self.motions(model, q, v, a, gravity);
        let flat = model.flat();
        out.fill(0.0);
        let mut column = 0;
        for slot in usize::from(!flat.floating)..=flat.nodes.len() {
            // From the node frame to the body frame; the base has a single frame.
            let align = slot.checked_sub(1).map_or(M3::IDENTITY, |body| flat.align[body]);
            let (acceleration, w, dw) = self.local[slot].motion();
            let motion = (align * acceleration, align * w, align * dw);
            for (place, wrench) in wrenches(motion).into_iter().enumerate() {
                let mut wrench =
                    Spatial { linear: align.tr_mul(wrench.linear), angular: align.tr_mul(wrench.angular) };
                let mut at = slot;
                while at != 0 {
                    let node = &flat.nodes[at - 1];
                    let share = if node.prismatic { wrench.linear.z } else { wrench.angular.z };
                    out[(node.column, column + place)] += node.multiplier * share;
                    wrench = self.local[at].to_parent(wrench);
                    at = node.parent;
                }
                if flat.floating {
                    for (row, entry) in wrench.array().into_iter().enumerate() {
                        out[(row, column + place)] = entry;
                    }
                }
            }
            column += PARAMETERS;
        }
    }
}

/// Returns the wrench per unit of each parameter, for a body with this (classical) acceleration of its
/// origin, angular velocity `w` and angular acceleration `dw`, all in its axes.
fn wrenches((acceleration, w, dw): (V3, V3, V3)) -> [Spatial; PARAMETERS] {
    let unit = [M3::IDENTITY.x, M3::IDENTITY.y, M3::IDENTITY.z];
    let moment = |h: V3| Spatial::new(dw.cross(h) + w.cross(w.cross(h)), h.cross(acceleration));
    // I dw + w x I w for I with ones at (i, j) and (j, i).
    let inertia = |i: usize, j: usize| {
        let apply = |x: V3| {
            let x = x.array();
            if i == j { unit[i] * x[i] } else { unit[i] * x[j] + unit[j] * x[i] }
        };
        Spatial::new(V3::ZERO, apply(dw) + w.cross(apply(w)))
    };
    [
        Spatial::new(acceleration, V3::ZERO),
        moment(unit[0]),
        moment(unit[1]),
        moment(unit[2]),
        inertia(0, 0),
        inertia(0, 1),
        inertia(1, 1),
        inertia(0, 2),
        inertia(1, 2),
        inertia(2, 2),
    ]
}

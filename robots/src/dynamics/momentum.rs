//! Centroidal momentum and energies (Orin, Goswami and Lee 2013).

use nalgebra::{Dim, Matrix, StorageMut, Vector3};

use super::Dynamics;
use crate::Model;
use crate::math::{M3, Spatial, V3, Work, widest};
use crate::model::flat::FlatModel;

/// Momentum of a whole robot about its centre of mass, or the rate of change of this momentum, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Momentum {
    /// Linear momentum \[kg m/s\], or its rate \[N\].
    pub linear: Vector3<f64>,
    /// Angular momentum about the centre of mass \[kg m2/s\], or its rate \[Nm\].
    pub angular: Vector3<f64>,
}

impl Dynamics {
    /// Computes the centroidal momentum matrix (6 x nv, linear rows first). `out * v` is the momentum of all
    /// moving bodies about the centre of mass, in world axes.
    pub fn centroidal_map<R: Dim, C: Dim, S: StorageMut<f64, R, C>>(
        &mut self,
        model: &Model,
        q: &[f64],
        out: &mut Matrix<f64, R, C, S>,
    ) {
        assert_eq!(out.shape(), (6, model.nv()), "shape of the momentum matrix");
        let flat = model.flat();
        let (axes, centre) = self.compose(model, q);
        if flat.coupled {
            out.fill(0.0);
        }
        for (node, body) in flat.nodes.iter().zip(&self.composite[1..]) {
            let momentum = about(&axes, centre, body.inertia.apply(body.joint) * node.multiplier);
            for (row, entry) in momentum.array().into_iter().enumerate() {
                if flat.coupled { out[(row, node.column)] += entry } else { out[(row, node.column)] = entry }
            }
        }
        if flat.floating {
            for column in 0..6 {
                let mut unit = [0.0; 6];
                unit[column] = 1.0;
                let momentum = self.composite[0].inertia.apply(Spatial::from_slice(&unit));
                for (row, entry) in about(&axes, centre, momentum).array().into_iter().enumerate() {
                    out[(row, column)] = entry;
                }
            }
        }
    }

    /// Returns the momentum of all moving bodies about the centre of mass, in world axes.
    pub fn momentum(&mut self, model: &Model, q: &[f64], v: &[f64]) -> Momentum {
        assert_eq!(v.len(), model.nv(), "length of v");
        let flat = model.flat();
        let (axes, centre) = self.compose(model, q);
        about(&axes, centre, self.momentum_at_base(flat, v)).into()
    }

    /// Returns the momentum about the origin of the base, in its axes. The inertias must have been
    /// [composed](Self::compose).
    #[inline(always)]
    fn momentum_at_base(&self, flat: &FlatModel, v: &[f64]) -> Spatial {
        let mut sum = Spatial::ZERO;
        for (node, body) in flat.nodes.iter().zip(&self.composite[1..]) {
            sum += body.inertia.apply(body.joint) * (node.multiplier * v[node.column]);
        }
        if flat.floating {
            sum += self.composite[0].inertia.apply(Spatial::from_slice(v));
        }
        sum
    }

    /// Sets the velocity of a floating base (the first six entries of `v`) such that the robot has this
    /// momentum. Returns `false` and changes nothing if the base is fixed or the robot's inertia is singular.
    ///
    /// ```
    /// use std::path::Path;
    /// use motorium_robots::{Dynamics, load};
    ///
    /// let quadruped = load("quadruped", Path::new(".")).unwrap().model;
    /// let mut dynamics = Dynamics::new(&quadruped);
    /// let (q, mut v) = (quadruped.neutral(), vec![0.3; quadruped.nv()]);
    /// let before = dynamics.momentum(&quadruped, &q, &v);
    /// v[7] = -2.0;
    /// assert!(dynamics.set_momentum(&quadruped, &q, &mut v, &before));
    /// let after = dynamics.momentum(&quadruped, &q, &v);
    /// assert!((after.linear - before.linear).norm() < 1e-12 && (after.angular - before.angular).norm() < 1e-12);
    /// ```
    pub fn set_momentum(&mut self, model: &Model, q: &[f64], v: &mut [f64], momentum: &Momentum) -> bool {
        assert_eq!(v.len(), model.nv(), "length of v");
        let flat = model.flat();
        if !flat.floating {
            return false;
        }
        let (axes, centre, sum) = widest(MomentumNow { dynamics: self, model, motion: (q, v) });
        // The missing momentum, with the angular part about the centre of mass. A motion of the whole robot
        // as one rigid body adds it.
        let linear = axes.tr_mul(momentum.linear.into()) - sum.linear;
        let angular = axes.tr_mul(momentum.angular.into()) - (sum.angular - centre.cross(sum.linear));
        let total = &self.composite[0].inertia;
        let about_centre = total.about_centre();
        let Some(turn) = about_centre.cholesky().map(|factor| factor.solve(&angular.into())) else {
            return false;
        };
        let turn = V3::from(turn);
        let motion = linear * (1.0 / total.mass) - turn.cross(centre);
        let missing = Spatial::new(motion, turn).array();
        v.iter_mut().zip(missing).for_each(|(v, missing)| *v += missing);
        true
    }

    /// Returns the rate of change of the [`momentum`](Self::momentum): `Ag a + Agdot v`, with the centroidal
    /// momentum matrix `Ag`. With `a = 0`, the rate is the drift `Agdot v`.
    pub fn momentum_rate(&mut self, model: &Model, q: &[f64], v: &[f64], a: &[f64]) -> Momentum {
        // Without gravity, the wrench at the base is the rate of change of the momentum.
        self.base_wrench(model, q, v, a);
        let (axes, centre) = self.compose(model, q);
        about(&axes, centre, self.local[0].wrench).into()
    }

    /// Returns the kinetic energy `v' M(q) v / 2` \[J\].
    pub fn kinetic_energy(&mut self, model: &Model, q: &[f64], v: &[f64]) -> f64 {
        let mut impulse = std::mem::take(&mut self.scratch);
        impulse.resize(model.nv(), 0.0);
        let mut zero = std::mem::take(&mut self.zero);
        zero.resize(model.nv(), 0.0);
        self.rnea(model, q, &zero, v, Vector3::zeros(), &mut impulse);
        let energy = 0.5 * impulse.iter().zip(v).map(|(p, v)| p * v).sum::<f64>();
        (self.scratch, self.zero) = (impulse, zero);
        energy
    }

    /// Returns the potential energy of all moving bodies \[J\]. The energy is zero if the centre of mass is
    /// at the world's origin.
    pub fn potential_energy(&mut self, model: &Model, q: &[f64], gravity: Vector3<f64>) -> f64 {
        let (axes, _) = self.compose(model, q);
        let (_, position) = model.flat().base_pose(q);
        let inertia = &self.composite[0].inertia;
        -V3::from(gravity).dot(position * inertia.mass + axes * inertia.moment)
    }

    /// Composes the inertias of all bodies. Returns the base's axes in the world and the centre of mass in
    /// base coordinates.
    #[inline(always)]
    fn compose(&mut self, model: &Model, q: &[f64]) -> (M3, V3) {
        self.set_positions(model, q);
        let flat = model.flat();
        self.sweep(flat);
        for (index, node) in flat.nodes.iter().enumerate().rev() {
            let (outer, inner) = self.composite.split_at_mut(index + 1);
            outer[node.parent].inertia += inner[0].inertia;
        }
        let total = &self.composite[0].inertia;
        (flat.base_pose(q).0, total.moment * (1.0 / total.mass))
    }
}

/// The base's axes in the world, the centre of mass, and the momentum about the base's origin, in its axes.
struct MomentumNow<'a> {
    dynamics: &'a mut Dynamics,
    model: &'a Model,
    motion: (&'a [f64], &'a [f64]),
}

impl Work for MomentumNow<'_> {
    type Output = (M3, V3, Spatial);

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        let Self { dynamics, model, motion: (q, v) } = self;
        let (axes, centre) = dynamics.compose(model, q);
        (axes, centre, dynamics.momentum_at_base(model.flat(), v))
    }
}

/// Moves a momentum or wrench from the base's origin to `centre` and rotates it into world axes.
#[inline(always)]
fn about(axes: &M3, centre: V3, wrench: Spatial) -> Spatial {
    Spatial { linear: *axes * wrench.linear, angular: *axes * (wrench.angular - centre.cross(wrench.linear)) }
}

impl From<Spatial> for Momentum {
    fn from(momentum: Spatial) -> Self {
        Self { linear: momentum.linear.into(), angular: momentum.angular.into() }
    }
}

//! Analytical derivatives of inverse and forward dynamics.
//!
//! The formulas are from Singh, Russell and Wensing, "Efficient Analytical Derivatives of Rigid-Body Dynamics
//! Using Spatial Vector Algebra" (RA-L 2022), in base coordinates. The Coriolis matrix `B` of a body maps a
//! motion `w` to `sum m J' (w_angular x velocity)` over its points. Twelve numbers represent it, for
//! composites too: the linear momentum, and the moment's part as a 3 x 3 matrix.

use nalgebra::{DMatrix, Vector3};

use super::coriolis::Coriolis;
use super::recursion::BodyDerivatives;
use super::{Dynamics, SingularMassMatrix};
use crate::Model;
use crate::math::{Spatial, V3, Work, fused, widest};
use crate::model::flat::FlatModel;

/// Derivatives of a vector of efforts or accelerations. Each derivative is an nv x nv matrix.
///
/// The derivative with respect to `q` is taken along the manifold of configurations: column `i` is the change
/// of the vector per `dt` when `q` changes to `integrate(q, e_i dt)`.
#[derive(Clone, Debug, PartialEq)]
pub struct Derivatives {
    /// Derivative with respect to the configuration.
    pub q: DMatrix<f64>,
    /// Derivative with respect to the velocity.
    pub v: DMatrix<f64>,
    /// Derivative with respect to the accelerations (inverse dynamics: `M`) or the efforts (forward dynamics:
    /// `M^-1`).
    pub input: DMatrix<f64>,
}

impl Derivatives {
    /// Allocates the matrices for a model with `model.nv()` velocities.
    pub fn new(model: &Model) -> Self {
        let zeros = DMatrix::zeros(model.nv(), model.nv());
        Self { q: zeros.clone(), v: zeros.clone(), input: zeros }
    }
}

impl Dynamics {
    /// Computes the derivatives of `tau`, the result of [`rnea`](Self::rnea), with respect to `q`, `v` and
    /// `a`.
    pub fn rnea_derivatives(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        a: &[f64],
        gravity: Vector3<f64>,
        out: &mut Derivatives,
    ) {
        let n = model.nv();
        assert!(v.len() == n && a.len() == n, "length of v and a");
        assert!(
            out.q.nrows() == n && out.v.nrows() == n && out.input.nrows() == n,
            "size of the derivatives"
        );
        self.set_positions(model, q);
        let flat = model.flat();
        self.sweep(flat);
        self.vary(flat, q, (v, a), gravity);
        for matrix in [&mut out.q, &mut out.v, &mut out.input] {
            matrix.fill(0.0);
        }
        for index in (0..flat.nodes.len()).rev() {
            self.differentiate(flat, index, out);
            let parent = flat.nodes[index].parent;
            let (outer, inner) = self.composite.split_at_mut(index + 1);
            outer[parent].inertia += inner[0].inertia;
            let (outer, inner) = self.body_derivatives.split_at_mut(index + 1);
            outer[parent].coriolis.add(&inner[0].coriolis);
            outer[parent].wrench += inner[0].wrench;
        }
        if flat.floating {
            self.differentiate_base(out);
        }
    }

    /// Computes the derivatives of `a`, the result of [`forward`](Self::forward), with respect to `q`, `v`
    /// and `tau`. `a_out` receives `a`.
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`]. In this case the outputs are unspecified.
    pub fn forward_derivatives(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        a_out: &mut [f64],
        out: &mut Derivatives,
    ) -> Result<(), SingularMassMatrix> {
        // a(q) with tau(q, v, a) = const: da = -M^-1 dtau.
        self.forward(model, q, v, tau, gravity, a_out)?;
        self.rnea_derivatives(model, q, v, a_out, gravity, out);
        self.factor.factor(&out.input)?;
        self.factor.inverse(&mut out.input);
        for matrix in [&mut out.q, &mut out.v] {
            self.mass.copy_from(matrix);
            widest(Response { mobility: &out.input, change: &self.mass, out: matrix });
        }
        Ok(())
    }

    /// Outward pass: velocities, accelerations and their variations.
    #[inline(always)]
    fn vary(&mut self, flat: &FlatModel, q: &[f64], (v, a): (&[f64], &[f64]), gravity: Vector3<f64>) {
        let up = Spatial::new(flat.base_pose(q).0.tr_mul(-V3::from(gravity)), V3::ZERO);
        let base = &mut self.body_derivatives[0];
        *base = BodyDerivatives { acceleration: up, second: up, ..BodyDerivatives::START };
        if flat.floating {
            base.velocity = Spatial::from_slice(v);
            base.acceleration += Spatial::from_slice(a);
            base.coriolis = Coriolis::new(&flat.base, base.velocity);
            base.wrench = flat.base.apply(base.acceleration)
                + base.velocity.cross_wrench(flat.base.apply(base.velocity));
        }
        for (index, node) in flat.nodes.iter().enumerate() {
            let (outer, inner) = self.body_derivatives.split_at_mut(index + 1);
            let (parent, body_derivatives) = (&outer[node.parent], &mut inner[0]);
            let body = &self.composite[index + 1];
            let first = parent.velocity.cross_motion(body.joint);
            let second = parent.acceleration.cross_motion(body.joint) + parent.velocity.cross_motion(first);
            let (rate, rate_of_rate) = (node.multiplier * v[node.column], node.multiplier * a[node.column]);
            let velocity = parent.velocity + body.joint * rate;
            let acceleration = parent.acceleration + body.joint * rate_of_rate + first * rate;
            let inertia = &body.inertia;
            *body_derivatives = BodyDerivatives {
                velocity,
                acceleration,
                first,
                second,
                coriolis: Coriolis::new(inertia, velocity),
                wrench: inertia.apply(acceleration) + velocity.cross_wrench(inertia.apply(velocity)),
            };
        }
    }

    /// Computes the entries that couple the joint of body `index` with itself and its carriers.
    #[inline(always)]
    fn differentiate(&self, flat: &FlatModel, index: usize, out: &mut Derivatives) {
        let node = &flat.nodes[index];
        let (body, body_derivatives) = (&self.composite[index + 1], &self.body_derivatives[index + 1]);
        let joint = body.joint * node.multiplier;
        let n = flat.above.len();
        let (by_q, by_v, by_a) = (out.q.as_mut_slice(), out.v.as_mut_slice(), out.input.as_mut_slice());
        // A joint's motion does not change along itself; its rate is relative to the parent and counts twice.
        let first = body_derivatives.first * node.multiplier;
        let weight = body.inertia.apply(joint);
        let spin = body_derivatives.coriolis.twice_transposed(joint);
        let change_q = body_derivatives.coriolis.twice(first)
            + body.inertia.apply(body_derivatives.second * node.multiplier)
            + joint.cross_wrench(body_derivatives.wrench);
        let change_v = body_derivatives.coriolis.twice(joint) + body.inertia.apply(first * 2.0);
        let column = node.column;
        by_q[column * n + column] += joint.dot(change_q);
        by_v[column * n + column] += joint.dot(change_v);
        by_a[column * n + column] += joint.dot(weight) + node.armature;
        let mut ancestor = node.parent;
        while ancestor != 0 {
            let above = &flat.nodes[ancestor - 1];
            let (other, motion) =
                (&self.body_derivatives[ancestor], self.composite[ancestor].joint * above.multiplier);
            let (theirs, mine) = (above.column * n + column, column * n + above.column);
            by_q[mine] += motion.dot(change_q);
            by_v[mine] += motion.dot(change_v);
            let first = other.first * above.multiplier;
            by_q[theirs] += spin.dot(first.angular) + weight.dot(other.second * above.multiplier);
            by_v[theirs] += spin.dot(motion.angular) + weight.dot(first) * 2.0;
            let mass = weight.dot(motion);
            by_a[mine] += mass;
            by_a[theirs] += mass;
            ancestor = above.parent;
        }
        if flat.floating {
            for (row, ((q, v), a)) in
                change_q.array().into_iter().zip(change_v.array()).zip(weight.array()).enumerate()
            {
                by_q[column * n + row] += q;
                by_v[column * n + row] += v;
                by_a[column * n + row] += a;
                by_a[row * n + column] += a;
            }
            // With respect to the base's motions: unit vectors that rotate with the base.
            let base = &self.body_derivatives[0];
            let by_turn = weight.linear.cross(base.second.linear);
            let rates = transposed_cross(base.velocity, weight);
            for (k, entry) in by_turn.array().into_iter().enumerate() {
                by_q[(k + 3) * n + column] += entry;
            }
            let spins = Spatial::new(V3::ZERO, spin) + rates;
            for (k, entry) in spins.array().into_iter().enumerate() {
                by_v[k * n + column] += entry;
            }
        }
    }

    fn differentiate_base(&self, out: &mut Derivatives) {
        let (inertia, base) = (&self.composite[0].inertia, &self.body_derivatives[0]);
        for column in 0..6 {
            let mut unit = [0.0; 6];
            unit[column] = 1.0;
            let unit = Spatial::from_slice(&unit);
            let change_q = inertia.apply(base.second.cross_motion(unit));
            let change_v = base.coriolis.twice(unit) + inertia.apply(base.velocity.cross_motion(unit));
            let weight = inertia.apply(unit);
            for row in 0..6 {
                out.q[(row, column)] = change_q.array()[row];
                out.v[(row, column)] = change_v.array()[row];
                out.input[(row, column)] = weight.array()[row];
            }
        }
    }
}

/// `out = -mobility change`: accelerations that compensate a change of the efforts.
struct Response<'a> {
    mobility: &'a DMatrix<f64>,
    change: &'a DMatrix<f64>,
    out: &'a mut DMatrix<f64>,
}

/// Number of rows computed in registers.
const ROWS: usize = 16;

impl Work for Response<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let n = self.out.nrows();
        let mobility = self.mobility.as_slice();
        let columns = self.out.as_mut_slice().chunks_exact_mut(n).zip(self.change.as_slice().chunks_exact(n));
        for (out, change) in columns {
            let mut row = 0;
            while row + ROWS <= n {
                respond::<FUSED, ROWS>(mobility, change, row, out);
                row += ROWS;
            }
            while row + 4 <= n {
                respond::<FUSED, 4>(mobility, change, row, out);
                row += 4;
            }
            while row < n {
                respond::<FUSED, 1>(mobility, change, row, out);
                row += 1;
            }
        }
    }
}

/// Computes `N` rows of one column. Joints that do not carry each other have zeros in `change` and are
/// skipped.
#[inline(always)]
fn respond<const FUSED: bool, const N: usize>(mobility: &[f64], change: &[f64], row: usize, out: &mut [f64]) {
    let mut sum = [0.0; N];
    for (column, &change) in mobility.chunks_exact(change.len()).zip(change) {
        if change != 0.0
            && let Some(column) = column[row..].first_chunk::<N>()
        {
            for lane in 0..N {
                sum[lane] = fused::<FUSED>(-column[lane], change, sum[lane]);
            }
        }
    }
    out[row..row + N].copy_from_slice(&sum);
}

/// Returns the vector with `result . x == wrench . (v x x)` for every motion `x`.
#[inline(always)]
fn transposed_cross(v: Spatial, wrench: Spatial) -> Spatial {
    // (v x)' = -(v x*)
    -v.cross_wrench(wrench)
}

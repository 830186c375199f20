//! Sparsity-preserving factorisation of the mass matrix (Featherstone 2005; 2008, section 6.5).

use nalgebra::DMatrix;

use crate::Model;
use crate::math::{Work, fused, widest};

/// Error of a mass matrix that is not positive definite, because a joint moves no inertia.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the mass matrix is not positive definite at entry {index} of v, because the links beyond that joint have no inertia; \
     give them a mass and a rotational inertia, or make the joint fixed"
)]
pub struct SingularMassMatrix {
    /// Index in `v` where the factorisation failed.
    pub index: usize,
}

/// The factors of a mass matrix `M = L' D L`, with L unit lower triangular. L is as sparse as M: it has an
/// entry for two joints only if one of them carries the other.
#[derive(Clone, Debug)]
pub struct MassFactor {
    above: Vec<usize>,
    /// D on the diagonal, L' above it.
    factor: DMatrix<f64>,
    /// `D^-1/2`.
    scales: Vec<f64>,
}

impl MassFactor {
    /// Allocates the factors for the mass matrix of `model`.
    pub fn new(model: &Model) -> Self {
        let n = model.nv();
        Self { above: model.flat().above.clone(), factor: DMatrix::identity(n, n), scales: vec![1.0; n] }
    }

    /// Factorises the mass matrix `mass`. Only its upper triangle is read.
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`]. In this case the factors are unspecified.
    pub fn factor(&mut self, mass: &DMatrix<f64>) -> Result<(), SingularMassMatrix> {
        widest(Factor { factor: self, mass })
    }

    #[inline(always)]
    fn take_apart<const FUSED: bool>(&mut self, mass: &DMatrix<f64>) -> Result<(), SingularMassMatrix> {
        self.factor.copy_from(mass);
        let n = self.above.len();
        let above = &*self.above;
        let m = self.factor.as_mut_slice();
        for k in (0..n).rev() {
            // columns right of k are complete, and column k includes their updates
            let pivot = m[k * n + k];
            if pivot.is_nan() || pivot <= mass[(k, k)] * 1e-14 {
                return Err(SingularMassMatrix { index: k });
            }
            let inverse = 1.0 / pivot;
            self.scales[k] = inverse.sqrt();
            let (left, right) = m.split_at_mut(k * n);
            let column = &mut right[..n];
            let mut i = k;
            while above[i] != i {
                i = above[i];
                let scale = column[i] * inverse;
                let target = &mut left[i * n..][..n];
                let mut j = i;
                loop {
                    target[j] -= scale * column[j];
                    if above[j] == j {
                        break;
                    }
                    j = above[j];
                }
                // entries closer to the base need the unscaled ones below only in products, so scale in place
                column[i] = scale;
            }
        }
        Ok(())
    }

    /// Solves `M x = b` in place: on entry, `x` holds the right-hand side `b`; on return, it holds the
    /// solution.
    pub fn solve(&self, x: &mut [f64]) {
        let n = self.above.len();
        assert_eq!(x.len(), n, "length of the right-hand side");
        let l = self.factor.as_slice();
        for k in (0..n).rev() {
            let column = &l[k * n..][..n];
            let value = x[k];
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                x[i] -= column[i] * value;
            }
        }
        for (k, x) in x.iter_mut().enumerate() {
            *x /= l[k * n + k];
        }
        for k in 0..n {
            let column = &l[k * n..][..n];
            let mut value = x[k];
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                value -= column[i] * x[i];
            }
            x[k] = value;
        }
    }

    /// Extends a set of marked entries of `v` by the entries of all joints that carry a marked joint.
    /// `marked` has nv entries. If a right-hand side is only nonzero in the entries marked on entry, its
    /// [half solution](Self::half_solve) is only nonzero in the entries marked on return.
    pub fn mark_carriers(&self, marked: &mut [bool]) {
        assert_eq!(marked.len(), self.above.len(), "length of the marks");
        for k in (0..marked.len()).rev() {
            marked[self.above[k]] |= marked[k];
        }
    }

    /// Computes half of the solution for four right-hand sides `b` simultaneously: `y = D^-1/2 L'^-1 b`, so
    /// that `b1' M^-1 b2 = y1' y2`.
    ///
    /// Row k of `y` contains entry k of each right-hand side. `support` lists the nonzero rows in ascending
    /// order, [including carriers](Self::mark_carriers). Rows that are not listed are not read.
    pub fn half_solve(&self, support: &[u32], y: &mut [[f64; 4]]) {
        let n = self.above.len();
        assert_eq!(y.len(), n, "length of the right-hand sides");
        let l = self.factor.as_slice();
        for &k in support.iter().rev() {
            let k = k as usize;
            let column = &l[k * n..][..n];
            let value = y[k];
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                for (entry, value) in y[i].iter_mut().zip(value) {
                    *entry -= column[i] * value;
                }
            }
            let scale = self.scales[k];
            y[k] = value.map(|entry| entry * scale);
        }
    }

    /// Computes the second half of the solution, `x = L^-1 D^-1/2 y`, in place. If `y` comes from
    /// [`half_solve`](Self::half_solve), the result is `x = M^-1 b`.
    pub fn finish_solve(&self, x: &mut [f64]) {
        let n = self.above.len();
        assert_eq!(x.len(), n, "length of the right-hand side");
        let l = self.factor.as_slice();
        for k in 0..n {
            let column = &l[k * n..][..n];
            let mut value = x[k] * self.scales[k];
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                value -= column[i] * x[i];
            }
            x[k] = value;
        }
    }

    /// Solves `X M = B` for `X` in place: on entry, `b` holds `B`, with any number of rows; on return, it
    /// holds `X`. M is symmetric, so each row of `X` is the solution of `M x = b` for the corresponding row
    /// of `B`.
    pub fn solve_right(&self, b: &mut DMatrix<f64>) {
        widest(SolveRight { factor: self, b });
    }

    #[inline(always)]
    fn divide<const FUSED: bool>(&self, b: &mut DMatrix<f64>) {
        let n = self.above.len();
        assert_eq!(b.ncols(), n, "columns of the right-hand side");
        let rows = b.nrows();
        let (l, b) = (self.factor.as_slice(), b.as_mut_slice());
        // Whole columns at a time: they are contiguous.
        for k in (0..n).rev() {
            let (left, right) = b.split_at_mut(k * rows);
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                subtract::<FUSED>(&mut left[i * rows..][..rows], &right[..rows], l[k * n + i]);
            }
        }
        for k in 0..n {
            let inverse = 1.0 / l[k * n + k];
            b[k * rows..][..rows].iter_mut().for_each(|entry| *entry *= inverse);
        }
        for k in 0..n {
            let (left, right) = b.split_at_mut(k * rows);
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                subtract::<FUSED>(&mut right[..rows], &left[i * rows..][..rows], l[k * n + i]);
            }
        }
    }

    /// Computes both triangles of the inverse `M^-1`.
    pub fn inverse(&self, out: &mut DMatrix<f64>) {
        widest(Inverse { factor: self, out });
    }

    #[inline(always)]
    fn invert<const FUSED: bool>(&self, out: &mut DMatrix<f64>) {
        let n = self.above.len();
        assert_eq!(out.shape(), (n, n), "shape of the inverse");
        out.fill_with_identity();
        let (l, out) = (self.factor.as_slice(), out.as_mut_slice());
        // As in `solve_right`, from the diagonal of each column downwards: above it the first pass leaves
        // zeros, and the second pass follows by symmetry.
        for k in (0..n).rev() {
            let (left, right) = out.split_at_mut(k * n);
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                subtract::<FUSED>(&mut left[i * n..][k..n], &right[k..n], l[k * n + i]);
            }
        }
        for k in 0..n {
            let inverse = 1.0 / l[k * n + k];
            out[k * n..][k..n].iter_mut().for_each(|entry| *entry *= inverse);
        }
        for k in 0..n {
            let (left, right) = out.split_at_mut(k * n);
            let mut i = k;
            while self.above[i] != i {
                i = self.above[i];
                subtract::<FUSED>(&mut right[k..n], &left[i * n..][k..n], l[k * n + i]);
            }
        }
        for column in 1..n {
            for row in 0..column {
                out[column * n + row] = out[row * n + column];
            }
        }
    }
}

struct Factor<'a> {
    factor: &'a mut MassFactor,
    mass: &'a DMatrix<f64>,
}

impl Work for Factor<'_> {
    type Output = Result<(), SingularMassMatrix>;

    #[inline(always)]
    fn run<const FUSED: bool>(self) -> Self::Output {
        self.factor.take_apart::<FUSED>(self.mass)
    }
}

struct SolveRight<'a> {
    factor: &'a MassFactor,
    b: &'a mut DMatrix<f64>,
}

impl Work for SolveRight<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.factor.divide::<FUSED>(self.b);
    }
}

struct Inverse<'a> {
    factor: &'a MassFactor,
    out: &'a mut DMatrix<f64>,
}

impl Work for Inverse<'_> {
    type Output = ();

    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        self.factor.invert::<FUSED>(self.out);
    }
}

/// `target -= scale * source`
#[inline(always)]
fn subtract<const FUSED: bool>(target: &mut [f64], source: &[f64], scale: f64) {
    for (target, source) in target.iter_mut().zip(source) {
        *target = fused::<FUSED>(-scale, *source, *target);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dynamics, Kinematics, Reference, load};
    use nalgebra::{Matrix6xX, Point3, Vector3};

    #[test]
    fn half_solves_combine_to_the_full_solution() {
        for name in ["quadruped", "panda", "humanoid"] {
            let robot = load(name, std::path::Path::new(".")).unwrap();
            let (model, profile) = (&robot.model, robot.profile.as_ref().unwrap());
            let q = profile.configuration(model, &profile.home).unwrap();
            let n = model.nv();
            let mut mass = DMatrix::zeros(n, n);
            Dynamics::new(model).crba(model, q.as_slice(), &mut mass);
            let mut factor = MassFactor::new(model);
            factor.factor(&mass).unwrap();
            // Jacobian of a point of the last body, computed independently.
            let mut kinematics = Kinematics::new(model);
            kinematics.update(model, q.as_slice());
            let body = model.bodies().len() - 1;
            let frame = model.frames().iter().find(|frame| frame.body == Some(body)).unwrap();
            let frame = model.frame(&frame.name).unwrap();
            let mut jacobian = Matrix6xX::zeros(n);
            kinematics.jacobian(model, frame, Reference::LocalWorldAligned, &mut jacobian);
            let point = Point3::from(kinematics.pose(model, frame).translation.vector);
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let mut y = vec![[0.0; 4]; n];
            kinematics.add_point_jacobian(model, Some(body), &point, (&axes, 1.0), &mut y);
            for (column, found) in y.iter().enumerate() {
                for axis in 0..3 {
                    assert!((found[axis] - jacobian[(axis, column)]).abs() < 1e-14, "{name}");
                }
            }
            let mut marked: Vec<bool> = y.iter().map(|row| *row != [0.0; 4]).collect();
            factor.mark_carriers(&mut marked);
            let support: Vec<u32> = (0..n as u32).filter(|k| marked[*k as usize]).collect();
            factor.half_solve(&support, &mut y);
            for side in 0..3 {
                let mut whole: Vec<f64> = jacobian.row(side).iter().copied().collect();
                factor.solve(&mut whole);
                let mut halves: Vec<f64> = y.iter().map(|row| row[side]).collect();
                factor.finish_solve(&mut halves);
                for (whole, halves) in whole.iter().zip(&halves) {
                    assert!(
                        (whole - halves).abs() < 1e-9 * (1.0 + whole.abs()),
                        "{name}: {whole} and {halves}"
                    );
                }
            }
        }
    }
}

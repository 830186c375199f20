//! Forward dynamics and the inverse of the mass matrix.

use nalgebra::{DMatrix, Vector3};

use super::{Dynamics, MassFactor, SingularMassMatrix, Wrench};
use crate::{FrameId, Model};

impl Dynamics {
    /// Computes forward dynamics: `a_out = M(q)^-1 (tau - C(q, v) v - g(q))` \[rad/s2 or m/s2\].
    ///
    /// Uses the articulated body algorithm, in O(nv). Mimic joints form loops; for models with mimic joints,
    /// the function factorises the mass matrix, in O(nv^3).
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`] if a joint moves no inertia. In this case `a_out` is unspecified.
    pub fn forward(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        a_out: &mut [f64],
    ) -> Result<(), SingularMassMatrix> {
        self.forward_external(model, q, v, tau, gravity, &[], a_out)
    }

    /// Computes forward dynamics like [`forward`](Self::forward), but with external wrenches: `a_out = M^-1
    /// (tau - C v - g + sum J' f)`. Each wrench acts at the origin of its frame, in the axes of the frame.
    ///
    /// # Errors
    ///
    /// Same as [`forward`](Self::forward).
    pub fn forward_external(
        &mut self,
        model: &Model,
        q: &[f64],
        v: &[f64],
        tau: &[f64],
        gravity: Vector3<f64>,
        wrenches: &[(FrameId, Wrench)],
        a_out: &mut [f64],
    ) -> Result<(), SingularMassMatrix> {
        if !model.has_mimics() {
            return self.aba(model, q, v, tau, gravity, wrenches, a_out);
        }
        assert_eq!(tau.len(), model.nv(), "length of tau");
        self.zero_acceleration(model, |dynamics, zero| {
            dynamics.rnea_external(model, q, v, zero, gravity, wrenches, a_out);
        });
        for (a, tau) in a_out.iter_mut().zip(tau) {
            *a = tau - *a;
        }
        self.factor_mass(model, q)?;
        self.factor.solve(a_out);
        Ok(())
    }

    /// Computes both triangles of the inverse of the mass matrix (nv x nv).
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`] if a joint moves no inertia.
    pub fn inverse_mass(
        &mut self,
        model: &Model,
        q: &[f64],
        out: &mut DMatrix<f64>,
    ) -> Result<(), SingularMassMatrix> {
        self.factor_mass(model, q)?;
        self.factor.inverse(out);
        Ok(())
    }

    /// Factorises the mass matrix at `q`. The returned factor solves any number of systems; the next call
    /// with a `q` argument overwrites the factor.
    ///
    /// # Errors
    ///
    /// [`SingularMassMatrix`] if a joint moves no inertia.
    pub fn factor_mass(&mut self, model: &Model, q: &[f64]) -> Result<&MassFactor, SingularMassMatrix> {
        // Move the matrix out of `self` for the call; the empty replacement does not allocate.
        let mut mass = std::mem::replace(&mut self.mass, DMatrix::zeros(0, 0));
        self.crba_upper(model, q, &mut mass);
        let factored = self.factor.factor(&mass);
        self.mass = mass;
        factored.map(|()| &self.factor)
    }

    /// Runs `work` with a vector of nv zeros.
    fn zero_acceleration(&mut self, model: &Model, work: impl FnOnce(&mut Self, &[f64])) {
        let mut zero = std::mem::take(&mut self.zero);
        zero.resize(model.nv(), 0.0);
        work(self, &zero);
        self.zero = zero;
    }
}

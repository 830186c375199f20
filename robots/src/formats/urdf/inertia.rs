//! Reading and validation of the inertia of a link.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::error::{UrdfError, UrdfProblem};
use super::joints::pose;
use super::warning::ModelWarning;
use crate::Position;
use crate::{Body, Inertia};

/// Returns the inertia of a link in its own frame. Impossible values are kept and reported.
pub(crate) fn of_link(
    link: &urdf_rs::Link,
    at: Position,
    warnings: &mut Vec<ModelWarning>,
) -> Result<Inertia, UrdfError> {
    let name = || link.name.clone();
    let mass = link.inertial.mass.value;
    if mass < 0.0 {
        return Err(UrdfError::new(at, UrdfProblem::NegativeMass { link: name(), mass }));
    }
    let i = &link.inertial.inertia;
    let rotational = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let frame = Inertia { mass, com: Vector3::zeros(), rotational };
    check_inertia(&link.name, &frame, warnings);
    Ok(frame.moved(&pose(&link.inertial.origin)))
}

/// Reports a physically impossible inertia.
pub(crate) fn check_inertia(link: &str, inertia: &Inertia, warnings: &mut Vec<ModelWarning>) {
    let name = || link.to_owned();
    let rotational = inertia.rotational;
    if inertia.mass == 0.0 {
        if rotational != Matrix3::zeros() {
            warnings.push(ModelWarning::InertiaWithoutMass { link: name() });
        }
    } else {
        let principal @ [low, middle, high] = principal_moments(&rotational);
        if low <= 0.0 {
            warnings.push(ModelWarning::NotPositiveDefinite { link: name(), principal });
        } else if high > (low + middle) * (1.0 + 1e-9) {
            warnings.push(ModelWarning::TriangleInequality { link: name(), principal });
        }
    }
}

/// Returns the eigenvalues, ascending.
pub(crate) fn principal_moments(rotational: &Matrix3<f64>) -> [f64; 3] {
    let mut values: [f64; 3] = SymmetricEigen::new(*rotational).eigenvalues.into();
    values.sort_by(f64::total_cmp);
    values
}

/// Reports joints without inertia beyond them.
pub(crate) fn warn_of_massless_ends(bodies: &[Body], warnings: &mut Vec<ModelWarning>) {
    let mut heavy = vec![false; bodies.len()];
    for (index, body) in bodies.iter().enumerate().rev() {
        heavy[index] |= body.inertia.mass > 0.0 || body.inertia.rotational != Matrix3::zeros();
        if let (Some(parent), true) = (body.parent, heavy[index]) {
            heavy[parent] = true;
        }
    }
    for body in bodies.iter().zip(heavy).filter_map(|(body, heavy)| (!heavy).then_some(body)) {
        warnings.push(ModelWarning::NoInertia { link: body.name.clone(), joint: body.joint.name.clone() });
    }
}

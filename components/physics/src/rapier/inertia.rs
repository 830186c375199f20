//! Masses and inertias in a form that rapier accepts.

use motorium_robots::Model;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::dynamics::MassProperties;

use super::convert;
use crate::{BuildError, World};

/// Rapier's unit of mass is a milligram: masses, inertias and forces are multiplied by this factor on input.
///
/// Rapier diagonalises inertias with absolute thresholds, below which it accepts any axis as a principal
/// axis. In kilograms, the inertia of a gripper's finger (1e-6 kg m2) is below the threshold, and rapier
/// would apply it about the wrong axis.
pub(super) const MILLIGRAMS: f64 = 1e6;

/// Relative difference added between the principal moments. Rapier also picks arbitrary axes if two moments
/// are equal.
const SPREAD: f64 = 1e-7;

/// Returns mass \[kg\], centre of mass and inertia about it \[kg m2\] for rapier.
pub(super) fn mass_properties(mass: f64, com: &Vector3<f64>, rotational: &Matrix3<f64>) -> MassProperties {
    let eigen = rotational.symmetric_eigen();
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.set_column(2, &-axes.column(2));
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[i].total_cmp(&eigen.eigenvalues[j]));
    let mut moments = eigen.eigenvalues;
    moments[order[0]] *= 1.0 - SPREAD;
    moments[order[2]] *= 1.0 + SPREAD;
    let frame = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    MassProperties::with_principal_inertia_frame(
        convert::vector(com),
        mass * MILLIGRAMS,
        convert::vector(&(moments * MILLIGRAMS)),
        convert::pose(&Isometry3::from_parts(Translation3::identity(), frame)).rotation,
    )
}

/// Largest mass that rapier supports \[kg\], with a factor of two to spare. Rapier treats the inverse of a
/// larger mass, in milligrams, as zero: the body would fall through everything.
const MOST: f64 = 2.0e4;

/// Rejects robots and objects that would fall through everything in rapier.
pub(super) fn check_masses(model: &Model, world: &World) -> Result<(), BuildError> {
    let objects =
        world.objects.iter().filter_map(|object| Some((&*object.name, object.mass_properties()?.mass)));
    let mut bodies = objects.chain([(model.name(), model.mass())]);
    match bodies.find(|(_, mass)| *mass > MOST) {
        Some((owner, _)) => Err(BuildError::Unable {
            engine: "rapier",
            ability: "mass above 20 t",
            owner: owner.to_owned(),
            surface: None,
        }),
        None => Ok(()),
    }
}

//! Positions and the five ways to write an orientation.

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::attributes::Attributes;
use super::compiler::Compiler;
use super::error::{MjcfError, MjcfProblem};
use crate::lie::so3;

/// Pose of an element in what it stands in.
pub(super) fn pose<'a, 'i>(
    attributes: &Attributes<'a, 'i>,
    compiler: &Compiler,
    node: Node<'a, 'i>,
    class: &str,
) -> Result<Isometry3<f64>, MjcfError> {
    let position = attributes.numbers::<3>(node, class, "pos")?.unwrap_or_default();
    let rotation = rotation(attributes, compiler, node, class)?;
    Ok(Isometry3::from_parts(Translation3::from(position), rotation))
}

fn rotation<'a, 'i>(
    attributes: &Attributes<'a, 'i>,
    compiler: &Compiler,
    node: Node<'a, 'i>,
    class: &str,
) -> Result<UnitQuaternion<f64>, MjcfError> {
    let ways = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];
    let Some((way, value)) = attributes.one_of(node, class, ways) else {
        return Ok(UnitQuaternion::identity());
    };
    let count = match way {
        "quat" | "axisangle" => 4,
        "xyaxes" => 6,
        _ => 3,
    };
    let n = attributes.parse(node, way, value, count)?;
    let zero = || {
        let problem = format!("{way}=\"{value}\" has no direction");
        attributes.error(node, MjcfProblem::Other(problem))
    };
    let direction = |x: &[f64]| Unit::try_new(Vector3::new(x[0], x[1], x[2]), 1e-14).ok_or_else(zero);
    Ok(match way {
        "quat" => {
            let quaternion = Quaternion::new(n[0], n[1], n[2], n[3]);
            UnitQuaternion::try_new(quaternion, 1e-14).ok_or_else(zero)?
        }
        "axisangle" => UnitQuaternion::from_axis_angle(&direction(&n)?, n[3] * compiler.angle),
        "xyaxes" => {
            let x = direction(&n[..3])?;
            let y = Vector3::new(n[3], n[4], n[5]);
            let y = Unit::try_new(y - x.into_inner() * x.dot(&y), 1e-14).ok_or_else(zero)?;
            let columns = [x.into_inner(), y.into_inner(), x.cross(&y)];
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(
                &columns,
            )))
        }
        "zaxis" => along(&direction(&n)?),
        _ => {
            let mut turn = UnitQuaternion::identity();
            for (letter, angle) in compiler.sequence.into_iter().zip(n) {
                let axis = match letter.to_ascii_lowercase() {
                    'x' => Vector3::x_axis(),
                    'y' => Vector3::y_axis(),
                    _ => Vector3::z_axis(),
                };
                let step = UnitQuaternion::from_axis_angle(&axis, angle * compiler.angle);
                turn = if letter.is_ascii_lowercase() { turn * step } else { step * turn };
            }
            turn
        }
    })
}

/// The least rotation from z to `axis`; to -z, or within 1e-10 of it, the half turn about x that MuJoCo takes.
pub(super) fn along(axis: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    if axis.x.hypot(axis.y) < 1e-10 && axis.z < 0.0 {
        return UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    }
    so3::least_rotation(&Vector3::z_axis(), axis)
}

//! Positions, and the five representations of an orientation.

use nalgebra::{Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use super::attributes::{Element, named};
use super::compiler::{Compiler, RADIANS};
use super::error::{MjcfError, MjcfProblem};
use crate::ModelWarning;
use crate::math::lie::so3;

/// Returns the pose of an element in the surrounding frame.
///
/// # Errors
/// A value is malformed, or a direction has zero length.
pub fn pose(element: &Element<'_, '_, '_>, compiler: &Compiler) -> Result<Isometry3<f64>, MjcfError> {
    let position = element.numbers::<3>("pos")?.unwrap_or_default();
    Ok(Isometry3::from_parts(Translation3::from(position), rotation(element, compiler)?))
}

fn rotation(element: &Element<'_, '_, '_>, compiler: &Compiler) -> Result<UnitQuaternion<f64>, MjcfError> {
    let Some((way, value, node)) = element.orientation()? else {
        return Ok(UnitQuaternion::identity());
    };
    let count = match way {
        "quat" | "axisangle" => 4,
        "xyaxes" => 6,
        _ => 3,
    };
    let n = element.attributes.parse(node, way, value, count..=count)?;
    if compiler.angle == 1.0 {
        let angles = match way {
            "axisangle" => &n[3..],
            "euler" => &n[..],
            _ => &[],
        };
        let (what, at) = (format!("{way} of <{}>", named(node)), element.attributes.position(node));
        element.attributes.warn(ModelWarning::of_angles(&what, angles, RADIANS, Some(at)));
    }
    let zero = || {
        let problem = format!("{way}=\"{value}\" has no direction");
        element.attributes.error(node, MjcfProblem::Other(problem))
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

/// Returns midpoint, orientation and half length of a shape between two points; `None` without `fromto`.
///
/// The z axis points from the second point to the first, as in MuJoCo.
pub(crate) fn between(element: &Element<'_, '_, '_>) -> Result<Option<(Isometry3<f64>, f64)>, MjcfError> {
    let Some([ax, ay, az, bx, by, bz]) = element.numbers::<6>("fromto")? else { return Ok(None) };
    if element.numbers::<3>("pos")?.is_some_and(|position| position != [0.0; 3]) {
        return Err(element.refused("fromto", "pos specifies another position"));
    }
    let (from, to) = (Vector3::new(ax, ay, az), Vector3::new(bx, by, bz));
    let axis = Unit::try_new(from - to, 1e-14).ok_or_else(|| element.fault("fromto has two equal ends"))?;
    let placement = Isometry3::from_parts(((from + to) * 0.5).into(), along(&axis));
    Ok(Some((placement, 0.5 * (from - to).norm())))
}

/// Returns the smallest rotation from z to `axis`. As in MuJoCo it is the identity for axes within 1e-7 rad
/// of z, and the half turn about x for axes within 1e-7 rad of -z.
fn along(axis: &Unit<Vector3<f64>>) -> UnitQuaternion<f64> {
    match (axis.x.hypot(axis.y) <= 1e-7, axis.z > 0.0) {
        (true, true) => UnitQuaternion::identity(),
        (true, false) => UnitQuaternion::new_unchecked(Quaternion::new(0.0, 1.0, 0.0, 0.0)),
        (false, _) => so3::least_rotation(&Vector3::z_axis(), axis),
    }
}

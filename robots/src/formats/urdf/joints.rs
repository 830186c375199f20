//! Conversion of one URDF joint: limits, axis, passive dynamics.

use core::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use urdf_rs::JointType;

use super::doubts::RADIANS;
use super::error::{UrdfError, UrdfProblem};
use super::source::JointSource;
use super::warning::ModelWarning;
use crate::{JointDynamics, JointKind, Limits};

/// Returns the type of motion; `None` for a fixed joint.
pub(crate) fn kind(joint: &urdf_rs::Joint, source: &JointSource) -> Result<Option<JointKind>, UrdfError> {
    match joint.joint_type {
        JointType::Fixed => Ok(None),
        JointType::Revolute => Ok(Some(JointKind::Revolute)),
        JointType::Continuous => Ok(Some(JointKind::Continuous)),
        JointType::Prismatic => Ok(Some(JointKind::Prismatic)),
        JointType::Floating => unsupported(joint, source, "floating"),
        JointType::Planar => unsupported(joint, source, "planar"),
        JointType::Spherical => unsupported(joint, source, "spherical"),
    }
}

/// Returns the error for an unsupported joint.
pub(crate) fn unsupported(
    joint: &urdf_rs::Joint,
    source: &JointSource,
    kind: &str,
) -> Result<Option<JointKind>, UrdfError> {
    let problem = UrdfProblem::UnsupportedJointType { joint: joint.name.clone(), kind: kind.to_owned() };
    Err(UrdfError::new(source.at, problem))
}

/// Returns the optional velocity and effort limits of a planar joint.
pub(crate) fn planar_limits(joint: &urdf_rs::Joint, source: &JointSource) -> Limits {
    let Some(limit) = &source.limit else { return Limits::NONE };
    let effort = if limit.has_effort { joint.limit.effort } else { f64::INFINITY };
    Limits { velocity: joint.limit.velocity, effort, ..Limits::NONE }
}

/// Returns two directions that span the plane with this normal, right-handed: x and y for z.
pub(crate) fn plane(normal: &Unit<Vector3<f64>>) -> [Unit<Vector3<f64>>; 2] {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let start = if normal.dot(&z).abs() > 0.5 {
        x
    } else if normal.dot(&x).abs() > 0.5 {
        y
    } else {
        z
    };
    let first = Unit::new_normalize(start - normal.into_inner() * normal.dot(&start));
    let second = Unit::new_normalize(normal.cross(&first));
    [first, second]
}

/// Returns the limits, infinite if missing from the file.
pub(crate) fn limits(
    joint: &urdf_rs::Joint,
    kind: JointKind,
    source: &JointSource,
    warnings: &mut Vec<ModelWarning>,
) -> Result<Limits, UrdfError> {
    let Some(limit) = &source.limit else {
        return match kind {
            JointKind::Continuous => Ok(Limits::NONE),
            _ => Err(UrdfError::new(source.at, UrdfProblem::MissingLimit(joint.name.clone()))),
        };
    };
    let name = || joint.name.clone();
    let mut limits = Limits { velocity: joint.limit.velocity, effort: joint.limit.effort, ..Limits::NONE };
    if !limit.has_effort {
        limits.effort = f64::INFINITY;
        warnings.push(ModelWarning::NoEffortLimit { joint: name() });
    }
    for (what, value) in [("velocity", limits.velocity), ("effort", limits.effort)] {
        if value < 0.0 {
            let problem = UrdfProblem::NegativeJointValue { joint: name(), what, value };
            return Err(UrdfError::new(limit.at, problem));
        }
        if value == 0.0 {
            warnings.push(ModelWarning::ZeroLimit { joint: name(), what });
        }
    }
    let (lower, upper) = (joint.limit.lower, joint.limit.upper);
    // Ranges of a whole turn are common and have no meaning.
    if kind == JointKind::Continuous && lower < upper && upper - lower < 0.98 * TAU {
        warnings.push(ModelWarning::ContinuousRange { joint: name(), lower, upper });
    }
    if kind != JointKind::Continuous {
        if lower > upper {
            let problem = UrdfProblem::LowerAboveUpper { joint: name(), lower, upper };
            return Err(UrdfError::new(limit.at, problem));
        }
        if lower == upper {
            warnings.push(ModelWarning::EmptyRange { joint: name(), value: lower });
        }
        if kind == JointKind::Revolute && has_many_turns([lower, upper]) {
            warnings.push(ModelWarning::ManyTurns { joint: name(), format: RADIANS, lower, upper });
        }
        (limits.lower, limits.upper) = (lower, upper);
    }
    Ok(limits)
}

/// Returns `true` for a range of a revolute joint \[rad\] that was probably written in degrees.
pub(crate) fn has_many_turns([lower, upper]: [f64; 2]) -> bool {
    // Limits of less than two turns may be in rad, as for inverse kinematics; from two turns in degrees on,
    // no limit may be intended.
    upper - lower > 3.0 * TAU && (2.0 * TAU..=720.0).contains(&lower.abs().max(upper.abs()))
}

/// Returns damping and friction, zero if missing from the file.
pub(crate) fn dynamics(joint: &urdf_rs::Joint, source: &JointSource) -> Result<JointDynamics, UrdfError> {
    let Some(dynamics) = &joint.dynamics else { return Ok(JointDynamics::default()) };
    let values =
        JointDynamics { damping: dynamics.damping, friction: dynamics.friction, ..JointDynamics::default() };
    for (what, value) in [("damping", values.damping), ("friction", values.friction)] {
        if value < 0.0 {
            let problem = UrdfProblem::NegativeJointValue { joint: joint.name.clone(), what, value };
            return Err(UrdfError::new(source.at, problem));
        }
    }
    Ok(values)
}

/// Returns the normalised axis.
pub(crate) fn axis(
    joint: &urdf_rs::Joint,
    source: &JointSource,
    warnings: &mut Vec<ModelWarning>,
) -> Result<Unit<Vector3<f64>>, UrdfError> {
    let axis = Vector3::from(joint.axis.xyz.0);
    let length = axis.norm();
    if length == 0.0 {
        return Err(UrdfError::new(source.at, UrdfProblem::ZeroAxis(joint.name.clone())));
    }
    // Rounded directions such as (0.707 0.707 0) are common and harmless.
    if (length - 1.0).abs() > 1e-3 {
        warnings.push(ModelWarning::AxisLength { joint: joint.name.clone(), length });
    }
    Ok(Unit::new_unchecked(axis / length))
}

/// Converts a URDF pose: fixed-axis roll, pitch, yaw.
pub(crate) fn pose(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz.0)), rotation)
}

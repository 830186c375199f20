//! Limits for the adapter's command gate: the robot's limits, reduced to the ranges of its drives.

use motorium::declare::ConfigError;
use motorium::safety::JointLimits;
use motorium_robots::{JointKind, ProfileError};

use super::Equipped;
use crate::HomingBy;

/// Returns the limits and safe-state gains of every joint, in the order of the robot's joints.
pub(super) fn of_joints(equipped: &Equipped) -> Result<Vec<JointLimits>, ConfigError> {
    let Equipped { robot, table, order } = equipped;
    let (model, profile) = (&robot.model, robot.profile.as_ref());
    let refused = |error: ProfileError| ConfigError::new(error.to_string());
    let acceleration =
        profile.map(|profile| profile.acceleration_limit(model)).transpose().map_err(refused)?;
    let effort_rate = profile.map(|profile| profile.effort_rate_limit(model)).transpose().map_err(refused)?;
    let gains = profile.and_then(|profile| profile.gains(model).ok());
    let joint = |(i, name): (usize, &String)| {
        let (ranges, ratio) = (table.ranges(order[i]), table.transmission(order[i]).ratio.abs());
        let effort = model.effort_limit()[i].abs().min(ranges.torque.max * ratio);
        let (most_kp, most_kd) = (ranges.kp.max * ratio * ratio, ranges.kd.max * ratio * ratio);
        let (kp, kd) = match &gains {
            Some(gains) => (gains.kp[i], gains.kd[i]),
            // full effort at a twentieth of a radian or metre
            None => (20.0 * effort, 2.0 * effort),
        };
        let limits = JointLimits {
            lower: model.lower()[i],
            upper: model.upper()[i],
            velocity: model.velocity_limit()[i].min(ranges.velocity.max / ratio),
            acceleration: acceleration.as_ref().map_or(f64::INFINITY, |limits| limits[i]),
            effort_rate: effort_rate.as_ref().map_or(f64::INFINITY, |limits| limits[i]),
            kp: kp.min(most_kp),
            kd: kd.min(most_kd),
            ..JointLimits::new(name)
        }
        .with_effort(effort);
        JointLimits { max_kp: limits.max_kp.min(most_kp), max_kd: limits.max_kd.min(most_kd), ..limits }
    };
    Ok(model.joint_names().iter().enumerate().map(joint).collect())
}

/// Returns the lowest and highest position of each joint, and the margin beyond them within which its drive
/// is still enabled: `margin`, or by default 0.05 rad and 5 mm.
pub(super) fn of_enabling(equipped: &Equipped, margin: Option<f64>) -> Vec<([f64; 2], f64)> {
    let model = &equipped.robot.model;
    let joint = |i: usize| {
        let usual = if model.joint(i).kind == JointKind::Prismatic { 0.005 } else { 0.05 };
        ([model.lower()[i], model.upper()[i]], margin.unwrap_or(usual))
    };
    (0..model.joint_count()).map(joint).collect()
}

/// Describes a joint whose drive covers less than the joint's range: name, covered range and required range.
pub(super) fn too_small(equipped: &Equipped) -> Option<String> {
    let Equipped { robot, table, order } = equipped;
    let model = &robot.model;
    model.joint_names().iter().enumerate().find_map(|(i, name)| {
        let (range, gear) = (table.ranges(order[i]).position, table.transmission(order[i]));
        let ends = [range.min, range.max].map(|drive| gear.to_joint(drive));
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let (lower, upper) = (model.lower()[i], model.upper()[i]);
        if table.drives[order[i]].homing.as_ref().is_some_and(|homing| homing.by == HomingBy::Stop) {
            // its zero is the power-up position, anywhere in the joint's range
            let (span, reaches) = (upper - lower, range.max / gear.ratio.abs());
            return (span.is_finite() && reaches < span).then(|| {
                format!("the positions of drive `{name}` reach {reaches:.3} from its zero, but the joint moves by {span:.3}")
            });
        }
        let covers = low <= lower && high >= upper;
        // a joint without limits exceeds any range
        (lower.is_finite() && upper.is_finite() && !covers).then(|| {
            format!("the positions of drive `{name}` cover {low:.3} to {high:.3}, but the joint has {lower:.3} to {upper:.3}")
        })
    })
}

/// Describes a joint whose homing exceeds its limits.
pub(super) fn unfit_homing(equipped: &Equipped, limits: &[JointLimits]) -> Option<(String, String)> {
    let Equipped { table, order, .. } = equipped;
    order.iter().zip(limits).find_map(|(drive, limits)| {
        let homing = table.drives[*drive].homing.as_ref()?;
        let beyond = |value: Option<f64>, limit: f64| value.is_some_and(|value| value.abs() > limit);
        let message =
            if beyond(homing.velocity, limits.velocity) || beyond(homing.creep_velocity, limits.velocity) {
                format!("a velocity beyond the joint's limit, {:.3}", limits.velocity)
            } else if beyond(homing.effort, limits.effort) {
                format!("an effort beyond the joint's limit, {:.3}", limits.effort)
            } else {
                let end = homing.end().filter(|end| !(limits.lower..=limits.upper).contains(end))?;
                format!(
                    "it ends at {end:.4}, outside the joint's range of {:.4} to {:.4}: increase `back_off`",
                    limits.lower, limits.upper
                )
            };
        Some((limits.name.to_string(), message))
    })
}

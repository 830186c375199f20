//! Facts about a robot, as rows and as JSON.

use motorium_robots::{Coordinate, Joint, JointKind, Limits, Loaded, Model};
use serde_json::{Value, json};

/// Returns the name of a joint type.
pub(super) fn kind(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Revolute => "revolute",
        JointKind::Continuous => "continuous",
        JointKind::Prismatic => "prismatic",
    }
}

/// Returns `fixed` or `floating`.
pub(super) fn base(model: &Model) -> &'static str {
    if model.base().floating { "floating" } else { "fixed" }
}

/// Returns the moving mass and, if links are fixed to the world, the total mass.
pub(super) fn mass(model: &Model) -> String {
    let (moving, total) = (model.mass(), model.total_mass());
    match (total - moving).abs() <= 1e-9 * total.abs() {
        true => format!("{} kg", short(moving)),
        false => format!("{} kg moving, {} kg in total", short(moving), short(total)),
    }
}

/// Returns the effective limits of a joint. The limits of a mimicked joint are narrowed by its followers.
pub(super) fn limits(model: &Model, joint: &Joint) -> Limits {
    let Coordinate::Independent(index) = joint.coordinate else { return joint.limits };
    Limits {
        lower: model.lower()[index],
        upper: model.upper()[index],
        velocity: model.velocity_limit()[index],
        effort: model.effort_limit()[index],
    }
}

/// Returns a limit, or `null`.
fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// Returns the size of a robot.
pub(super) fn size(model: &Model) -> Value {
    json!({
        "base": base(model),
        "nq": model.nq(),
        "nv": model.nv(),
        "joints": model.joint_count(),
        "bodies": model.bodies().len(),
        "frames": model.frames().len(),
        "mass": model.mass(),
        "total_mass": model.total_mass(),
    })
}

/// Returns all joints that move, mimic ones too.
pub(super) fn joints(model: &Model) -> Vec<Value> {
    let joint = |body: &motorium_robots::Body| {
        let joint = &body.joint;
        let limits = limits(model, joint);
        let mimic = match joint.coordinate {
            Coordinate::Independent(_) => Value::Null,
            Coordinate::Mimic { of, multiplier, offset } => {
                json!({ "joint": model.joint_names()[of], "multiplier": multiplier, "offset": offset })
            }
        };
        json!({
            "name": joint.name,
            "type": kind(joint.kind),
            "axis": joint.axis.as_slice(),
            "parent": body.parent.map(|parent| &model.bodies()[parent].name),
            "link": body.name,
            "lower": finite(limits.lower),
            "upper": finite(limits.upper),
            "velocity": finite(limits.velocity),
            "effort": finite(limits.effort),
            "damping": joint.dynamics.damping,
            "friction": joint.dynamics.friction,
            "mimic": mimic,
        })
    };
    model.bodies().iter().map(joint).collect()
}

/// Returns all facts.
pub(super) fn all(robot: &Loaded) -> Value {
    let model = &robot.model;
    let frame = |frame: &motorium_robots::Frame| {
        let place = frame.placement;
        let (roll, pitch, yaw) = place.rotation.euler_angles();
        json!({
            "name": frame.name,
            "link": frame.body.map(|body| &model.bodies()[body].name),
            "position": place.translation.vector.as_slice(),
            "rpy": [roll, pitch, yaw],
        })
    };
    let mut all = json!({
        "name": model.name(),
        "file": robot.path.as_ref().map(|path| path.display().to_string()),
        "size": size(model),
        "joints": joints(model),
        "frames": model.frames().iter().map(frame).collect::<Vec<_>>(),
        "warnings": robot.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    if !robot.postures.is_empty() {
        let posture = |posture: &motorium_robots::Posture| {
            let base = posture.base.map(|base| {
                let (roll, pitch, yaw) = base.rotation.euler_angles();
                json!({ "position": base.translation.vector.as_slice(), "rpy": [roll, pitch, yaw] })
            });
            json!({ "name": posture.name, "base": base, "joints": posture.joints.as_slice() })
        };
        all["postures"] = robot.postures.iter().map(posture).collect();
    }
    if let Some(profile) = &robot.profile {
        all["profile"] = json!({
            "title": profile.title,
            "sources": profile.sources,
            "home": profile.home,
            "joints": profile.joints,
            "passive": profile.passive,
            "poses": profile.poses,
            "base_poses": profile.base_poses.iter().map(|(name, pose)| {
                (name.clone(), json!({ "position": pose.position, "rpy": pose.rpy }))
            }).collect::<serde_json::Map<_, _>>(),
            "end_effectors": profile.end_effectors.iter().map(|(name, end)| {
                (name.clone(), json!({ "frame": end.frame, "joints": end.joints, "fingers": end.fingers }))
            }).collect::<serde_json::Map<_, _>>(),
            "feet": profile.feet.iter().map(|(name, foot)| {
                let foot = json!({
                    "frame": foot.frame, "joints": foot.joints, "radius": foot.radius, "sole": foot.sole,
                });
                (name.clone(), foot)
            }).collect::<serde_json::Map<_, _>>(),
            "mobile_base": profile.mobile_base.as_ref().map(|base| json!({
                "drive": base.drive.name(), "frame": base.frame, "joints": base.joints, "wheels": base.wheels,
                "steering": base.steering, "wheel_radius": base.wheel_radius, "track": base.track,
                "wheelbase": base.wheelbase,
            })),
            "rotors": profile.rotors.iter().map(|(name, rotor)| {
                let rotor = json!({
                    "frame": rotor.frame, "spin": format!("{:?}", rotor.spin).to_lowercase(),
                    "max_thrust": rotor.max_thrust, "torque_per_thrust": rotor.torque_per_thrust,
                });
                (name.clone(), rotor)
            }).collect::<serde_json::Map<_, _>>(),
        });
        if let Ok(gains) = profile.gains(model) {
            all["profile"]["gains"] = json!({ "kp": gains.kp.as_slice(), "kd": gains.kd.as_slice() });
        }
    }
    all
}

/// Formats a number with few digits and without trailing zeros.
pub(super) fn short(value: f64) -> String {
    if !value.is_finite() {
        return "-".to_string();
    }
    let text =
        if value != 0.0 && value.abs() < 1e-3 { format!("{value:.2e}") } else { format!("{value:.4}") };
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::short;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.0, -2.5, 1.234567, 1e-5, 100.0, f64::INFINITY].map(short);
        assert_eq!(texts, ["0", "1", "-2.5", "1.2346", "1.00e-5", "100", "-"]);
    }
}

//! Comparison of a robot with the robot for which a policy was trained.

use motorium_models::policy::{Action, Policy, RobotDifference, RobotDigest};
use motorium_robots::Loaded;

/// Returns the digest of a robot for a policy that commands these joints; `None` if the robot lacks one of
/// these joints.
///
/// ```
/// use motorium_learners::task::robot_digest;
///
/// let panda = motorium_robots::load("panda", std::path::Path::new("."))?;
/// let digest = robot_digest(&panda, &["panda_joint1"]);
/// assert!(digest.is_some() && digest == robot_digest(&panda, &["panda_joint1"]));
/// assert_eq!(robot_digest(&panda, &["elbow"]), None);
/// # Ok::<(), motorium_robots::LoadError>(())
/// ```
pub fn robot_digest(robot: &Loaded, joints: &[impl AsRef<str>]) -> Option<RobotDigest> {
    let joints = robot.model.joint_digest(joints)?;
    Some(RobotDigest { joints, dynamics: robot.dynamics_digest() })
}

/// Returns the joints of a robot that an action moves: the joints of the action or, for a base twist, the
/// joints of the robot's mobile base.
pub fn digest_joints<'a>(action: &'a Action, robot: &'a Loaded) -> Vec<&'a str> {
    let base = robot.profile.as_ref().and_then(|profile| profile.mobile_base.as_ref());
    let base = base.filter(|_| action.twist.is_some());
    let of_base = base.into_iter().flat_map(|base| [&base.joints, &base.wheels, &base.steering]).flatten();
    action.joints.iter().chain(of_base).map(String::as_str).collect()
}

/// Returns the difference between the robot for which a policy was trained and another robot. Returns `None`
/// if the robots are equal, or the policy has no digest. A missing joint counts as a difference of joints.
pub fn robot_difference(policy: &Policy, robot: &Loaded) -> Option<RobotDifference> {
    let trained = policy.robot_digest?;
    match robot_digest(robot, &digest_joints(&policy.action, robot)) {
        Some(digest) => trained.difference(&digest),
        None => Some(RobotDifference::Joints),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorium_robots::load;
    use std::path::Path;

    /// Creates a robot with two joints and a profile in a folder.
    fn robot(folder: &Path, change: (&str, &str)) -> Loaded {
        let link = |name: &str, mass: f64| {
            format!(
                r#"<link name="{name}"><inertial><mass value="{mass}"/>
                <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>"#
            )
        };
        let joint = |name: &str, parent: &str, child: &str, upper: f64| {
            format!(
                r#"<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
                <axis xyz="0 0 1"/><limit lower="-1" upper="{upper}" velocity="2" effort="9"/></joint>"#
            )
        };
        let parts = [
            link("base", 1.0),
            link("upper", 2.0),
            link("lower", 3.0),
            joint("hip", "base", "upper", 1.5),
            joint("knee", "upper", "lower", 2.5),
        ];
        let urdf = format!("<robot name=\"leg\">{}</robot>", parts.concat());
        let profile = r#"
title = "Leg"
sources = ["made for this test"]
joints = ["hip", "knee"]
home = "zero"
poses = { zero = 0.0 }
gains = { kp = 20.0, kd = 0.5 }
"#;
        let (from, to) = change;
        assert!(from.is_empty() || urdf.contains(from) || profile.contains(from), "{from}");
        std::fs::write(folder.join("leg.urdf"), urdf.replace(from, to)).expect("a file");
        std::fs::write(folder.join("leg.toml"), profile.replace(from, to)).expect("a file");
        load("leg.urdf", folder).expect("a robot")
    }

    #[test]
    fn changes_of_a_robot_are_classified() {
        let folder = tempfile::tempdir().expect("a folder");
        let digest = |change| robot_digest(&robot(folder.path(), change), &["knee", "hip"]).expect("joints");
        let trained = digest(("", ""));
        let difference = |change| trained.difference(&digest(change));
        assert_eq!(difference(("zero = 0.0", "zero = 0.25")), None, "poses are part of a policy");
        for change in [
            ("kp = 20.0", "kp = 21.0"),
            ("mass value=\"3\"", "mass value=\"3.001\""),
            ("izz=\"0.1\"", "izz=\"0.101\""),
        ] {
            assert_eq!(difference(change), Some(RobotDifference::Dynamics), "{change:?}");
        }
        for change in [
            ("upper=\"2.5\"", "upper=\"2.4\""),
            ("velocity=\"2\"", "velocity=\"1.9\""),
            ("effort=\"9\"", "effort=\"10\""),
            ("xyz=\"0 0 1\"", "xyz=\"0 0 -1\""),
            ("type=\"revolute\"", "type=\"prismatic\""),
            ("gains = ", "limits = { velocity = 1.0 }\ngains = "),
        ] {
            assert_eq!(difference(change), Some(RobotDifference::Joints), "{change:?}");
        }
    }
}

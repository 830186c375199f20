//! Goal described by the options of `motorium goto`.

use anyhow::Context as _;
use motorium::state::{MAX_JOINTS, MotionGoal};
use motorium::units::TimeSpan;
use motorium_policies::{Fingers, Gripper};
use motorium_robots::{BasePose, Loaded};

use crate::robots;

/// Name of the pose that `start` of a graph, or `home` of a profile, selects.
const HOME: &str = "home";

/// Goals of the parts of the robot, and the duration.
#[derive(Debug, Clone, clap::Args)]
#[command(group(
    clap::ArgGroup::new("what").required(true).multiple(true)
        .args(["position", "orientation", "rpy", "joints", "pose", "gripper"])
))]
pub(super) struct GoalArgs {
    /// Position of the end effector in the world, m
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    position: Option<[f64; 3]>,
    /// Orientation of the end effector in the world as a quaternion [default: the previous goal's]
    #[arg(long, value_name = "X,Y,Z,W", value_parser = numbers::<4>, allow_hyphen_values = true)]
    orientation: Option<[f64; 4]>,
    /// Orientation as roll, pitch and yaw about the fixed axes x, y, z, rad
    #[arg(
        long, value_name = "R,P,Y", value_parser = numbers::<3>,
        allow_hyphen_values = true, conflicts_with = "orientation"
    )]
    rpy: Option<[f64; 3]>,
    /// One position for every joint in order, or JOINT=POSITION for some, rad or m
    #[arg(long, value_name = "POSITIONS", allow_hyphen_values = true)]
    joints: Option<String>,
    /// A pose of the robot's profile, such as `home`
    #[arg(long, value_name = "NAME", conflicts_with_all = ["position", "orientation", "rpy", "joints"])]
    pose: Option<String>,
    /// `open`, `close`, or a position of the fingers' joints, rad or m
    #[arg(long, value_name = "GOAL", allow_hyphen_values = true)]
    gripper: Option<Gripper>,
    /// Duration of the motion; longer if the limits require it [default: the shortest possible]
    #[arg(long, value_name = "TIME")]
    duration: Option<TimeSpan>,
}

/// Parses comma-separated numbers.
fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Result<Vec<f64>, _> = text.split(',').map(|number| number.trim().parse::<f64>()).collect();
    let numbers = numbers.ok().filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(|| format!("expected {N} finite numbers, separated by commas"))
}

impl GoalArgs {
    /// Returns the goal for a robot whose policy places `frame`.
    pub(super) fn goal(
        &self,
        robot: &Loaded,
        frame: Option<&str>,
        number: u64,
    ) -> anyhow::Result<MotionGoal> {
        let mut goal = MotionGoal::new(number);
        if let Some(position) = self.position {
            goal.set_position(position);
        }
        if let Some(orientation) = self.orientation {
            anyhow::ensure!(orientation != [0.0; 4], "`--orientation` has the length 0, expected 1");
            goal.orientation = orientation;
        }
        if let Some(rpy) = self.rpy {
            let pose = BasePose { position: [0.0; 3], rpy }.isometry();
            goal.orientation = pose.rotation.coords.into();
        }
        if let Some(duration) = self.duration {
            goal.duration = duration.as_secs_f64();
        }
        for (joint, position) in self.positions(robot, frame)? {
            let joints = robot.model.joint_count();
            anyhow::ensure!(
                joint < MAX_JOINTS,
                "the robot has {joints} joints, but a goal supports at most {MAX_JOINTS}"
            );
            goal.set_joint(joint, position);
        }
        Ok(goal)
    }

    /// Returns the positions of joints by index; if a joint occurs twice, the last value is used.
    fn positions(&self, robot: &Loaded, frame: Option<&str>) -> anyhow::Result<Vec<(usize, f64)>> {
        let mut positions = Vec::new();
        if let Some(name) = &self.pose {
            let home = robot.profile.as_ref().map(|profile| profile.home.as_str());
            let name = home.filter(|_| name == HOME).unwrap_or(name);
            positions.extend(robots::pose(robot, name)?.into_iter().enumerate());
        }
        if let Some(text) = &self.joints {
            positions.extend(joints(robot, text)?);
        }
        if let Some(gripper) = self.gripper {
            positions.extend(Fingers::of_robot(robot, frame)?.positions(gripper)?);
        }
        Ok(positions)
    }
}

/// Returns the positions of all joints in order, or of named ones.
fn joints(robot: &Loaded, text: &str) -> anyhow::Result<Vec<(usize, f64)>> {
    let model = &robot.model;
    let number = |text: &str| -> anyhow::Result<f64> {
        let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        number.with_context(|| format!("`--joints`: `{}` is not a finite number", text.trim()))
    };
    let parts = text.split(',');
    if !text.contains('=') {
        let all = parts.map(number).collect::<anyhow::Result<Vec<f64>>>()?;
        let (found, expected) = (all.len(), model.joint_count());
        anyhow::ensure!(
            found == expected,
            "`--joints` has {found} positions, expected {expected}: {}",
            model.joint_names().join(", ")
        );
        return Ok(all.into_iter().enumerate().collect());
    }
    let named = parts.map(|part| {
        let (name, position) =
            part.split_once('=').with_context(|| format!("`--joints`: `{part}` is not JOINT=POSITION"))?;
        let index = model.joint_index(name.trim()).with_context(|| {
            let known = model.joint_names().join(", ");
            format!("robot `{}` has no joint `{}`; it has {known}", model.name(), name.trim())
        })?;
        Ok((index, number(position)?))
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use clap::Parser as _;

    use super::*;

    #[derive(Debug, clap::Parser)]
    struct Line {
        #[command(flatten)]
        goal: GoalArgs,
    }

    fn goal(options: &[&str]) -> anyhow::Result<MotionGoal> {
        let line = Line::try_parse_from(std::iter::once(&"goto").chain(options))?;
        let panda = motorium_robots::load("panda", std::path::Path::new("."))?;
        line.goal.goal(&panda, None, 5)
    }

    #[test]
    fn options_make_a_goal() {
        let pose =
            goal(&["--position", "-0.4,0.1,0.5", "--rpy", "3.141592653589793,0,0", "--gripper", "open"]);
        let pose = pose.unwrap();
        assert_eq!((pose.number, pose.has_position, pose.position), (5, 1, [-0.4, 0.1, 0.5]));
        assert!((pose.orientation[0].abs() - 1.0).abs() < 1e-12);
        assert_eq!((pose.joints, pose.joint_at(7)), (1 << 7, Some(0.04)));
        let home = goal(&["--pose", "home", "--gripper", "0.01", "--duration", "2 s"]).unwrap();
        assert_eq!(
            (home.count(), home.joint_at(5), home.joint_at(7)),
            (8, Some(std::f64::consts::FRAC_PI_2), Some(0.01))
        );
        assert_eq!(home.duration, 2.0);
        let some = goal(&["--joints", "panda_joint1=-0.5,panda_joint7=1"]).unwrap();
        assert_eq!((some.joint_at(0), some.joint_at(1), some.joint_at(6)), (Some(-0.5), None, Some(1.0)));
    }

    #[test]
    fn invalid_options_are_refused_with_the_reason() {
        for (options, expected) in [
            (&["--position", "1,2"][..], "expected 3 finite numbers"),
            (&["--joints", "1,2"], "2 positions, expected 8: panda_joint1"),
            (&["--joints", "elbow=1"], "no joint `elbow`; it has panda_joint1"),
            (&["--pose", "folded"], "no pose `folded`; it has closed, ready"),
            (&["--gripper", "shut"], "expected `open`, `close`"),
            (&["--gripper", "0.5"], "outside of its range"),
            (&[], "required"),
        ] {
            let error = goal(options).unwrap_err().to_string();
            assert!(error.contains(expected), "{options:?}: {error}");
        }
    }
}

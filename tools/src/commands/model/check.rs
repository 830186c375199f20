//! `motorium model check`: checks a trained policy against a robot.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, bail};
use motorium_learners::task::{Points, digest_joints, robot_difference, robot_digest};
use motorium_models::policy::{PolicyFolder, RobotDifference, RobotDigest};
use motorium_robots::{LoadOptions, load_with};
use serde::Serialize;

use crate::out::{errln, outln};
use crate::style;

/// Smallest reported difference between poses [rad or m].
const POSE_TOLERANCE: f64 = 1e-3;

/// Check the folder of a policy against a robot: network widths, the source of each observation term, the
/// joint of each action, and the digest of the policy's robot.
///
/// Example: motorium model check policy/ --robot quadruped
#[derive(Debug, clap::Args)]
pub(super) struct Check {
    /// The folder with policy.toml, or that file
    #[arg(value_name = "POLICY")]
    policy: PathBuf,
    /// The robot [default: the policy's]
    #[arg(long, value_name = "ROBOT", add = crate::complete::robots())]
    robot: Option<String>,
    /// Require the default pose of the policy to equal this pose of the robot, within 1e-3 rad or m
    #[arg(long, value_name = "NAME")]
    pose: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report {
    robot: String,
    rate_hz: f64,
    /// `false` if masses, drives or gains differ from the policy's robot; null without a digest.
    equals_trained: Option<bool>,
    /// Digest of the robot, as in `policy.toml`.
    robot_digest: Option<RobotDigest>,
    inputs: usize,
    terms: Vec<Term>,
    joints: Vec<Joint>,
    /// Outputs after the joints', which command a pattern generator.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pattern: Vec<RangeOutput>,
    /// Outputs that command the velocity of the base, m/s and rad/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    twist: Vec<RangeOutput>,
}

/// An output that commands a quantity within a range.
#[derive(Debug, Serialize)]
struct RangeOutput {
    name: &'static str,
    policy_index: usize,
    range: [f64; 2],
}

#[derive(Debug, Serialize)]
struct Term {
    term: String,
    /// Message that contains the quantity; null if the policy computes the quantity.
    message: Option<&'static str>,
    first: usize,
    width: usize,
    history: usize,
}

#[derive(Debug, Serialize)]
struct Joint {
    name: String,
    policy_index: usize,
    robot_index: usize,
    scale: f64,
    default: f64,
}

impl Check {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let folder = PolicyFolder::read(&self.policy)?;
        folder.network()?;
        let place = folder.file().display().to_string();
        let policy = folder.policy;
        let Some(name) = self.robot.clone().or_else(|| policy.robot.clone()) else {
            bail!("{place}: no `robot`, expected the robot of the policy; help: name it with `--robot`");
        };
        let robot = load_with(&name, Path::new(""), &LoadOptions::default())?;
        let names = robot.model.joint_names();
        let targets = policy.joint_targets(names).with_context(|| place.clone())?;
        let points = Points::new(&policy, &robot.model).with_context(|| place.clone())?;
        if let Some(object) = points.objects().first() {
            bail!(
                "{place}: point \"{object}\" is not a link of the robot, and no topic has the motion of objects; help: name links or \"target\" in `points`"
            );
        }
        if let Some(pose) = &self.pose {
            let pose = crate::robots::pose(&robot, pose)?;
            for (target, default) in targets.targets().iter().zip(&policy.action.default_pose) {
                let (joint, expected) = (&names[target.joint], pose[target.joint]);
                if (expected - default).abs() > POSE_TOLERANCE {
                    bail!(
                        "{place}: `action.default_pose` of \"{joint}\" is {default}, expected {expected} as in the robot's pose"
                    );
                }
            }
        }
        let difference = robot_difference(&policy, &robot);
        if difference == Some(RobotDifference::Joints) {
            bail!(
                "{place}: joint axes or limits of {name} differ from the policy's robot (`robot_digest.joints`); \
                 help: train again, or remove `robot_digest` if the policy suits both robots"
            );
        }
        if difference.is_some() {
            errln!(
                "{} {place}: masses, drives or gains of {name} differ from the policy's robot \
                 (`robot_digest.dynamics`)",
                style::warning("warning:")
            );
        }
        let equals_trained = policy.robot_digest.map(|_| difference.is_none());
        let mut first = 0;
        let mut terms = Vec::new();
        for observation in &policy.observations {
            let (width, history) = (policy.width(observation), observation.history);
            let term = observation.term.name().to_owned();
            terms.push(Term { term, message: observation.term.message(), first, width, history });
            first += width * history;
        }
        let joint = |(policy_index, target): (usize, &motorium_models::policy::JointTarget)| Joint {
            name: names[target.joint].clone(),
            policy_index,
            robot_index: target.joint,
            scale: target.scale,
            default: policy.action.default_pose[policy_index],
        };
        let joints = targets.targets().iter().enumerate().map(joint).collect();
        let ranges = policy
            .pattern
            .iter()
            .flat_map(|pattern| [("frequency", pattern.frequency), ("amplitude", pattern.amplitude)]);
        let pattern = ranges.enumerate().map(|(index, (name, range))| {
            let policy_index = policy.action.joints.len() + index;
            RangeOutput { name, policy_index, range }
        });
        let pattern = pattern.collect();
        let ranges = policy.action.twist.map(|twist| twist.axes()).unwrap_or_default();
        let ranges = ["forward", "left", "turn"].into_iter().zip(ranges);
        let twist = ranges.filter_map(|(name, range)| Some((name, range?))).enumerate();
        let twist = twist.map(|(policy_index, (name, range))| RangeOutput { name, policy_index, range });
        let twist = twist.collect();
        let rate_hz = policy.rate;
        let robot_digest = robot_digest(&robot, &digest_joints(&policy.action, &robot));
        let report = Report {
            robot: name,
            rate_hz,
            equals_trained,
            robot_digest,
            inputs: first,
            terms,
            joints,
            pattern,
            twist,
        };
        if self.json {
            outln!("{}", serde_json::to_string(&report)?);
        } else {
            print(&report);
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn print(report: &Report) {
    outln!("{} inputs at {} Hz, robot {}", report.inputs, report.rate_hz, report.robot);
    for Term { term, message, first, width, history } in &report.terms {
        let message = message.unwrap_or("computed by the policy");
        outln!("  input {first}: {term}, {width} numbers x {history} steps ({message})");
    }
    for Joint { name, policy_index, robot_index, scale, default } in &report.joints {
        outln!("  action {policy_index} -> joint {robot_index} {name}: {default} + {scale} x action");
    }
    for RangeOutput { name, policy_index, range: [low, high] } in &report.pattern {
        outln!("  action {policy_index} -> {name} of the pattern: {low} to {high}");
    }
    for RangeOutput { name, policy_index, range: [low, high] } in &report.twist {
        outln!("  action {policy_index} -> {name} of the base: {low} to {high}");
    }
}

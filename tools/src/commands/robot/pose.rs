//! Pose in which a robot is drawn.

use anyhow::Context as _;
use motorium_robots::{BasePose, Loaded, Model};

/// A pose, with separate options for joints and base.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct PoseArgs {
    /// A pose of the profile [default: its home, or zero without a profile]
    #[arg(long)]
    pose: Option<String>,
    /// One position for every joint in order, or JOINT=POSITION for some; separated by commas
    #[arg(long, value_name = "POSITIONS", allow_hyphen_values = true)]
    q: Option<String>,
    /// Pose of a floating base: x,y,z or x,y,z,roll,pitch,yaw
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    base: Option<String>,
}

impl PoseArgs {
    /// Returns the selected configuration, in the order of the model's `q`.
    pub(super) fn configuration(&self, robot: &Loaded) -> anyhow::Result<Vec<f64>> {
        let model = &robot.model;
        let mut q = self.start(robot)?;
        let offset = model.nq() - model.joint_count();
        if let Some(text) = &self.q {
            set(model, text, &mut q[offset..])?;
        }
        if let Some(text) = &self.base {
            anyhow::ensure!(model.base().floating, "the base is fixed; --floating-base lets it move");
            set_base(text, &mut q[..7])?;
        }
        Ok(q)
    }

    fn start(&self, robot: &Loaded) -> anyhow::Result<Vec<f64>> {
        let model = &robot.model;
        if let Some(profile) = &robot.profile {
            let name = self.pose.as_ref().unwrap_or(&profile.home);
            return Ok(profile.configuration(model, name)?.as_slice().to_vec());
        }
        anyhow::ensure!(self.pose.is_none(), "the robot has no profile, so its poses have no names; use --q");
        let mut q = model.neutral();
        let offset = model.nq() - model.joint_count();
        for (index, value) in q[offset..].iter_mut().enumerate() {
            let (lower, upper) = (model.lower()[index], model.upper()[index]);
            if !(lower..=upper).contains(value) {
                *value = if lower.is_finite() && upper.is_finite() { (lower + upper) / 2.0 } else { *value };
            }
        }
        Ok(q)
    }
}

/// Sets all joints, or the named ones.
fn set(model: &Model, text: &str, joints: &mut [f64]) -> anyhow::Result<()> {
    if !text.contains('=') {
        let values = numbers(text)?;
        let (found, expected) = (values.len(), joints.len());
        anyhow::ensure!(
            found == expected,
            "--q has {found} positions, expected {expected}: one for every joint"
        );
        joints.copy_from_slice(&values);
        return Ok(());
    }
    for part in text.split(',') {
        let (name, value) =
            part.split_once('=').with_context(|| format!("`{part}` is not JOINT=POSITION"))?;
        let index = model.joint_index(name.trim()).with_context(|| {
            let known = model.joint_names().join(", ");
            format!("robot `{}` has no independent joint `{}`; it has {known}", model.name(), name.trim())
        })?;
        joints[index] = number(value)?;
    }
    Ok(())
}

fn set_base(text: &str, base: &mut [f64]) -> anyhow::Result<()> {
    let values = numbers(text)?;
    let (position, rpy) = match values[..] {
        [x, y, z] => ([x, y, z], [0.0; 3]),
        [x, y, z, roll, pitch, yaw] => ([x, y, z], [roll, pitch, yaw]),
        _ => anyhow::bail!(
            "--base has {} numbers, expected 3 or 6: x,y,z or x,y,z,roll,pitch,yaw",
            values.len()
        ),
    };
    let pose = BasePose { position, rpy }.isometry();
    base[..3].copy_from_slice(&position);
    base[3..].copy_from_slice(pose.rotation.coords.as_slice());
    Ok(())
}

fn numbers(text: &str) -> anyhow::Result<Vec<f64>> {
    text.split(',').map(number).collect()
}

fn number(text: &str) -> anyhow::Result<f64> {
    let value: f64 = text.trim().parse().with_context(|| format!("`{}` is not a number", text.trim()))?;
    anyhow::ensure!(value.is_finite(), "`{value}` is not finite");
    Ok(value)
}

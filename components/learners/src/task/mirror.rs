//! Symmetry of a task between left and right.

use motorium_models::policy::{Policy, Term, TwistRanges};
use serde::Deserialize;

use super::{Choices, TaskError};

/// Left-right symmetry of the robot and the task, about the x-z plane of the base.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Symmetry {
    /// Pairs of joints that mirror each other. A joint that is not in a pair mirrors itself.
    pub pairs: Vec<[String; 2]>,
    /// Joints whose positions change sign when mirrored. If a joint of a pair is listed, the other joint of
    /// the pair must also be listed.
    pub reversed: Vec<String>,
}

/// Mirrors the observations and actions of a task.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirror {
    observation: Vec<(usize, f32)>,
    action: Vec<(usize, f32)>,
}

impl Mirror {
    /// Creates the mirror of a policy's observations and actions.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] if a term or the action has no mirror image.
    pub(super) fn new(policy: &Policy, symmetry: &Symmetry) -> Result<Self, TaskError> {
        let joints = joints(policy, symmetry)?;
        let mut observation: Vec<(usize, f32)> = Vec::new();
        for (number, observed) in policy.observations.iter().enumerate() {
            let axes = |signs: [f32; 3]| -> Vec<(usize, f32)> { signs.into_iter().enumerate().collect() };
            let entries: Vec<(usize, f32)> = match observed.term {
                Term::BaseLinearVelocity | Term::ProjectedGravity => axes([1.0, -1.0, 1.0]),
                Term::BaseAngularVelocity => axes([-1.0, 1.0, -1.0]),
                Term::Command => axes([1.0, -1.0, -1.0]),
                Term::JointPositions | Term::JointVelocities | Term::LastAction => joints.clone(),
                Term::DepthImage | Term::GreyImage => {
                    let columns = observed.pixels.map_or(1, |[columns, _]| columns.max(1));
                    let count = policy.width(observed);
                    let mirrored = |pixel: usize| pixel - pixel % columns + (columns - 1 - pixel % columns);
                    (0..count).map(|pixel| (mirrored(pixel), 1.0)).collect()
                }
                Term::HeightScan | Term::Phase | Term::PointPosition | Term::PointVelocity => {
                    let expected = "a term with a mirror image";
                    return Err(TaskError::value(
                        format!("observations[{number}].term"),
                        observed.term.name(),
                        expected,
                    ));
                }
            };
            let is_equal = entries
                .iter()
                .enumerate()
                .all(|(index, (source, _))| observed.scale.get(index) == observed.scale.get(*source));
            let is_bounded_equally = observed.clip.is_none_or(|[low, high]| low == -high);
            if !is_equal || (!is_bounded_equally && entries.iter().any(|(_, sign)| *sign < 0.0)) {
                let expected = "equal factors on both sides, and bounds of equal size";
                return Err(TaskError::value(
                    format!("observations[{number}]"),
                    observed.term.name(),
                    expected,
                ));
            }
            for _ in 0..observed.history {
                let first = observation.len();
                observation.extend(entries.iter().map(|(source, sign)| (first + source, *sign)));
            }
        }
        Ok(Self { observation, action: joints })
    }

    /// Writes the mirror image of an observation.
    pub fn observation(&self, observation: &[f32], image: &mut [f32]) {
        reflect(&self.observation, observation, image);
    }

    /// Returns the number of the mirror image of each choice.
    ///
    /// # Errors
    ///
    /// [`TaskError::Value`] if the mirror image of a choice is not a choice.
    pub(crate) fn choices(&self, choices: &Choices) -> Result<Vec<usize>, TaskError> {
        let mut image = vec![0.0; choices.width()];
        let images = (0..choices.count()).map(|choice| {
            self.action(choices.row(choice), &mut image);
            let found = (0..choices.count()).find(|other| choices.row(*other) == image);
            found.ok_or_else(|| {
                let row = choices.row(choice);
                let expected = format!("a choice whose mirror image {image:?} is also a choice");
                TaskError::value(format!("action.choices[{choice}]"), format!("{row:?}"), expected)
            })
        });
        images.collect()
    }

    /// Writes the mirror image of an action.
    pub fn action(&self, action: &[f32], image: &mut [f32]) {
        reflect(&self.action, action, image);
    }
}

fn reflect(entries: &[(usize, f32)], numbers: &[f32], image: &mut [f32]) {
    for (number, (source, sign)) in image.iter_mut().zip(entries) {
        *number = sign * numbers[*source];
    }
}

/// Returns, for each joint of the action, its mirror joint and the sign.
fn joints(policy: &Policy, symmetry: &Symmetry) -> Result<Vec<(usize, f32)>, TaskError> {
    let action = &policy.action;
    if let Some(ranges) = &action.twist {
        return twist(ranges, symmetry);
    }
    if policy.pattern.is_some() {
        return Err(TaskError::value("symmetry", "a pattern generator", "an action of joints"));
    }
    let index = |key: &str, name: &String| {
        action.joints.iter().position(|joint| joint == name).ok_or_else(|| {
            let expected = format!("a joint of {}", action.joints.join(", "));
            TaskError::value(format!("symmetry.{key}"), format!("\"{name}\""), expected)
        })
    };
    let mut joints: Vec<(usize, f32)> = (0..action.joints.len()).map(|joint| (joint, 1.0)).collect();
    for [left, right] in &symmetry.pairs {
        let (left, right) = (index("pairs", left)?, index("pairs", right)?);
        if left == right || joints[left].0 != left || joints[right].0 != right {
            let found = format!("\"{}\" and \"{}\"", action.joints[left], action.joints[right]);
            return Err(TaskError::value(
                "symmetry.pairs",
                found,
                "two different joints that are in no other pair",
            ));
        }
        (joints[left].0, joints[right].0) = (right, left);
    }
    for name in &symmetry.reversed {
        joints[index("reversed", name)?].1 = -1.0;
    }
    let is_bounded_equally = action.clip.is_none_or(|[low, high]| low == -high);
    for (joint, (other, sign)) in joints.iter().enumerate() {
        let pose = |joint: usize| action.default_pose[joint] + action.offset.get(joint);
        let is_fitting = joints[*other].1 == *sign
            && action.scale.get(joint) == action.scale.get(*other)
            && pose(joint) == f64::from(*sign) * pose(*other)
            && (*sign > 0.0 || is_bounded_equally);
        if !is_fitting {
            let found = format!("\"{}\" and \"{}\"", action.joints[joint], action.joints[*other]);
            let expected =
                "mirrored poses, equal factors and bounds, and both joints or neither in `reversed`";
            return Err(TaskError::value("symmetry", found, expected));
        }
    }
    Ok(joints)
}

/// The number and the sign from which each number of a base twist is mirrored.
fn twist(ranges: &TwistRanges, symmetry: &Symmetry) -> Result<Vec<(usize, f32)>, TaskError> {
    if let Some(name) = symmetry.pairs.iter().flatten().chain(&symmetry.reversed).next() {
        let expected = "no joints, because the action is a base twist";
        return Err(TaskError::value("symmetry", format!("\"{name}\""), expected));
    }
    let mut numbers = Vec::new();
    let axes = [("forward", 1.0), ("left", -1.0), ("turn", -1.0)];
    for ((name, sign), range) in axes.into_iter().zip(ranges.axes()) {
        let Some([low, high]) = range else { continue };
        if sign < 0.0 && low != -high {
            let expected = "bounds of equal size, for a mirror image";
            return Err(TaskError::value(format!("action.twist.{name}"), format!("{range:?}"), expected));
        }
        numbers.push((numbers.len(), sign));
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::task::Task;

    const TEXT: &str = include_str!("../../../../tasks/quadruped-velocity.toml");

    fn mirror(symmetry: &Symmetry) -> Result<Mirror, TaskError> {
        let policy = Task::parse(TEXT).and_then(|task| task.policy()).expect("a policy");
        Mirror::new(&policy, symmetry)
    }

    fn symmetry() -> Symmetry {
        Task::parse(TEXT).expect("a task").symmetry.expect("the symmetry of the quadruped")
    }

    #[test]
    fn a_double_mirror_image_is_the_original() {
        let mirror = mirror(&symmetry()).expect("a mirror");
        let numbers: Vec<f32> = (1_u8..=48).map(f32::from).collect();
        let (mut image, mut twice) = (vec![0.0; 48], vec![0.0; 48]);
        mirror.observation(&numbers, &mut image);
        mirror.observation(&image, &mut twice);
        assert_eq!(twice, numbers);
        assert_eq!(image[..12], [1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0, -8.0, 9.0, 10.0, -11.0, -12.0]);
        // the left legs have the right legs' positions
        assert_eq!(image[12..18], [-16.0, 17.0, 18.0, -13.0, 14.0, 15.0]);
        let (mut image, mut twice) = (vec![0.0; 12], vec![0.0; 12]);
        mirror.action(&numbers[..12], &mut image);
        mirror.action(&image, &mut twice);
        assert_eq!((&twice[..], image[0]), (&numbers[..12], -4.0));
    }

    #[test]
    fn base_twists_turn_the_other_way_in_a_mirror() {
        let text = include_str!("../../../../tasks/rover-velocity.toml");
        let policy = Task::parse(text).and_then(|task| task.policy()).expect("a policy");
        let mirror = Mirror::new(&policy, &Symmetry::default()).expect("a mirror");
        let mut image = [0.0; 2];
        mirror.action(&[0.3, 0.5], &mut image);
        assert_eq!(image, [0.3, -0.5]);
        let mut image = [0.0; 11];
        mirror.observation(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0], &mut image);
        assert_eq!(image, [1.0, -2.0, 3.0, -4.0, 5.0, -6.0, 7.0, -8.0, -9.0, 10.0, -11.0]);
        let named = Symmetry { pairs: vec![], reversed: vec!["left_wheel".to_owned()] };
        let refused = Mirror::new(&policy, &named);
        assert!(matches!(&refused, Err(TaskError::Value { key, .. }) if key == "symmetry"), "{refused:?}");
    }

    #[test]
    fn images_are_mirrored_by_column() {
        let text = include_str!("../../../../tasks/cart-pole-camera.toml");
        let task = Task::parse(&text.replace("width = 16\nheight = 12", "width = 3\nheight = 2"));
        let task = task.expect("a task");
        let policy = task.policy().expect("a policy");
        let mirror = Mirror::new(&policy, &Symmetry::default()).expect("a mirror");
        let mut image = [0.0; 14];
        let numbers = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0];
        mirror.observation(&numbers, &mut image);
        assert_eq!(image, [3.0, 2.0, 1.0, 6.0, 5.0, 4.0, 9.0, 8.0, 7.0, 12.0, 11.0, 10.0, 13.0, 14.0]);
        // this camera is beside the plane of symmetry
        let refused = task.mirror(&policy, &Symmetry::default());
        let is_named =
            |error: &TaskError| matches!(error, TaskError::Value { key, .. } if key == "cameras.pole.mount");
        assert!(refused.as_ref().is_err_and(is_named), "{refused:?}");
    }

    #[test]
    fn joints_without_a_mirror_image_are_refused() {
        let pair = |left: &str, right: &str| [left.to_owned(), right.to_owned()];
        let text = "front_left_hip_pitch";
        for (pairs, reversed, key) in [
            (vec![pair(text, "tail")], vec![], "symmetry.pairs"),
            (vec![pair(text, text)], vec![], "symmetry.pairs"),
            (vec![pair(text, "front_right_knee")], vec![], "symmetry"),
            (vec![], vec!["tail".to_owned()], "symmetry.reversed"),
            (vec![], vec![text.to_owned()], "symmetry"),
        ] {
            let found = mirror(&Symmetry { pairs, reversed });
            assert!(matches!(&found, Err(TaskError::Value { key: of, .. }) if of == key), "{found:?}");
        }
    }
}

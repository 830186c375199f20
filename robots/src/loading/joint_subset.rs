//! Robots of which a graph moves only some joints. The remaining joints are held at given positions, and
//! their bodies are welded together.

use std::collections::BTreeMap;

use crate::nearest::nearest;
use crate::{Loaded, Model, Profile, SettingError};

/// The joints of a robot moved by a graph, and the positions of the others.
#[derive(Debug, Default)]
pub(crate) struct JointSubset {
    /// Joints to move, or end effectors of the profile for the joints that move them. `None` selects all
    /// joints without a fixed position.
    pub(crate) joints: Option<Vec<String>>,
    /// Positions of held joints \[rad or m\].
    pub(crate) fixed: BTreeMap<String, f64>,
}

impl JointSubset {
    /// Locks the remaining joints: at their fixed position, otherwise in the pose `pose` of the profile or in
    /// its home pose.
    pub(crate) fn apply(&self, robot: &mut Loaded, pose: Option<&str>) -> Result<(), SettingError> {
        if self.joints.is_none() && self.fixed.is_empty() {
            return Ok(());
        }
        let (model, profile) = (&robot.model, robot.profile.as_ref());
        let moved = self.moved(model, profile)?;
        let names = model.joint_names();
        if !moved.contains(&true) {
            return Err(SettingError::new("joints", "all joints are held, expected at least one that moves"));
        }
        // the key that requests the pose
        let asks = match (pose, &self.joints) {
            (Some(_), _) => "start",
            (None, Some(_)) => "joints",
            (None, None) => "fixed",
        };
        let mut posture: Vec<f64> = match profile {
            Some(profile) => profile
                .pose(model, pose.unwrap_or(&profile.home))
                .map_err(|error| SettingError::new(asks, error))?
                .as_slice()
                .to_vec(),
            None => {
                model.lower().iter().zip(model.upper().iter()).map(|(l, u)| 0.0_f64.max(*l).min(*u)).collect()
            }
        };
        for (name, position) in &self.fixed {
            let index = joint("fixed", name, model, None)?;
            let (lower, upper) = (model.lower()[index], model.upper()[index]);
            if !(lower..=upper).contains(position) {
                let message =
                    format!("joint `{name}` is held at {position}, outside its limits {lower} to {upper}");
                return Err(SettingError::new("fixed", message));
            }
            posture[index] = *position;
        }
        let held: Vec<(&str, f64)> = (0..names.len())
            .filter(|index| !moved[*index])
            .map(|index| (names[index].as_str(), posture[index]))
            .collect();
        let locked = model.locked(&held).map_err(|error| SettingError::new("fixed", error))?;
        for posture in &mut robot.postures {
            let mut number = 0..names.len();
            let kept: Vec<f64> = posture
                .joints
                .iter()
                .filter(|_| number.next().is_some_and(|index| moved[index]))
                .copied()
                .collect();
            posture.joints = kept.into();
        }
        if let Some(profile) = &mut robot.profile {
            profile.keep_joints(&locked);
        }
        robot.held = held.iter().map(|(name, position)| ((*name).to_owned(), *position)).collect();
        robot.model = locked;
        Ok(())
    }

    /// Returns, for each joint of the model, `true` if it moves.
    fn moved(&self, model: &Model, profile: Option<&Profile>) -> Result<Vec<bool>, SettingError> {
        let mut moved = vec![self.joints.is_none(); model.joint_count()];
        for name in self.joints.iter().flatten() {
            let end = profile.and_then(|profile| profile.end_effectors.get(name));
            let own = core::slice::from_ref(name);
            let joints = match (model.joint_index(name), end) {
                (None, Some(end)) => &end.joints[..],
                _ => own,
            };
            for name in joints {
                moved[joint("joints", name, model, profile)?] = true;
            }
        }
        for name in self.fixed.keys() {
            let index = joint("fixed", name, model, None)?;
            if self.joints.is_some() && moved[index] {
                let message = format!(
                    "joint `{name}` is also in `joints`, but a joint either moves or is held; remove it from one of them"
                );
                return Err(SettingError::new("fixed", message));
            }
            moved[index] = false;
        }
        Ok(moved)
    }
}

/// Returns the index of the joint named by a key.
fn joint(
    key: &'static str,
    name: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<usize, SettingError> {
    model.joint_index(name).ok_or_else(|| {
        let ends = profile.into_iter().flat_map(|profile| profile.end_effectors.keys());
        let known = || model.joint_names().iter().chain(ends.clone()).map(String::as_str);
        let advice = match nearest(name, known()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("expected one of {}", known().collect::<Vec<_>>().join(", ")),
        };
        SettingError::new(key, format!("robot `{}` has no joint `{name}`: {advice}", model.name()))
    })
}

impl Profile {
    /// Removes entries of joints that the robot's model no longer has.
    fn keep_joints(&mut self, model: &Model) {
        let has = |joint: &String| model.joint_index(joint).is_some();
        let kept: Vec<bool> = self.joints.iter().map(has).collect();
        self.arrays(&mut |values| {
            let mut number = 0..kept.len();
            values.retain(|_| number.next().is_some_and(|index| kept[index]));
        });
        self.joints.retain(has);
        self.passive.retain(has);
        for end in self.end_effectors.values_mut() {
            end.joints.retain(has);
            end.fingers.retain(has);
        }
        // an end effector without moving joints has no effect
        self.end_effectors.retain(|_, end| !end.joints.is_empty());
        self.feet.values_mut().for_each(|foot| foot.joints.retain(has));
        let drives = |base: &crate::MobileBase| {
            [&base.joints, &base.wheels, &base.steering].into_iter().all(|joints| joints.iter().all(has))
        };
        self.mobile_base = self.mobile_base.take().filter(drives);
    }
}

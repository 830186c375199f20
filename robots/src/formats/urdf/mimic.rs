//! Mimic joints, resolved to the independent joint at the end of their chain.

use std::collections::HashMap;

use urdf_rs::{JointType, Robot};

use super::error::{UrdfError, UrdfProblem};
use super::source::Survey;
use crate::nearest::nearest;

/// position = multiplier * position of joint `master` + offset
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follow {
    pub(crate) master: usize,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// Returns, for every joint of the file, the joint it follows, if it is a mimic joint.
pub(crate) fn resolve(robot: &Robot, survey: &Survey) -> Result<Vec<Option<Follow>>, UrdfError> {
    let by_name: HashMap<&str, usize> =
        robot.joints.iter().enumerate().map(|(index, joint)| (&*joint.name, index)).collect();
    let fixed = |index: usize| robot.joints[index].joint_type == JointType::Fixed;
    (0..robot.joints.len())
        .map(|start| {
            let mut chain = vec![start];
            let mut follow = Follow { master: start, multiplier: 1.0, offset: 0.0 };
            while let Some(mimic) = robot.joints[follow.master].mimic.as_ref().filter(|_| !fixed(start)) {
                let current = follow.master;
                let error = |problem| Err(UrdfError::new(survey.joints[current].at, problem));
                let (joint, of) = (robot.joints[current].name.clone(), mimic.joint.clone());
                let Some(&next) = by_name.get(&*mimic.joint) else {
                    let nearest = nearest(&of, by_name.keys().copied()).map(str::to_owned);
                    return error(UrdfProblem::UnknownMimic { joint, of, nearest });
                };
                if fixed(next) {
                    return error(UrdfProblem::MimicOfFixed { joint, of });
                }
                // Their position is not a single number, so a factor and an offset cannot map it.
                let kind = match robot.joints[next].joint_type {
                    JointType::Floating => Some("floating"),
                    JointType::Planar => Some("planar"),
                    _ => None,
                };
                if let Some(kind) = kind {
                    return error(UrdfProblem::MimicOfSeveral { joint, of, kind });
                }
                let again = chain.contains(&next);
                chain.push(next);
                if again {
                    let names = chain.iter().map(|&joint| robot.joints[joint].name.clone()).collect();
                    return error(UrdfProblem::MimicLoop(names));
                }
                follow.offset += follow.multiplier * mimic.offset.unwrap_or(0.0);
                follow.multiplier *= mimic.multiplier.unwrap_or(1.0);
                follow.master = next;
            }
            Ok((follow.master != start).then_some(follow))
        })
        .collect()
}

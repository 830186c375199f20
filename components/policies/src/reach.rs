//! Joints that move a frame, and the largest distance of the frame from the base of the robot.

use motorium_robots::{FrameId, JointKind, Model};
use nalgebra::Vector3;

/// Largest distance of a frame from the first joint that moves it, with all links in one line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reach {
    /// Position of that joint in the world, m.
    anchor: Vector3<f64>,
    /// Sum of the lengths of the links from that joint, including the largest displacements of prismatic
    /// joints, m.
    length: f64,
}

impl Reach {
    /// Returns the reach of a frame on a robot with a fixed base; `None` for a frame that no joint moves.
    pub(crate) fn of_frame(model: &Model, frame: FrameId) -> Option<Self> {
        let frame = &model.frames()[frame.index()];
        let mut length = frame.placement.translation.vector.norm();
        let mut body = frame.body?;
        loop {
            let joint = &model.bodies()[body].joint;
            if joint.kind == JointKind::Prismatic {
                length += joint.limits.lower.abs().max(joint.limits.upper.abs());
            }
            match model.bodies()[body].parent {
                Some(parent) => {
                    length += joint.placement.translation.vector.norm();
                    body = parent;
                }
                None => return Some(Self { anchor: joint.placement.translation.vector, length }),
            }
        }
    }

    /// Returns the sum of the lengths of the links, m.
    pub(crate) fn length(&self) -> f64 {
        self.length
    }

    /// Returns the distance of a position from the first joint, m, if it exceeds the reach.
    pub(crate) fn beyond(&self, place: &Vector3<f64>) -> Option<f64> {
        let distance = (place - self.anchor).norm();
        (distance > self.length).then_some(distance)
    }
}

/// Returns one entry per joint of `model`: `true` for an independent joint that moves the frame.
pub(crate) fn moving_joints(model: &Model, frame: FrameId) -> Vec<bool> {
    let mut moving = vec![false; model.joint_count()];
    let mut body = model.frames()[frame.index()].body;
    while let Some(index) = body {
        moving[model.bodies()[index].joint.coordinate.index()] = true;
        body = model.bodies()[index].parent;
    }
    moving
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use motorium_robots::Kinematics;

    use super::*;

    #[test]
    fn no_posture_exceeds_the_reach_of_a_frame() {
        for (name, frame) in
            [("panda", "panda_hand_tcp"), ("ur5e", "tool0"), ("planar-3r", "tip"), ("cart-pole", "tip")]
        {
            let Ok(robot) = motorium_robots::load(name, Path::new(".")) else { panic!("{name} loads") };
            let model = &robot.model;
            let frame = match model.frame(frame) {
                Ok(frame) => frame,
                Err(_) => model.end_effector(robot.profile.as_ref(), None).unwrap(),
            };
            let reach = Reach::of_frame(model, frame).unwrap();
            let mut kinematics = Kinematics::new(model);
            let mut state = 3_u64;
            let mut random = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 11) as f64 / (1_u64 << 53) as f64
            };
            for _ in 0..500 {
                let q: Vec<f64> = (0..model.joint_count())
                    .map(|joint| {
                        let (low, high) = (model.lower()[joint].max(-3.2), model.upper()[joint].min(3.2));
                        low + (high - low) * random()
                    })
                    .collect();
                kinematics.update(model, &q);
                let place = kinematics.pose(model, frame).translation.vector;
                assert_eq!(reach.beyond(&place), None, "{name} at {q:?}");
            }
        }
        let robot = motorium_robots::load("planar-3r", Path::new(".")).unwrap();
        let frame = robot.model.frame("tip").unwrap();
        let reach = Reach::of_frame(&robot.model, frame).unwrap();
        let mut kinematics = Kinematics::new(&robot.model);
        kinematics.update(&robot.model, &[0.0; 3]);
        let place = kinematics.pose(&robot.model, frame).translation.vector;
        let farther = reach.anchor + (place - reach.anchor) * (1.0 + 1e-9);
        assert!(reach.beyond(&place).is_none_or(|distance| distance < reach.length * (1.0 + 1e-12)));
        assert!(reach.beyond(&farther).is_some(), "stretched, its links are in one line");
    }
}

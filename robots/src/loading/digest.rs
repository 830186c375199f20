//! Digests of robots, which detect that a file was made for a different robot. Equal robots have equal
//! digests, regardless of the order of their joints.

use core::hash::Hasher as _;

use nalgebra::Isometry3;
use twox_hash::XxHash3_64;

use crate::model::{Coordinate, Inertia, Joint};
use crate::{JointKind, Loaded, Model};

/// A digest in progress.
#[derive(Default)]
struct Digest(XxHash3_64);

impl Digest {
    /// Adds a string.
    fn text(&mut self, text: &str) {
        self.0.write(text.as_bytes());
        self.0.write(&[0xff]);
    }

    /// Adds numbers, rounded to 1e-9, because the last bits of a sum or a sine differ between processors.
    fn numbers(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for number in numbers {
            let rounded = if number.is_finite() { (number * 1e9).round() + 0.0 } else { number };
            self.0.write(&rounded.to_le_bytes());
        }
    }

    fn pose(&mut self, pose: &Isometry3<f64>) {
        self.numbers(pose.translation.vector.iter().copied());
        self.numbers(pose.rotation.to_rotation_matrix().matrix().iter().copied());
    }

    fn inertia(&mut self, inertia: &Inertia) {
        self.numbers([inertia.mass]);
        self.numbers(inertia.com.iter().chain(inertia.rotational.iter()).copied());
    }

    /// Adds the motion of a joint: kind and axis.
    fn motion(&mut self, joint: &Joint) {
        self.text(match joint.kind {
            JointKind::Revolute => "revolute",
            JointKind::Continuous => "continuous",
            JointKind::Prismatic => "prismatic",
        });
        self.numbers(joint.axis.iter().copied());
    }

    fn finish(self) -> u64 {
        self.0.finish()
    }
}

impl Model {
    /// Returns a digest of the names, kinds, axes and limits of these joints, in this order. `None` if a
    /// joint does not exist.
    ///
    /// ```
    /// let model = motorium_robots::load("panda", std::path::Path::new("."))?.model;
    /// let digest = |names: &[&str]| model.joint_digest(names);
    /// assert!(digest(&["panda_joint1"]).is_some() && digest(&["elbow"]).is_none());
    /// assert_ne!(digest(&["panda_joint1"]), digest(&["panda_joint2"]));
    /// # Ok::<(), motorium_robots::LoadError>(())
    /// ```
    pub fn joint_digest(&self, joints: &[impl AsRef<str>]) -> Option<u64> {
        let mut digest = Digest::default();
        for name in joints {
            let index = self.joint_index(name.as_ref())?;
            digest.text(name.as_ref());
            digest.motion(self.joint(index));
            let limits = [self.lower(), self.upper(), self.velocity_limit(), self.effort_limit()];
            digest.numbers(limits.map(|limits| limits[index]));
        }
        Some(digest.finish())
    }
}

impl Loaded {
    /// Returns a digest of everything that affects the motion of the robot: base, links, inertias, joints,
    /// drives, and the gains of the profile. Shapes and appearance are excluded.
    pub fn dynamics_digest(&self) -> u64 {
        let Self { model, profile, .. } = self;
        let mut digest = Digest::default();
        digest.text(if model.base().floating { "floating" } else { "fixed" });
        if model.base().floating {
            digest.inertia(&model.base().inertia);
        }
        let bodies = model.bodies();
        let mut sorted: Vec<_> = bodies.iter().collect();
        sorted.sort_by_key(|body| &body.name);
        for body in sorted {
            let joint = &body.joint;
            digest.text(&body.name);
            digest.text(body.parent.map_or("", |parent| &bodies[parent].name));
            digest.text(&joint.name);
            digest.motion(joint);
            digest.pose(&joint.placement);
            digest.inertia(&body.inertia);
            let dynamics = joint.dynamics;
            digest.numbers([dynamics.damping, dynamics.friction, dynamics.stiffness, dynamics.rest]);
            digest.numbers([joint.drive.armature()]);
            let limits = joint.limits;
            digest.numbers([limits.lower, limits.upper, limits.velocity, limits.effort]);
            if let Coordinate::Mimic { of, multiplier, offset } = joint.coordinate {
                digest.text(&model.joint(of).name);
                digest.numbers([multiplier, offset]);
            }
        }
        let mut joints: Vec<usize> = (0..model.joint_count()).collect();
        joints.sort_by_key(|joint| &model.joint_names()[*joint]);
        if let Some(gains) = profile.as_ref().and_then(|profile| profile.gains(model).ok()) {
            for joint in joints {
                digest.numbers([gains.kp[joint], gains.kd[joint]]);
            }
        }
        digest.finish()
    }
}

//! Conversion of position actuators to gains, and the profile of a file from its gains and keyframes.

use std::collections::BTreeMap;

use nalgebra::DMatrix;

use super::keyframes::Keyframe;
use crate::profile::GainArrays;
use crate::{BaseKind, BasePose, Coordinate, Dynamics, Model, PerJoint, Profile};

/// Drive of a joint, at the joint: `tau = kp (q_des - q) + kd (v_des - v)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PositionDrive {
    pub(crate) kp: f64,
    pub(crate) kd: f64,
    /// Alternative to `kd`: the damping ratio, for the inertia of the joint in the pose of the file.
    pub(crate) damping_ratio: f64,
}

/// The drives of a file, by the body that the joint moves.
#[derive(Default)]
pub(crate) struct Drives {
    /// `None` for an actuator that is not a position drive, such as a motor or a muscle.
    pub(crate) by_body: BTreeMap<usize, Option<PositionDrive>>,
    /// `true` if unidentified joints are driven, by tendons or sites.
    pub(crate) others: bool,
}

/// Returns the profile of a file; `None` without a pose or a position drive.
pub(crate) fn profile(
    model: &Model,
    references: &[f64],
    keyframes: Vec<Keyframe>,
    drives: &Drives,
) -> Option<Profile> {
    let position = drives.by_body.values().any(Option::is_some);
    let independent: Vec<usize> = (0..model.bodies().len())
        .filter(|body| matches!(model.bodies()[*body].joint.coordinate, Coordinate::Independent(_)))
        .collect();
    let pick = |positions: &[f64]| independent.iter().map(|body| positions[*body]).collect::<Vec<f64>>();
    let (mut poses, mut base_poses) = (BTreeMap::new(), BTreeMap::new());
    let mut home = None;
    for Keyframe { name, base, positions } in keyframes {
        let joints = pick(&positions);
        let limits = model.lower().iter().zip(model.upper().iter());
        // An unreachable pose is ignored.
        if joints.iter().zip(limits).any(|(q, (low, high))| *q < low - 1e-9 || *q > high + 1e-9) {
            continue;
        }
        if let Some(base) = base {
            let (roll, pitch, yaw) = base.rotation.euler_angles();
            let position = base.translation.vector.into();
            base_poses.insert(name.clone(), BasePose { position, rpy: [roll, pitch, yaw] });
        }
        if home.is_none() || name == "home" {
            home = Some(name.clone());
        }
        poses.insert(name, PerJoint::Each(joints));
    }
    if poses.is_empty() && !position {
        return None;
    }
    let home = home.unwrap_or_else(|| {
        poses.insert("zero".to_owned(), PerJoint::Each(pick(references)));
        "zero".to_owned()
    });
    let names = model.joint_names();
    let undriven = |body: &usize| !drives.others && !drives.by_body.contains_key(body);
    let passive =
        independent.iter().zip(names).filter(|(body, _)| !drives.by_body.is_empty() && undriven(body));
    let passive = passive.map(|(_, name)| name.clone()).collect();
    let gains = position.then(|| gains(model, references, &independent, drives));
    let mut profile = Profile::empty();
    profile.title = model.name().to_owned();
    profile.sources = vec!["keyframes and actuators of the robot's file".to_owned()];
    if model.base().floating {
        profile.base = BaseKind::Floating;
    }
    profile.joints = names.to_vec();
    (profile.home, profile.passive, profile.gains) = (home, passive, gains);
    (profile.poses, profile.base_poses) = (poses, base_poses);
    Some(profile)
}

fn gains(model: &Model, references: &[f64], independent: &[usize], drives: &Drives) -> GainArrays {
    let (first, mut q) = (model.nv() - independent.len(), model.neutral());
    let offset = q.len() - independent.len();
    for (place, body) in q[offset..].iter_mut().zip(independent) {
        *place = references[*body];
    }
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    Dynamics::new(model).crba(model, &q, &mut mass);
    // As of MuJoCo 3.15, a damping ratio refers to the inertia of the joint with all others free.
    let inverse = mass.cholesky().map(|factor| factor.inverse());
    let (mut kp, mut kd) = (Vec::new(), Vec::new());
    for (index, body) in independent.iter().enumerate() {
        let drive = drives.by_body.get(body).copied().flatten();
        let PositionDrive { kp: stiffness, kd: damping, damping_ratio } =
            drive.unwrap_or(PositionDrive { kp: 0.0, kd: 0.0, damping_ratio: 0.0 });
        let joint = first + index;
        let inertia = inverse.as_ref().map_or(0.0, |inverse| inverse[(joint, joint)].recip());
        kp.push(stiffness);
        kd.push(damping + 2.0 * damping_ratio * (stiffness * inertia).sqrt());
    }
    GainArrays { kp: PerJoint::Each(kp), kd: PerJoint::Each(kd) }
}

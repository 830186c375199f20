//! Legged robots of the catalogue stand, held by their drives; flying robots can hover; left and right mirror
//! each other.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    Dynamics, Entry, Kinematics, Loaded, Model, Profile, Reference, Spin, catalogue, load,
};
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn loaded(entry: &Entry) -> (Model, Profile) {
    let Loaded { model, profile, .. } = load(entry.name, Path::new(".")).unwrap();
    (model, profile.unwrap())
}

/// Frames and points in them at which the robot touches the ground, with its feet in these poses.
fn contacts(
    model: &Model,
    profile: &Profile,
    kinematics: &Kinematics,
) -> Vec<(usize, Isometry3<f64>, Vector3<f64>)> {
    let mut found = Vec::new();
    let mut touch = |frame: &str, radius: Option<f64>, sole: Option<[f64; 2]>| {
        let id = model.frame(frame).unwrap();
        let pose = kinematics.pose(model, id);
        let below = |radius: f64| pose.rotation.inverse() * Vector3::new(0.0, 0.0, -radius);
        match sole {
            Some([x, y]) => {
                for (across, along) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    found.push((id.index(), pose, Vector3::new(along * x / 2.0, across * y / 2.0, 0.0)));
                }
            }
            None => found.push((id.index(), pose, below(radius.unwrap_or(0.0)))),
        }
    };
    for foot in profile.feet.values() {
        touch(&foot.frame, foot.radius, foot.sole);
    }
    // a wheel that is also a foot is listed once
    if let (Some(base), true) = (&profile.mobile_base, profile.feet.len() < 4) {
        for wheel in &base.wheels {
            let body = model.joint_body(model.joint_index(wheel).unwrap());
            touch(&model.bodies()[body].name, base.wheel_radius, None);
        }
    }
    found
}

/// Returns minimum-norm vertical forces at `points` that carry the robot with this mass and centre of mass.
fn loads(points: &[Point3<f64>], mass: f64, com: &Vector3<f64>, planar: bool) -> DVector<f64> {
    let rows = if planar { 2 } else { 3 };
    let row = |row, point: &Vector3<f64>| [1.0, point.x, point.y][row];
    let a = DMatrix::from_fn(rows, points.len(), |i, j| row(i, &points[j].coords));
    let b = DVector::from_fn(rows, |i, _| mass * 9.81 * row(i, com));
    let forces = a.clone().svd(true, true).solve(&b, 1e-9).unwrap();
    assert!((&a * &forces - b).norm() < 1e-6 * mass, "no vertical forces balance it");
    forces
}

/// Frame, point in the frame, and vertical force at that point \[N\].
type Load = (usize, Vector3<f64>, f64);

/// Returns the robot in a pose and the force on each contact; `None` if it does not stand.
fn stand(model: &Model, profile: &Profile, pose: &str) -> Option<(DVector<f64>, Vec<Load>)> {
    let q = profile.configuration(model, pose).unwrap();
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q.as_slice());
    let contacts = contacts(model, profile, &kinematics);
    if contacts.is_empty() {
        return None;
    }
    let points: Vec<_> = contacts.iter().map(|(_, pose, local)| pose * Point3::from(*local)).collect();
    for point in &points {
        assert!(point.z.abs() < 1e-6, "{}: {pose}: a contact at height {} m", model.name(), point.z);
    }
    let com = kinematics.centre_of_mass(model).position;
    let forces = loads(&points, model.mass(), &com, !model.base().floating);
    assert!(
        forces.min() > 0.02 * forces.mean(),
        "{}: {pose}: centre of mass {com:.3} at the edge of its support: {forces:.2}",
        model.name()
    );
    let carried = contacts.iter().zip(forces.iter()).map(|(contact, force)| (contact.0, contact.2, *force));
    Some((q, carried.collect()))
}

#[test]
fn standing_poses_have_feet_on_the_ground_below_the_weight() {
    let mut standing = Vec::new();
    for entry in catalogue() {
        let (model, profile) = loaded(entry);
        if profile.poses.keys().filter(|pose| stand(&model, &profile, pose).is_some()).count() > 0 {
            standing.push(entry.name);
        }
    }
    let expected = "ackermann biped centaur differential-drive hexapod humanoid planar-biped quadruped";
    assert_eq!(standing.join(" "), expected);
}

/// Returns the torques that hold the robot still at home, with the weight on its feet. The rows without a
/// drive must be zero.
fn holding(model: &Model, profile: &Profile) -> DVector<f64> {
    let mut dynamics = Dynamics::new(model);
    let mut tau = DVector::zeros(model.nv());
    match stand(model, profile, &profile.home) {
        None => {
            let q = profile.configuration(model, &profile.home).unwrap();
            dynamics.gravity(model, q.as_slice(), GRAVITY, tau.as_mut_slice());
        }
        Some((q, forces)) => {
            dynamics.gravity(model, q.as_slice(), GRAVITY, tau.as_mut_slice());
            let mut kinematics = Kinematics::new(model);
            kinematics.update(model, q.as_slice());
            for (frame, local, force) in forces {
                let id = model.frame(&model.frames()[frame].name).unwrap();
                let arm = kinematics.pose(model, id).rotation * local;
                let mut jacobian = DMatrix::zeros(6, model.nv());
                kinematics.jacobian(model, id, Reference::LocalWorldAligned, &mut jacobian);
                for column in 0..model.nv() {
                    let turn =
                        Vector3::new(jacobian[(3, column)], jacobian[(4, column)], jacobian[(5, column)]);
                    tau[column] -= force * (jacobian[(2, column)] + turn.cross(&arm).z);
                }
            }
        }
    }
    tau
}

#[test]
fn drives_hold_every_robot_at_home_with_little_sag() {
    for entry in catalogue().iter().filter(|entry| entry.profile.rotors.is_empty()) {
        let (model, profile) = loaded(entry);
        let tau = holding(&model, &profile);
        let gains = profile.gains(&model).unwrap();
        let offset = model.nv() - model.joint_count();
        for index in 0..offset {
            assert!(tau[index].abs() < 1e-6, "{}: the base is not in balance: {:.4}", entry.name, tau[index]);
        }
        for (index, joint) in model.joint_names().iter().enumerate() {
            let torque = tau[offset + index].abs();
            let limit = model.effort_limit()[index];
            if profile.passive.contains(joint) {
                assert!(torque < 1e-6, "{}: no drive holds {joint} against {torque:.3}", entry.name);
                continue;
            }
            assert!(torque <= 0.7 * limit, "{}: {joint} must hold {torque:.2} of {limit:.2}", entry.name);
            if gains.kp[index] > 0.0 {
                let sag = torque / gains.kp[index];
                assert!(sag < 0.12, "{}: {joint} sags by {sag:.3} under {torque:.2}", entry.name);
            } else {
                assert!(torque < 1e-6, "{}: {joint} has no stiffness, but must hold {torque:.3}", entry.name);
            }
        }
    }
}

#[test]
fn default_gains_damp_every_joint_near_critically_at_home() {
    for entry in catalogue().iter().filter(|entry| entry.profile.rotors.is_empty()) {
        let (model, profile) = loaded(entry);
        let home = profile.configuration(&model, &profile.home).unwrap();
        let gains = profile.gains(&model).unwrap();
        let mut mass = DMatrix::zeros(model.nv(), model.nv());
        Dynamics::new(&model).crba(&model, home.as_slice(), &mut mass);
        let offset = model.nv() - model.joint_count();
        for (index, joint) in model.joint_names().iter().enumerate() {
            let inertia = mass[(offset + index, offset + index)];
            let (kp, kd) = (gains.kp[index], gains.kd[index]);
            if profile.passive.contains(joint) {
                assert_eq!((kp, kd), (0.0, 0.0), "{} {joint} has no drive", entry.name);
            } else if kp == 0.0 {
                let base = profile.mobile_base.as_ref().expect("only wheels are driven by speed");
                assert!(base.wheels.contains(joint), "{} {joint} is not a wheel", entry.name);
                let settling = inertia / kd;
                assert!((1e-4..0.1).contains(&settling), "{} {joint}: {settling:.4} s", entry.name);
            } else {
                let ratio = kd / (2.0 * (kp * inertia).sqrt());
                assert!((0.6..2.5).contains(&ratio), "{} {joint}: damping ratio {ratio:.2}", entry.name);
            }
        }
    }
}

#[test]
fn quadrotor_can_hover_and_yaw_in_both_directions() {
    let entry = catalogue().iter().find(|entry| entry.name == "quadrotor").unwrap();
    let (model, profile) = loaded(entry);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &model.neutral());
    let com = kinematics.centre_of_mass(&model).position;
    let share = model.mass() * 9.81 / profile.rotors.len() as f64;
    let (mut moment, mut drag) = (Vector3::zeros(), 0.0);
    for rotor in profile.rotors.values() {
        assert!(share < 0.6 * rotor.max_thrust, "hovering requires {share:.3} of {} N", rotor.max_thrust);
        let pose = kinematics.pose(&model, model.frame(&rotor.frame).unwrap());
        moment += (pose.translation.vector - com).cross(&(pose * Vector3::z() * share));
        let sign = if rotor.spin == Spin::Clockwise { 1.0 } else { -1.0 };
        drag += sign * share * rotor.torque_per_thrust;
    }
    assert!(moment.norm() < 1e-12 && drag.abs() < 1e-12, "{moment} {drag}");
}

/// Returns the joint, link or row of the other side.
fn other_side(name: &str) -> String {
    match name.contains("left") {
        true => name.replace("left", "right"),
        false => name.replace("right", "left"),
    }
}

#[test]
fn left_and_right_mirror_each_other() {
    let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
    let mut mirrored = 0;
    for entry in catalogue() {
        let (model, profile) = loaded(entry);
        // the Panda's fingers mirror each other, the arm does not
        if entry.name == "panda" || !model.frames().iter().any(|frame| frame.name.contains("left")) {
            continue;
        }
        mirrored += 1;
        let offset = model.nq() - model.joint_count();
        let (mut q, mut reflected) = (model.neutral(), model.neutral());
        for (index, name) in model.joint_names().iter().enumerate() {
            let joint = model.joint(index);
            let other =
                model.joint_index(&other_side(name)).unwrap_or_else(|| panic!("{name} has no counterpart"));
            let across = joint.axis.y.abs() > 0.5;
            let kept = across != (joint.kind == motorium_robots::JointKind::Prismatic);
            let sign = if kept { 1.0 } else { -1.0 };
            q[offset + index] = 0.7 * (1.0 + index as f64).sin();
            reflected[offset + other] = sign * q[offset + index];
            let limits = (model.lower()[index], model.upper()[index]);
            let others = (model.lower()[other], model.upper()[other]);
            assert_eq!(if kept { limits } else { (-limits.1, -limits.0) }, others, "{} {name}", entry.name);
            assert_eq!(model.effort_limit()[index], model.effort_limit()[other], "{} {name}", entry.name);
            if let Ok(gains) = profile.gains(&model) {
                assert_eq!((gains.kp[index], gains.kd[index]), (gains.kp[other], gains.kd[other]), "{name}");
            }
        }
        let (mut here, mut there) = (Kinematics::new(&model), Kinematics::new(&model));
        here.update(&model, &q);
        there.update(&model, &reflected);
        for frame in model.frames() {
            let pose = here.pose(&model, model.frame(&frame.name).unwrap());
            let image = there.pose(&model, model.frame(&other_side(&frame.name)).unwrap());
            let expected = mirror * pose.translation.vector;
            assert_relative_eq!(image.translation.vector, expected, epsilon = 1e-12);
            let expected = mirror * pose.rotation.to_rotation_matrix().matrix() * mirror;
            assert_relative_eq!(*image.rotation.to_rotation_matrix().matrix(), expected, epsilon = 1e-12);
        }
        for (index, body) in model.bodies().iter().enumerate() {
            let other = model.bodies().iter().position(|other| other.name == other_side(&body.name)).unwrap();
            let inertia = body.inertia.moved(&here.body_pose(index));
            let image = model.bodies()[other].inertia.moved(&there.body_pose(other));
            assert_relative_eq!(image.mass, inertia.mass, epsilon = 1e-12);
            assert_relative_eq!(image.com, mirror * inertia.com, epsilon = 1e-9);
            assert_relative_eq!(image.rotational, mirror * inertia.rotational * mirror, epsilon = 1e-9);
        }
    }
    assert_eq!(mirrored, 9);
}

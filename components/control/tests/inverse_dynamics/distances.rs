//! Distances kept to within a tenth of a millimetre without chatter, by solids with flat sides, edges,
//! corners and round surfaces.

use std::sync::Arc;

use motorium_control::tasks::Feedback;
use motorium_control::{
    DifferentialIk, RobotState,
    inverse_dynamics::{DynamicsRows, InverseDynamics, InverseDynamicsSettings, MotionState},
    limits::{CollisionLimit, CollisionSettings, PositionLimit, RowLimit, VelocityLimit},
    tasks::{CartesianSettings, CartesianTask, CentreOfMassTask, ContactTask, PostureTask},
};
use motorium_robots::{
    BaseMode, CollisionModel, CollisionOptions, Collisions, FrameId, Geometry, Kinematics, LoadOptions,
    MeshMode, Model, TriangleMesh, parse_urdf_with,
};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::robots::{Random, Robot};

const DT: f64 = 1e-3;
/// Required distance, and the largest permitted shortfall, m.
const DISTANCE: f64 = 0.03;
const MISSED: f64 = 1e-4;

/// A plate or another shape that moves freely on three slides and three hinges, or on a floating base.
pub(crate) fn flying(shape: &str, base: BaseMode) -> Model {
    let mut text = String::from("<robot name=\"flying\"><link name=\"base\"/>");
    let (mut parent, last) = ("base".to_owned(), 5);
    for index in 0..=last {
        let (name, kind) = (format!("l{index}"), if index < 3 { "prismatic" } else { "revolute" });
        let axis = ["1 0 0", "0 1 0", "0 0 1"][index % 3];
        let body = match index == last {
            true => format!("<collision><geometry>{shape}</geometry></collision>"),
            false => String::new(),
        };
        text += &format!(
            "<link name=\"{name}\"><inertial><mass value=\"1\"/><inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/></inertial>{body}</link>\
             <joint name=\"j{index}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-3\" upper=\"3\" velocity=\"3\" effort=\"100\"/></joint>"
        );
        parent = name;
    }
    text += "</robot>";
    parse_urdf_with(&text, None, &LoadOptions { base, ..LoadOptions::default() }).unwrap().model
}

/// A box as a mesh.
fn mesh(size: [f64; 3]) -> Geometry {
    let corner = |index: u32| {
        Vector3::from_fn(|axis, _| if index >> axis & 1 == 0 { -0.5 * size[axis] } else { 0.5 * size[axis] })
    };
    let triangles = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    let mesh = TriangleMesh { points: (0..8).map(corner).collect(), triangles: triangles.to_vec() };
    Geometry::Mesh {
        uri: "box".to_owned(),
        path: None,
        inline: Some(Arc::new(mesh)),
        scale: Vector3::repeat(1.0),
    }
}

fn obstacles() -> [(&'static str, Geometry); 5] {
    [
        ("box", Geometry::Box { size: Vector3::new(0.3, 0.16, 0.2) }),
        ("mesh", mesh([0.3, 0.16, 0.2])),
        ("cylinder", Geometry::Cylinder { radius: 0.15, length: 0.2 }),
        ("capsule", Geometry::Capsule { radius: 0.1, length: 0.3 }),
        ("sphere", Geometry::Sphere { radius: 0.15 }),
    ]
}

/// Distances kept by a robot.
#[derive(Debug)]
struct Kept {
    smallest: f64,
    /// At the end.
    last: f64,
    /// Largest velocity change between consecutive ticks at the end, at rest \[rad/s or m/s\].
    chatter: f64,
}

/// Moves a frame to `target` in 4 s, ending at rest, and measures the distances of `solids`.
fn lead(
    (model, q): (&Model, &[f64]),
    frame: FrameId,
    target: &dyn Fn(f64) -> Isometry3<f64>,
    solids: &CollisionModel,
    settings: CollisionSettings,
) -> Kept {
    let mut limit = CollisionLimit::new(model, solids.clone(), settings);
    let mut reach = CartesianTask::new(model, frame);
    reach.set_settings(CartesianSettings {
        gain: 5.0,
        orientation_weight: 0.3,
        ..CartesianSettings::default()
    });
    let joints = model.nq() - model.joint_count();
    let mut posture = PostureTask::new(model, &q[joints..]);
    let mut ik = DifferentialIk::with_rows(model, limit.rows());
    let (mut q, mut kinematics) = (q.to_vec(), Kinematics::new(model));
    let mut measure = Collisions::new(solids);
    let mut kept = Kept { smallest: f64::INFINITY, last: 0.0, chatter: 0.0 };
    let mut before = vec![0.0; model.nv()];
    for tick in 0..6000 {
        kinematics.update(model, &q);
        measure.update(solids, &kinematics);
        kept.last = measure.nearest(solids).unwrap().distance;
        kept.smallest = kept.smallest.min(kept.last);
        let state = RobotState { model, kinematics: &kinematics, q: &q };
        reach.set_target(target((f64::from(tick) * DT).min(4.0)));
        ik.begin();
        ik.add_task(&state, 0, &mut reach);
        ik.add_task(&state, 0, &mut posture);
        ik.add_limit(&state, &PositionLimit::default(), DT);
        ik.add_limit(&state, &VelocityLimit::default(), DT);
        ik.add_row_limit(&state, &mut limit, DT);
        let v = ik.solve().unwrap().to_vec();
        if tick >= 5500 {
            let changes = v.iter().zip(&before).map(|(now, before)| (now - before).abs());
            kept.chatter = changes.fold(kept.chatter, f64::max);
        }
        let step: Vec<f64> = v.iter().map(|v| v * DT).collect();
        let from = q.clone();
        model.integrate(&from, &step, &mut q);
        before = v;
    }
    kept
}

fn settings() -> CollisionSettings {
    CollisionSettings { distance: DISTANCE, range: 0.3, ..CollisionSettings::default() }
}

/// Presses a shape against obstacles from several sides while it rolls and pitches.
fn press(shape: &str, base: BaseMode) {
    let model = flying(shape, base);
    let frame = model.frame("l5").unwrap();
    for (name, obstacle) in obstacles() {
        for turn in 0..3 {
            let mut random = Random(7 + turn);
            let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
            let placed = Isometry3::from_parts(
                Translation3::identity(),
                UnitQuaternion::from_scaled_axis(random.vector(if turn == 0 { 0.0 } else { 1.0 })),
            );
            solids.add_obstacle("obstacle", placed, obstacle.clone(), MeshMode::default()).unwrap();
            let mut q = model.neutral();
            let joints = model.nq() - model.joint_count();
            q[joints + 2] = 0.5;
            let (phase, side) = (random.vector(3.0), random.vector(0.2));
            let target = |t: f64| {
                let swing = Vector3::new(
                    0.3 * (2.0 * t + phase.x).sin(),
                    0.3 * (1.7 * t + phase.y).sin(),
                    0.5 * (1.3 * t).sin(),
                );
                let at = Vector3::new(
                    0.2 * (1.1 * t + phase.z).sin() + side.x,
                    0.2 * (0.9 * t).sin() + side.y,
                    0.0,
                );
                Isometry3::from_parts(at.into(), UnitQuaternion::from_scaled_axis(swing))
            };
            let kept = lead((&model, &q), frame, &target, &solids, settings());
            assert!(kept.smallest > DISTANCE - MISSED, "{shape}, {name}, {turn}: {kept:?}");
            assert!(
                kept.smallest < DISTANCE + 5e-3,
                "{shape}, {name}, {turn} must come near the minimum distance: {kept:?}"
            );
            assert!(kept.chatter < 2e-3, "{shape}, {name}, {turn}: {kept:?}");
        }
    }
}

#[test]
fn a_turning_plate_keeps_its_distance_from_objects() {
    press("<box size=\"0.3 0.2 0.04\"/>", BaseMode::Fixed);
}

#[test]
fn turning_round_bodies_keep_their_distance_from_objects() {
    for shape in [
        "<cylinder radius=\"0.08\" length=\"0.2\"/>",
        "<capsule radius=\"0.05\" length=\"0.25\"/>",
        "<sphere radius=\"0.1\"/>",
    ] {
        press(shape, BaseMode::Fixed);
    }
}

#[test]
fn a_plate_on_a_floating_base_keeps_its_distance() {
    press("<box size=\"0.3 0.2 0.04\"/>", BaseMode::Floating);
}

#[test]
fn a_panda_keeps_its_distance_from_box_mesh_and_ground() {
    let robot = Robot::new("panda");
    let model = &robot.model;
    let hand = model.frame("panda_hand_tcp").unwrap();
    let home = robot.kinematics.pose(model, hand);
    let options = CollisionOptions { self_collision: false, ..CollisionOptions::default() };
    let into = home.translation.vector + Vector3::new(0.0, 0.32, 0.0);
    for (name, obstacle) in obstacles() {
        let mut solids = CollisionModel::new(model, &options).unwrap();
        let at = Isometry3::from_parts(into.into(), UnitQuaternion::identity());
        solids.add_obstacle("obstacle", at, obstacle, MeshMode::default()).unwrap();
        let target = |t: f64| {
            let swing = Vector3::new(0.4 * (1.5 * t).sin(), 0.3 * (1.1 * t).sin(), 0.5 * t.sin());
            let aside = Vector3::new(0.1 * t.sin(), 0.0, 0.1 * (0.7 * t).sin());
            Isometry3::from_parts(
                (into + aside).into(),
                UnitQuaternion::from_scaled_axis(swing) * home.rotation,
            )
        };
        let kept = lead((model, &robot.q), hand, &target, &solids, settings());
        assert!(kept.smallest > DISTANCE - MISSED && kept.smallest < DISTANCE + 5e-3, "{name}: {kept:?}");
        assert!(kept.chatter < 2e-3, "{name}: {kept:?}");
    }
    let mut solids = CollisionModel::new(model, &options).unwrap();
    solids.add_half_space("ground", Isometry3::translation(0.0, 0.0, 0.0));
    solids.exclude("panda_link0", "ground");
    solids.exclude("panda_link1", "ground");
    solids.exclude("panda_link2", "ground");
    let target = |t: f64| {
        let swing = Vector3::new(0.6 * (1.5 * t).sin(), 0.6 * (1.1 * t).sin(), 0.5 * t.sin());
        let down = Vector3::new(0.1 * t.sin(), 0.1 * (0.7 * t).sin(), -home.translation.vector.z);
        Isometry3::from_parts(
            (home.translation.vector + down).into(),
            UnitQuaternion::from_scaled_axis(swing) * home.rotation,
        )
    };
    let kept = lead((model, &robot.q), hand, &target, &solids, settings());
    assert!(kept.smallest > DISTANCE - MISSED && kept.smallest < DISTANCE + 5e-3, "ground: {kept:?}");
    assert!(kept.chatter < 2e-3, "ground: {kept:?}");
}

#[test]
fn torques_keep_a_plate_at_its_distance_from_a_box_as_it_turns() {
    let model = flying("<box size=\"0.3 0.2 0.04\"/>", BaseMode::Fixed);
    let frame = model.frame("l5").unwrap();
    let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
    let cube = Geometry::Box { size: Vector3::new(0.3, 0.25, 0.2) };
    solids.add_obstacle("obstacle", Isometry3::identity(), cube, MeshMode::default()).unwrap();
    let mut limit = CollisionLimit::new(&model, solids, settings());
    let room = DynamicsRows { limits: limit.rows(), constrained: 0 };
    let settings = InverseDynamicsSettings { torque_fraction: 1e6, relaxation: None, ..Default::default() };
    let mut control = InverseDynamics::with_room(&model, Vec::new(), settings, room);
    let mut reach = CartesianTask::new(&model, frame)
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(10.0));
    let mut posture = PostureTask::new(&model, &[0.0; 6]).feedback(Feedback::critical(5.0)).weight(0.01);
    let (mut q, mut v, mut kinematics) = (vec![0.0; 6], vec![0.0; 6], Kinematics::new(&model));
    q[2] = 0.5;
    let (mut smallest, mut next) = (f64::INFINITY, q.clone());
    for tick in 0..4000 {
        let t = f64::from(tick) * DT;
        let swing = Vector3::new(0.3 * (2.0 * t).sin(), 0.3 * (1.7 * t).sin(), 0.5 * (1.3 * t).sin());
        let at = Vector3::new(0.2 * (1.1 * t).sin(), 0.2 * (0.9 * t).sin(), 0.0);
        reach.set_target(Isometry3::from_parts(at.into(), UnitQuaternion::from_scaled_axis(swing)));
        kinematics.update_with_velocity(&model, &q, &v);
        let state = MotionState { model: &model, kinematics: &kinematics, q: &q, v: &v };
        control.begin(&state, DT);
        control.add_task(&state, 0, &mut reach);
        control.add_task(&state, 0, &mut posture);
        control.add_row_limit(&state, &mut limit, DT);
        let a = control.solve().unwrap().acceleration.clone();
        let middle: Vec<f64> = v.iter().zip(a.iter()).map(|(v, a)| (v + 0.5 * a * DT) * DT).collect();
        model.integrate(&q, &middle, &mut next);
        q.copy_from_slice(&next);
        v.iter_mut().zip(a.iter()).for_each(|(v, a)| *v += a * DT);
        smallest = smallest.min(limit.smallest_distance().unwrap_or(f64::INFINITY));
    }
    assert!(smallest > DISTANCE - MISSED && smallest < DISTANCE + 5e-3, "{smallest}");
}

#[test]
fn a_humanoid_hand_avoids_its_own_links_and_a_crate() {
    let robot = Robot::new("humanoid");
    let model = &robot.model;
    let hand = model.frame("left_palm").unwrap();
    let mut solids = CollisionModel::new(model, &CollisionOptions::default()).unwrap();
    let start = robot.kinematics.pose(model, hand);
    let crate_at = start.translation.vector + Vector3::new(0.35, 0.0, 0.0);
    let side = Geometry::Box { size: Vector3::repeat(0.2) };
    solids.add_obstacle("crate", Isometry3::from(crate_at), side, MeshMode::default()).unwrap();
    let mut near = Collisions::new(&solids);
    near.update(&solids, &robot.kinematics);
    let close: Vec<usize> = near.within(&solids, 0.05).iter().map(|pair| pair.pair).collect();
    let mut index = 0;
    solids.retain_pairs(|_| {
        index += 1;
        !close.contains(&(index - 1))
    });
    let mut limit = CollisionLimit::new(model, solids.clone(), settings());
    for (name, goal) in [("crate", Vector3::new(0.35, 0.0, 0.0)), ("trunk", Vector3::new(0.0, -0.4, 0.0))] {
        let mut reach = CartesianTask::new(model, hand);
        let mut target = start;
        target.translation.vector += goal;
        reach.set_target(target);
        let feet: Vec<_> = robot.feet().iter().map(|foot| foot.frame).collect();
        let mut feet: Vec<_> =
            feet.into_iter().map(|foot| ContactTask::surface(model, foot).weight(10.0)).collect();
        let mut centre = CentreOfMassTask::new(model);
        centre.set_target(robot.kinematics.centre_of_mass(model).position);
        let mut ik = DifferentialIk::with_rows(model, limit.rows());
        let (mut q, mut kinematics) = (robot.q.clone(), robot.kinematics.clone());
        let mut smallest = f64::INFINITY;
        for _ in 0..3000 {
            kinematics.update(model, &q);
            let now = RobotState { model, kinematics: &kinematics, q: &q };
            ik.begin();
            feet.iter_mut().for_each(|foot| ik.add_task(&now, 0, foot));
            ik.add_task(&now, 0, &mut centre);
            ik.add_task(&now, 0, &mut reach);
            ik.add_limit(&now, &PositionLimit::default(), DT);
            ik.add_limit(&now, &VelocityLimit::default(), DT);
            ik.add_row_limit(&now, &mut limit, DT);
            let step: Vec<f64> = ik.solve().unwrap().iter().map(|v| v * DT).collect();
            smallest = smallest.min(limit.smallest_distance().unwrap_or(f64::INFINITY));
            let from = q.clone();
            model.integrate(&from, &step, &mut q);
        }
        assert!(smallest > DISTANCE - MISSED && smallest < DISTANCE + 5e-3, "{name}: {smallest}");
    }
}

#[test]
fn a_plate_too_close_to_walls_returns_slowly() {
    let model = flying("<box size=\"0.3 0.2 0.04\"/>", BaseMode::Fixed);
    let (q, mut kinematics) = (vec![0.0; 6], Kinematics::new(&model));
    kinematics.update(&model, &q);
    let wall =
        |z: f64| (Isometry3::translation(0.0, 0.0, z), Geometry::Box { size: Vector3::new(1.0, 1.0, 0.1) });
    // gaps of 0.01 m, where 0.03 m are required
    let between = |walls: &[f64], torques: bool| {
        let mut solids = CollisionModel::new(&model, &CollisionOptions::default()).unwrap();
        for z in walls {
            let (at, wall) = wall(*z);
            solids.add_obstacle("wall", at, wall, MeshMode::default()).unwrap();
        }
        let mut limit = CollisionLimit::new(&model, solids, settings());
        if torques {
            let room = DynamicsRows { limits: limit.rows(), constrained: 0 };
            let settings =
                InverseDynamicsSettings { torque_fraction: 1e6, relaxation: None, ..Default::default() };
            let mut control = InverseDynamics::with_room(&model, Vec::new(), settings, room);
            let still = vec![0.0; 6];
            kinematics_at_rest(&model, &q, |state| {
                control.begin(state, DT);
                control.add_task(
                    state,
                    0,
                    &mut PostureTask::new(&model, &still).feedback(Feedback::critical(5.0)).weight(1.0),
                );
                control.add_row_limit(state, &mut limit, DT);
                control.solve().unwrap().acceleration[2] * DT
            })
        } else {
            let state = RobotState { model: &model, kinematics: &kinematics, q: &q };
            let mut ik = DifferentialIk::with_rows(&model, limit.rows());
            ik.begin();
            ik.add_row_limit(&state, &mut limit, DT);
            ik.solve().unwrap()[2]
        }
    };
    for torques in [false, true] {
        assert!(between(&[-0.08, 0.08], torques).abs() < 1e-9, "squeezed, torques {torques}");
        let back = between(&[-0.08], torques);
        assert!((back - 0.01).abs() < 1e-6, "torques {torques}: {back} m/s");
    }
}

/// Calls `solve` with the robot at rest.
fn kinematics_at_rest(model: &Model, q: &[f64], solve: impl FnOnce(&MotionState<'_>) -> f64) -> f64 {
    let (v, mut kinematics) = (vec![0.0; model.nv()], Kinematics::new(model));
    kinematics.update_with_velocity(model, q, &v);
    solve(&MotionState { model, kinematics: &kinematics, q, v: &v })
}

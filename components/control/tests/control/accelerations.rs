//! Acceleration limits of joints under velocity control.

use motorium::prelude::*;
use motorium::testing::Probe;
use motorium_control::{
    DifferentialIk, RobotState, SetpointIntegrator,
    limits::{AccelerationLimit, CollisionLimit, CollisionSettings, PositionLimit, RowLimit, VelocityLimit},
    tasks::{PostureSettings, PostureTask},
};
use motorium_robots::{CollisionModel, CollisionOptions, Collisions, Geometry, Kinematics, MeshMode};
use nalgebra::{DVector, Isometry3};

use crate::component::number;
use crate::graph::{Targets, controller, graph, run};
use crate::robot::{Panda, Random};

const DT: f64 = 1e-3;

/// Moves the Panda towards postures for 1.5 s each, and calls `check` with the velocities of the previous and
/// the current tick.
fn move_to(
    panda: &Panda,
    postures: &[Vec<f64>],
    limit: &AccelerationLimit,
    solids: Option<&CollisionModel>,
    mut check: impl FnMut(&[f64], &[f64], &[f64], bool),
) {
    let model = &panda.model;
    let mut apart = solids.map(|solids| {
        CollisionLimit::new(model, solids.clone(), CollisionSettings { distance: 0.03, ..Default::default() })
    });
    let mut ik = DifferentialIk::with_rows(model, apart.as_ref().map_or(0, RowLimit::rows));
    let mut setpoint = SetpointIntegrator::new(model, panda.home.as_slice());
    let mut kinematics = Kinematics::new(model);
    for posture in postures {
        let firm = PostureSettings { gain: 30.0, weight: 1.0 };
        let mut task = PostureTask::new(model, posture).with(firm);
        for _ in 0..1500 {
            kinematics.update(model, setpoint.position());
            let state = RobotState { model, kinematics: &kinematics, q: setpoint.position() };
            ik.begin();
            ik.add_task(&state, 0, &mut task);
            ik.add_limit(&state, &PositionLimit::default(), DT);
            ik.add_limit(&state, &VelocityLimit::default(), DT);
            ik.add_acceleration_limit(&state, limit, setpoint.velocity(), DT);
            if let Some(apart) = &mut apart {
                ik.add_row_limit(&state, apart, DT);
            }
            let before = setpoint.velocity().to_vec();
            let v = ik.solve().unwrap().to_vec();
            setpoint.integrate(&v, DT);
            check(&before, &v, setpoint.position(), ik.exceeds_acceleration());
        }
    }
}

#[test]
fn no_joint_exceeds_its_acceleration_even_at_its_limits() {
    let panda = Panda::new();
    let (model, mut random) = (&panda.model, Random(5));
    for most in [2.0, 15.0] {
        let limit = AccelerationLimit::new(model, DVector::repeat(8, most), PositionLimit::default());
        // far beyond the limits of the joints, and back
        let postures: Vec<Vec<f64>> = (0..8).map(|_| (0..8).map(|_| random.within(6.0)).collect()).collect();
        let (mut largest, mut fastest, mut nearest) = (0.0_f64, 0.0_f64, f64::INFINITY);
        move_to(&panda, &postures, &limit, None, |before, v, q, exceeds| {
            assert!(!exceeds);
            for joint in 0..8 {
                largest = largest.max((v[joint] - before[joint]).abs() / DT);
                fastest = fastest.max(v[joint].abs() / model.velocity_limit()[joint]);
                let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
                nearest = nearest.min((q[joint] - lower).min(upper - q[joint]));
            }
        });
        assert!(largest <= most * (1.0 + 1e-3), "{largest} of {most} rad/s2");
        assert!(largest > 0.99 * most, "the limit is used: {largest} of {most} rad/s2");
        assert!((-1e-12..1e-3).contains(&nearest), "limits are reached and kept: {nearest} rad");
        assert!(fastest <= 1.0 + 1e-12, "{fastest}");
    }
}

#[test]
fn joints_without_acceleration_limit_are_not_slowed() {
    let panda = Panda::new();
    let posture: Vec<f64> = panda.home.iter().map(|q| q + 0.2).collect();
    let mut most = DVector::repeat(8, 1.0);
    most[3] = f64::INFINITY;
    let limit = AccelerationLimit::new(&panda.model, most, PositionLimit::default());
    let mut first = None;
    move_to(&panda, &[posture], &limit, None, |_, v, _, _| _ = first.get_or_insert_with(|| v.to_vec()));
    let first = first.unwrap();
    assert!(first[3] > 2.0 && (first[0] - 1e-3).abs() < 1e-9, "{first:?}");
}

/// Ground below the hand but not below its supporting links. Only pairs with a link whose name contains one
/// of these words are checked.
fn ground_below(panda: &Panda, words: &[&str]) -> CollisionModel {
    let options = CollisionOptions { self_collision: false, ..CollisionOptions::default() };
    let mut solids = CollisionModel::new(&panda.model, &options).unwrap();
    solids.add_half_space("ground", Isometry3::translation(0.0, 0.0, 0.3));
    let counts =
        |pair| solids.pair_links(pair).iter().any(|link| words.iter().any(|word| link.contains(word)));
    let pairs: Vec<bool> = (0..solids.pairs().len()).map(counts).collect();
    let mut index = 0;
    solids.retain_pairs(|_| {
        index += 1;
        pairs[index - 1]
    });
    solids
}

#[test]
fn distances_may_brake_joints_harder_but_not_accelerate() {
    let panda = Panda::new();
    let most = 1.0;
    let limit = AccelerationLimit::new(&panda.model, DVector::repeat(8, most), PositionLimit::default());
    for words in [&["hand", "finger"][..], &["hand"]] {
        let solids = ground_below(&panda, words);
        // down, turning about the axis of the hand and opening the gripper at full speed
        let mut down = panda.home.clone();
        down[1] += 1.0;
        down[6] += 1.0;
        down[7] = panda.model.upper()[7];
        let mut kinematics = Kinematics::new(&panda.model);
        let mut measure = Collisions::new(&solids);
        let (mut smallest, mut given_up, mut steps) = (f64::INFINITY, 0, 0);
        let (mut speeding_up, mut apart) = (0.0_f64, 0.0_f64);
        move_to(&panda, &[down.as_slice().to_vec()], &limit, Some(&solids), |before, v, q, exceeds| {
            kinematics.update(&panda.model, q);
            measure.update(&solids, &kinematics);
            smallest = smallest.min(measure.nearest(&solids).unwrap().distance);
            given_up += usize::from(exceeds);
            steps += 1;
            for (now, before) in v.iter().zip(before) {
                speeding_up = speeding_up.max((now.abs() - before.abs()) / DT);
            }
            // the fingers are not involved in the distances of the hand
            apart = apart.max((v[7] - before[7]).abs() / DT);
        });
        assert!(smallest > 0.03 - 1e-4 && smallest < 0.04, "{smallest}");
        assert!(given_up > 0 && given_up < steps / 2, "{given_up} of {steps}");
        assert!(speeding_up <= most * (1.0 + 1e-3), "{speeding_up} of {most} rad/s2");
        assert!(words.len() > 1 || apart <= most * (1.0 + 1e-3), "{apart} of {most} m/s2");
    }
}

/// A table below the fingers at a distance of `distance`.
fn table_below(panda: &Panda, distance: f64) -> CollisionModel {
    let options = CollisionOptions { self_collision: false, ..CollisionOptions::default() };
    let with = |height: f64| {
        let mut solids = CollisionModel::new(&panda.model, &options).unwrap();
        let at = panda.hand_at(panda.home.as_slice()).translation.vector;
        let table = Geometry::Box { size: nalgebra::Vector3::new(0.4, 0.4, 0.1) };
        let at = Isometry3::translation(at.x, at.y, height - 0.05);
        solids.add_obstacle("table", at, table, MeshMode::default()).unwrap();
        solids
    };
    let far = with(0.0);
    let (mut kinematics, mut measure) = (Kinematics::new(&panda.model), Collisions::new(&far));
    kinematics.update(&panda.model, panda.home.as_slice());
    measure.update(&far, &kinematics);
    with(measure.nearest(&far).unwrap().distance - distance)
}

#[test]
fn a_hand_close_to_a_table_returns_at_joint_acceleration() {
    let panda = Panda::new();
    let mut down = panda.home.clone();
    down[1] += 0.3;
    let postures = |posture: &DVector<f64>| vec![posture.as_slice().to_vec(); 4];
    for most in [20.0, 0.5, 0.05] {
        let limit = AccelerationLimit::new(&panda.model, DVector::repeat(8, most), PositionLimit::default());
        // the hand is to stay in place, or presses on the table
        for posture in [&panda.home, &down] {
            let solids = table_below(&panda, 0.01);
            let (mut kinematics, mut measure) = (Kinematics::new(&panda.model), Collisions::new(&solids));
            let (mut distances, mut largest) = (Vec::new(), 0.0_f64);
            move_to(&panda, &postures(posture), &limit, Some(&solids), |before, v, q, exceeds| {
                assert!(!exceeds, "{most}");
                kinematics.update(&panda.model, q);
                measure.update(&solids, &kinematics);
                distances.push(measure.nearest(&solids).unwrap().distance);
                let changes = v.iter().zip(before).map(|(v, before)| (v - before).abs() / DT);
                largest = changes.fold(largest, f64::max);
            });
            assert!(largest <= most * (1.0 + 1e-3), "{largest} of {most}");
            let (last, fastest) = (distances[distances.len() - 1], distances.windows(2));
            let fastest = fastest.map(|pair| (pair[1] - pair[0]) / DT).fold(0.0, f64::max);
            assert!(last > 0.03 - 1e-4, "{most}: must return: {last}");
            assert!(fastest < 0.0105, "{most}: returns no faster than required: {fastest}");
            let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.01 - 1e-4, "{most}: {nearest}");
        }
    }
}

#[test]
fn a_controller_uses_the_accelerations_of_the_profile() {
    let with = |limits: &str| {
        let probe = Probe::<JointCommand>::for_topic("panda/joint_command").triggered();
        let graph = graph("{}", Targets::default(), controller(&format!("{{ {limits} }}"))).with(&probe);
        (run(graph), probe.values())
    };
    let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
    let profile = panda.profile.unwrap().acceleration_limit(&panda.model).unwrap();
    // largest fraction that any joint uses of its profile acceleration
    let used = |commands: &[JointCommand]| {
        let changes = commands.windows(2).flat_map(|pair| {
            let velocities = pair[0].velocity().iter().zip(pair[1].velocity());
            velocities.zip(profile.iter()).map(|((before, now), most)| (now - before).abs() / DT / most)
        });
        changes.fold(0.0, f64::max)
    };
    let (_, free) = with("");
    assert!(used(&free) > 0.2, "faster without a limit: {}", used(&free));
    for fraction in [1.0, 0.1] {
        let (report, commands) = with(&format!("limits = {{ acceleration = {{ fraction = {fraction} }} }}"));
        let result = &report.results["controller"];
        assert_eq!(result["solver"]["steps_beyond_acceleration"], 0, "{result}");
        assert!(used(&commands) <= fraction * (1.0 + 1e-3), "{} of {fraction}", used(&commands));
        assert!(fraction == 1.0 || used(&commands) > 0.99 * fraction, "{} of {fraction}", used(&commands));
        // with a tenth of the accelerations the hand arrives late
        assert!(fraction < 1.0 || number(&result["position_error_m"]) < 1e-4, "{result}");
        let component = report.components.iter().find(|component| component.name == "controller").unwrap();
        assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    }
}

#[test]
fn invalid_acceleration_limits_are_refused() {
    let refused = |config: &str, words: &[&str]| {
        let error = graph("{}", Targets::default(), controller(config))
            .check()
            .expect_err("the configuration must be refused");
        let error = error.render(false);
        assert!(words.iter().all(|word| error.contains(word)), "{error}");
    };
    refused(
        "{ limits = { acceleration = { most = 0.0 } } }",
        &["limits.acceleration.most", "at least 0.000001"],
    );
    refused(
        "{ limits = { acceleration = { most = [1.0, 2.0] } } }",
        &["limits.acceleration.most", "panda_joint1"],
    );
    refused("{ limits = { acceleration = { fraction = 2.0 } } }", &["limits.acceleration.fraction"]);
    refused(
        "{ inverse_dynamics = {}, limits = { acceleration = {} } }",
        &["limits.acceleration", "inverse_dynamics.max_acceleration"],
    );
}

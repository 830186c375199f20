//! The planner of `control.mpc` in the library: footholds do not depend on the heading, forces are those of the step that begins.

use std::path::Path;

use motorium_control::inverse_dynamics::MotionState;
use motorium_control::mpc::{
    Gait, GroundModel, Landing, LegPlanner, MpcSettings, PlanarVelocity, PlannedFoot, PlannerSettings,
    Stepping,
};
use motorium_robots::{Kinematics, Loaded, load};
use nalgebra::{Rotation3, UnitQuaternion, Vector2, Vector3};

const FEET: [&str; 4] = ["front_left", "front_right", "hind_left", "hind_right"];

fn quadruped() -> Loaded {
    load("quadruped", Path::new(".")).unwrap()
}

/// The quadruped at home, turned about the vertical.
fn turned(robot: &Loaded, heading: f64) -> Vec<f64> {
    let home = robot.profile.as_ref().unwrap().configuration(&robot.model, "standing").unwrap();
    let mut q = home.as_slice().to_vec();
    let base = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
    let base = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading) * base;
    q[3..7].copy_from_slice(base.coords.as_slice());
    q
}

/// A planner of a trot, which was made for the robot at `rest`.
fn planner(robot: &Loaded, rest: &[f64], step: f64) -> LegPlanner {
    let feet = &robot.profile.as_ref().unwrap().feet;
    let feet = FEET.map(|name| PlannedFoot {
        frame: robot.model.frame(&feet[name].frame).unwrap(),
        points: vec![Vector3::zeros()],
        radius: 0.0,
        friction: 0.6,
    });
    let stepping = Stepping::new(Gait::new(0.4, 0.5, vec![0.0, 0.5, 0.5, 0.0]).unwrap());
    let settings = PlannerSettings {
        mpc: MpcSettings { steps: 8, step, ..MpcSettings::default() },
        solve_every: 0.0,
        acceleration: 2.0,
        height: None,
        max_lead: 0.2,
        max_turn: 0.5,
        clearance: 0.05,
        max_capture: 0.1,
        ramp: 0.02,
        ground: GroundModel::Level,
        landing: Landing::default(),
    };
    LegPlanner::new(&robot.model, feet.to_vec(), stepping, settings, rest)
}

/// Plans `count` steps of `dt` seconds for a robot that does not move, and wants to go ahead.
fn plan(robot: &Loaded, planner: &mut LegPlanner, q: &[f64], (dt, count): (f64, usize)) {
    let v = vec![0.0; robot.model.nv()];
    let mut kinematics = Kinematics::new(&robot.model);
    kinematics.update_with_acceleration(&robot.model, q, &v, &v);
    let state = MotionState { model: &robot.model, kinematics: &kinematics, q, v: &v };
    planner.begin(&state);
    let ahead = PlanarVelocity { linear: Vector2::new(0.4, 0.0), yaw_rate: 0.0 };
    for _ in 0..count {
        planner.step(&state, &ahead, true, dt).unwrap();
    }
}

#[test]
fn footholds_are_the_same_from_the_robot_in_whatever_heading_it_starts() {
    let robot = quadruped();
    let targets = |heading: f64| {
        let q = turned(&robot, heading);
        let mut planner = planner(&robot, &q, 0.03);
        plan(&robot, &mut planner, &q, (0.005, 70));
        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -heading);
        let from_base =
            |foot| back * (planner.target(foot).0.translation.vector - Vector3::new(q[0], q[1], 0.0));
        [0, 1, 2, 3].map(from_base)
    };
    let straight = targets(0.0);
    for heading in [0.5, std::f64::consts::FRAC_PI_2, -2.5] {
        for (foot, target) in targets(heading).iter().enumerate() {
            assert!((target - straight[foot]).norm() < 1e-6, "{heading} rad: {target} {}", straight[foot]);
        }
    }
}

#[test]
fn the_force_of_a_step_as_long_as_one_of_the_horizon_is_that_of_its_first() {
    let robot = quadruped();
    let q = turned(&robot, 0.0);
    let mut planner = planner(&robot, &q, 0.03);
    // Now the contacts change in the second step of the horizon.
    plan(&robot, &mut planner, &q, (0.03, 7));
    let standing: Vec<usize> = (0..4).filter(|foot| planner.load(*foot) > 0.0).collect();
    assert_eq!(standing.len(), 2);
    for foot in standing {
        let first = planner.mpc().force(0, foot);
        assert!(first.z > 1.0 && (planner.wrench(foot).linear - first).norm() < 1e-12, "{first}");
        assert!(
            (planner.mpc().force(1, foot) - first).norm() > 1.0,
            "the steps differ, or this tests nothing"
        );
    }
}

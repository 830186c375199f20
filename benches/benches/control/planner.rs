//! A cycle of the model-predictive planner of a quadruped in a trot: model, footholds, horizon, solution.

use std::path::Path;

use motorium_control::inverse_dynamics::{Contact, MotionState};
use motorium_locomotion::mpc::{
    Gait, GroundModel, Landing, LegPlanner, MpcSettings, PlanarVelocity, PlannedFoot, PlannerSettings,
    Stepping,
};
use motorium_robots::{Kinematics, load};
use nalgebra::{Vector2, Vector3};

/// Time of a cycle, s.
const DT: f64 = 0.005;

/// Returns a cycle of a quadruped that moves ahead at 0.3 m/s and plans ten steps of 30 ms at each state.
pub(crate) fn trot() -> impl FnMut() {
    let robot = load("quadruped", Path::new(".")).expect("of the catalogue");
    let (model, profile) = (robot.model, robot.profile.expect("of the catalogue"));
    let home = profile.configuration(&model, &profile.home).expect("a home pose");
    let foot = |name: &str| {
        let contact = Contact::of_foot(&model, name, &profile.feet[name]).expect("a foot");
        let radius = profile.feet[name].radius.unwrap_or(0.0);
        PlannedFoot {
            frame: contact.frame,
            points: vec![Vector3::zeros()],
            radius,
            friction: contact.friction,
        }
    };
    let feet = ["front_left", "front_right", "hind_left", "hind_right"].map(foot).to_vec();
    let gait = Gait::new(0.36, 0.55, vec![0.0, 0.5, 0.5, 0.0]).expect("a gait");
    let settings = PlannerSettings {
        mpc: MpcSettings {
            steps: 10,
            step: 0.03,
            max_force: 2.0 * 9.81 * model.mass(),
            ..MpcSettings::default()
        },
        solve_every: 0.0,
        acceleration: 1.0,
        height: None,
        max_lead: 0.05,
        max_turn: 0.3,
        clearance: 0.05,
        max_capture: 0.1,
        ramp: 0.01,
        ground: GroundModel::Fitted { smoothing: 0.2 },
        landing: Landing::default(),
    };
    let mut planner = LegPlanner::new(&model, feet, Stepping::new(gait), settings, home.as_slice());
    let mut kinematics = Kinematics::new(&model);
    let (mut q, mut v) = (home.as_slice().to_vec(), vec![0.0; model.nv()]);
    v[0] = 0.3;
    let wanted = PlanarVelocity { linear: Vector2::new(0.3, 0.0), yaw_rate: 0.0 };
    let mut begun = false;
    move || {
        q[0] += v[0] * DT;
        kinematics.update_with_velocity(&model, &q, &v);
        let state = MotionState { model: &model, kinematics: &kinematics, q: &q, v: &v };
        if !std::mem::replace(&mut begun, true) {
            planner.begin(&state);
        }
        planner.step(&state, &wanted, true, DT).expect("no force at all is a solution");
        std::hint::black_box(planner.wrench(0));
    }
}

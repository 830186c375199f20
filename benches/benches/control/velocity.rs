//! Velocity-level cycles: kinematics, tasks, limits, solution, and the commanded step.

use std::path::Path;

use motorium_control::{
    DifferentialIk, RobotState,
    limits::{PositionLimit, VelocityLimit},
    tasks::{
        CartesianSettings, CartesianTask, CentreOfMassTask, ContactTask, PostureSettings, PostureTask,
        VelocityTask,
    },
};
use motorium_robots::{Kinematics, Model, load};
use nalgebra::{Isometry3, Vector3};

use crate::bipeds::Biped;

const DT: f64 = 0.001;
/// Offsets of the hand's goal from its initial position, one second each \[m\]. The Panda's goals are
/// sometimes out of reach.
const PANDA_GOALS: [[f64; 3]; 4] = [[0.1, 0.2, 0.1], [-0.1, -0.3, 0.2], [0.6, 0.0, 0.5], [0.0, 0.3, -0.3]];
const BIPED_GOALS: [[f64; 3]; 4] = [[0.1, 0.0, 0.15], [0.05, 0.1, 0.0], [0.1, 0.1, 0.2], [0.0, -0.05, 0.1]];

/// A robot whose joints follow their commands exactly, and its limits.
struct Robot {
    model: Model,
    kinematics: Kinematics,
    q: Vec<f64>,
    next: Vec<f64>,
    step: Vec<f64>,
    tick: usize,
}

impl Robot {
    fn new(model: &Model, q: &[f64]) -> Self {
        let mut kinematics = Kinematics::new(model);
        kinematics.update(model, q);
        let (model, next, step) = (model.clone(), q.to_vec(), vec![0.0; model.nv()]);
        Self { model, kinematics, q: q.to_vec(), next, step, tick: 0 }
    }

    fn integrate(&mut self, velocity: &[f64]) {
        self.step.iter_mut().zip(velocity).for_each(|(step, v)| *step = v * DT);
        self.model.integrate(&self.q, &self.step, &mut self.next);
        std::mem::swap(&mut self.q, &mut self.next);
    }
}

fn moved(start: &Isometry3<f64>, goals: &[[f64; 3]], tick: usize) -> Isometry3<f64> {
    let offset = Vector3::from(goals[tick / 1000 % goals.len()]);
    Isometry3::from_parts((start.translation.vector + offset).into(), start.rotation)
}

/// Returns a cycle of a Panda whose hand tracks goals, with the posture in the same sum or, if `hard`, a
/// level below.
pub(crate) fn panda(hard: bool) -> impl FnMut() {
    let panda = load("panda", Path::new(".")).expect("it is in the catalogue");
    let (model, profile) = (panda.model, panda.profile.expect("it has a profile"));
    let home = profile.home(&model).expect("it has a home");
    let mut robot = Robot::new(&model, home.as_slice());
    let mut hand = CartesianTask::new(&model, model.frame("panda_hand_tcp").expect("it has a hand"));
    let start = robot.kinematics.pose(&model, hand.frame());
    let mut posture = PostureTask::new(&model, home.as_slice());
    if hard {
        posture.set_settings(PostureSettings { gain: 2.0, weight: 1.0 });
    }
    let ik = DifferentialIk::new(&model);
    let mut ik = if hard { ik.levels(&[hand.rows(), posture.rows()]) } else { ik };
    let (position, velocity) = (PositionLimit::default(), VelocityLimit::default());
    move || {
        hand.set_target(moved(&start, &PANDA_GOALS, robot.tick));
        robot.tick += 1;
        robot.kinematics.update(&robot.model, &robot.q);
        let state = RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q };
        ik.begin();
        ik.add_task(&state, 0, &mut hand);
        ik.add_task(&state, usize::from(hard), &mut posture);
        ik.add_limit(&state, &position, DT);
        ik.add_limit(&state, &velocity, DT);
        robot.integrate(ik.solve().expect("limits admit rest"));
    }
}

/// Returns a cycle of a humanoid with fixed feet, a moving centre of mass, and a hand that follows goals.
pub(crate) fn on_held_feet(biped: &Biped) -> impl FnMut() + use<> {
    let model = &biped.model;
    let mut robot = Robot::new(model, &biped.q);
    let mut feet = biped.feet.map(|foot| ContactTask::surface(model, foot));
    let mut centre = CentreOfMassTask::new(model);
    let place = robot.kinematics.centre_of_mass(model).position;
    centre.set_target(place + Vector3::new(0.01, 0.02, -0.02));
    let mut hand = CartesianTask::new(model, biped.hands[0]);
    let start = robot.kinematics.pose(model, biped.hands[0]);
    let mut posture = PostureTask::new(model, model.joints_of_q(&biped.q));
    posture.set_settings(PostureSettings { gain: 1.0, weight: 1e-2 });
    let mut ik = DifferentialIk::with_contacts(model, 12, 0);
    let (position, velocity) = (PositionLimit::default(), VelocityLimit::default());
    move || {
        hand.set_target(moved(&start, &BIPED_GOALS, robot.tick));
        robot.tick += 1;
        robot.kinematics.update(&robot.model, &robot.q);
        let state = RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q };
        ik.begin();
        feet.iter_mut().for_each(|foot| ik.hold(&state, foot));
        let tasks: [&mut dyn VelocityTask; 3] = [&mut centre, &mut hand, &mut posture];
        tasks.into_iter().for_each(|task| ik.add_task(&state, 0, task));
        ik.add_limit(&state, &position, DT);
        ik.add_limit(&state, &velocity, DT);
        robot.integrate(ik.solve().expect("limits admit rest"));
    }
}

/// Returns a cycle of a humanoid with four levels: feet, centre of mass, both hands, posture.
pub(crate) fn in_four_levels(biped: &Biped) -> impl FnMut() + use<> {
    let model = &biped.model;
    let mut robot = Robot::new(model, &biped.q);
    let mut feet = biped.feet.map(|foot| ContactTask::surface(model, foot));
    let mut centre = CentreOfMassTask::new(model);
    let place = robot.kinematics.centre_of_mass(model).position;
    centre.set_target(place + Vector3::new(0.01, 0.02, -0.02));
    let slow =
        CartesianSettings { max_linear_speed: 0.2, max_angular_speed: 1.0, ..CartesianSettings::default() };
    let mut hands = biped.hands.map(|hand| {
        let mut task = CartesianTask::new(model, hand);
        task.set_settings(slow);
        task
    });
    let starts = biped.hands.map(|hand| robot.kinematics.pose(model, hand));
    let mut posture = PostureTask::new(model, model.joints_of_q(&biped.q));
    posture.set_settings(PostureSettings { gain: 1.0, weight: 1.0 });
    let mut ik = DifferentialIk::new(model).levels(&[12, centre.rows(), 12, posture.rows()]);
    let (position, velocity) = (PositionLimit::default(), VelocityLimit::default());
    move || {
        for (hand, start) in hands.iter_mut().zip(&starts) {
            hand.set_target(moved(start, &BIPED_GOALS, robot.tick));
        }
        robot.tick += 1;
        robot.kinematics.update(&robot.model, &robot.q);
        let state = RobotState { model: &robot.model, kinematics: &robot.kinematics, q: &robot.q };
        ik.begin();
        feet.iter_mut().for_each(|foot| ik.add_task(&state, 0, foot));
        ik.add_task(&state, 1, &mut centre);
        hands.iter_mut().for_each(|hand| ik.add_task(&state, 2, hand));
        ik.add_task(&state, 3, &mut posture);
        ik.add_limit(&state, &position, DT);
        ik.add_limit(&state, &velocity, DT);
        robot.integrate(ik.solve().expect("limits admit rest"));
    }
}

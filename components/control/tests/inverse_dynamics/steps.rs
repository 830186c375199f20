//! Iterations of the ticks in which a humanoid lifts a foot and sets it down again, at the same place or
//! while falling.

use motorium_control::inverse_dynamics::{
    AccelerationTask, Contact, InverseDynamics, InverseDynamicsError, InverseDynamicsSettings, MotionState,
};
use motorium_control::tasks::Feedback;
use motorium_control::tasks::{
    CartesianSettings, CartesianTask, CentreOfMassTask, MomentumTask, PostureTask,
};
use motorium_qp::SolveError;
use motorium_robots::{Kinematics, load};
use nalgebra::Vector3;

const DT: f64 = 0.001;

/// Iterations of each tick over six seconds, and whether the tick was relaxed. The humanoid leans over its
/// left foot within a second, lifts the right foot from 2.1 s to 3 s, and leans back from 3.5 s on. If
/// `is_led`, a task moves the right foot up and down at the same place. Otherwise it would be set down nearer
/// to the other foot, and the humanoid would fall.
fn step(is_led: bool) -> Vec<(u32, bool)> {
    let loaded = load("humanoid", std::path::Path::new(".")).unwrap();
    let (model, profile) = (&loaded.model, loaded.profile.unwrap());
    let feet = profile.feet.iter().map(|(name, foot)| Contact::of_foot(model, name, foot).unwrap());
    let mut control = InverseDynamics::new(model, feet.collect());
    let mut q = profile.configuration(model, "standing").unwrap().as_slice().to_vec();
    let mut v = vec![0.0; model.nv()];
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, &q);
    let start = kinematics.centre_of_mass(model).position;
    let frame = |name: &str| model.frame(name).unwrap();
    let above = kinematics.pose(model, frame("left_sole")).translation.vector;
    let mut hand = CartesianTask::new(model, frame("left_palm"))
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(8.0));
    let mut goal = kinematics.pose(model, frame("left_palm"));
    goal.translation.vector += Vector3::new(0.1, 0.0, 0.15);
    hand.set_target(goal);
    let mut foot = CartesianTask::new(model, frame("right_sole"))
        .with(CartesianSettings::geometric())
        .feedback(Feedback::critical(20.0));
    let ground = kinematics.pose(model, frame("right_sole"));
    let mut posture =
        PostureTask::new(model, model.joints_of_q(&q)).feedback(Feedback::critical(4.0)).weight(0.1);
    let mut centre = CentreOfMassTask::new(model).feedback(Feedback::critical(4.0)).weight(10.0);
    let mut momentum = MomentumTask::angular(model).rate(5.0).weights(0.0, 0.2);
    let weight = 9.81 * model.mass();
    let smooth = |t: f64| {
        let t = t.clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let decide = |tick: i32| {
        let t = f64::from(tick) * DT;
        let lean = smooth(t) - smooth(t - 3.5);
        let load = (1.0 - 10.0 * (t - 2.0)).clamp(0.0, 1.0) + (10.0 * (t - 3.0)).clamp(0.0, 1.0);
        kinematics.update_with_velocity(model, &q, &v);
        let state = MotionState { model, kinematics: &kinematics, q: &q, v: &v };
        centre.set_target(start + lean * Vector3::new(above.x - start.x, above.y - start.y, -0.02));
        let mut up = ground;
        up.translation.vector.z += 0.05 * (smooth(4.0 * (t - 2.1)) - smooth(4.0 * (t - 2.7)));
        foot.set_target(up);
        control.set_active(1, load > 0.0);
        control.set_max_force(1, if load < 1.0 { load * 0.5 * weight } else { f64::INFINITY });
        control.begin(&state, DT);
        let tasks: [&mut dyn AccelerationTask; 4] = [&mut centre, &mut posture, &mut momentum, &mut hand];
        for task in tasks {
            control.add_task(&state, 0, task);
        }
        if is_led && load == 0.0 {
            control.add_task(&state, 0, &mut foot);
        }
        let solution = control.solve().expect("each tick has a solution");
        let a = &solution.acceleration;
        let step: Vec<f64> = v.iter().zip(a.iter()).map(|(v, a)| (v + 0.5 * a * DT) * DT).collect();
        let from = q.clone();
        model.integrate(&from, &step, &mut q);
        v.iter_mut().zip(a.iter()).for_each(|(v, a)| *v += a * DT);
        (solution.iterations, solution.slack.is_some())
    };
    (0..6000).map(decide).collect()
}

#[test]
fn a_foot_set_down_in_place_needs_few_iterations() {
    let ticks = step(true);
    let most = ticks.iter().map(|(iterations, _)| *iterations).max().unwrap();
    let relaxed = ticks.iter().filter(|(_, relaxed)| *relaxed).count();
    println!("at most {most} iterations, {relaxed} ticks relaxed");
    assert!(most < 20 && relaxed == 0, "{most} iterations, {relaxed} relaxed");
}

#[test]
fn a_falling_humanoid_is_reported_with_bounded_work() {
    let ticks = step(false);
    let mut most: Vec<u32> = ticks.iter().map(|(iterations, _)| *iterations).collect();
    most.sort_unstable_by(|a, b| b.cmp(a));
    let relaxed = ticks.iter().filter(|(_, relaxed)| *relaxed).count();
    println!("{relaxed} ticks relaxed, most iterations {:?}", &most[..20]);
    // no motion keeps both feet at rest while it falls
    assert!(relaxed > 300, "{relaxed}");
    assert!(most[0] < 120, "{:?}", &most[..20]);
    assert!(most[relaxed / 10] < 50, "{}", most[relaxed / 10]);
}

#[test]
fn an_iteration_limit_is_reported_and_later_ticks_recover() {
    let loaded = load("humanoid", std::path::Path::new(".")).unwrap();
    let (model, profile) = (&loaded.model, loaded.profile.unwrap());
    let feet = profile.feet.iter().map(|(name, foot)| Contact::of_foot(model, name, foot).unwrap());
    let settings =
        InverseDynamicsSettings { max_iterations: 5, relaxation: None, ..InverseDynamicsSettings::default() };
    let mut control = InverseDynamics::with_settings(model, feet.collect(), settings);
    let q = profile.configuration(model, "standing").unwrap();
    let (q, v) = (q.as_slice(), vec![0.0; model.nv()]);
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, q, &v);
    let state = MotionState { model, kinematics: &kinematics, q, v: &v };
    let mut centre = CentreOfMassTask::new(model).feedback(Feedback::critical(10.0)).weight(10.0);
    let mut target = kinematics.centre_of_mass(model).position;
    target.y += 0.2;
    centre.set_target(target);
    let mut decide = || {
        control.begin(&state, DT);
        control.add_task(&state, 0, &mut centre);
        control.solve().map(|solution| solution.iterations)
    };
    let first = decide().unwrap_err();
    assert_eq!(first, InverseDynamicsError::Solve(SolveError::MaxIterations { iterations: 5 }));
    let later = (0..50).map(|_| decide()).find(Result::is_ok);
    assert!(
        later.is_some_and(|iterations| iterations.unwrap() <= 5),
        "the working set is kept from tick to tick"
    );
}

#[test]
fn each_tick_starts_from_the_previous_active_set() {
    let loaded = load("humanoid", std::path::Path::new(".")).unwrap();
    let (model, profile) = (&loaded.model, loaded.profile.unwrap());
    let q = profile.configuration(model, "standing").unwrap();
    let feet = profile.feet.iter().map(|(name, foot)| Contact::of_foot(model, name, foot).unwrap());
    let mut control = InverseDynamics::new(model, feet.collect());
    let (q, v) = (q.as_slice(), vec![0.0; model.nv()]);
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, q, &v);
    let state = MotionState { model, kinematics: &kinematics, q, v: &v };
    let mut centre = CentreOfMassTask::new(model).feedback(Feedback::critical(4.0)).weight(10.0);
    let mut posture =
        PostureTask::new(model, model.joints_of_q(q)).feedback(Feedback::critical(4.0)).weight(0.1);
    let mut target = kinematics.centre_of_mass(model).position;
    target.y += 0.1;
    centre.set_target(target);
    let mut decide = |lifted: bool| {
        control.set_active(1, !lifted);
        control.begin(&state, 1e-3);
        control.add_task(&state, 0, &mut centre);
        control.add_task(&state, 0, &mut posture);
        control.solve().unwrap().iterations
    };
    decide(false);
    assert_eq!(decide(false), 0, "on both feet");
    let change = decide(true);
    assert!(change < 20, "{change} iterations as the foot is lifted");
    assert_eq!(decide(true), 0, "on one foot");
}

//! The safe state of an arm whose controller commands nothing, because its constraints contradict each other.

use std::time::Duration;

use motorium::graph::{self, Machine, Override};
use motorium::launcher::Options;
use motorium::prelude::*;
use motorium::session::Session;
use motorium_robots::{Dynamics, Kinematics, Model};

use crate::support::workspace;

const MS: Duration = Duration::from_millis(1);

/// A hand that must follow its target exactly, with joints that must be slow.
const SETTINGS: [&str; 5] = [
    "clock=lockstep",
    "controller.config.inverse_dynamics={ on_infeasible = \"safe_stop\" }",
    "controller.config.limits={ velocity = { fraction = 0.3 } }",
    "controller.config.tasks=[{ constraint = { task = { cartesian = { name = \"hand\", gain = 10.0 } } } }, { posture = {} }]",
    "safety.safe_state=hold",
];

struct Arm {
    session: Session<'static>,
    model: Model,
    dynamics: Dynamics,
    time: Duration,
    orientation: [f64; 4],
}

impl Arm {
    fn launch() -> Self {
        let path = workspace().join("graphs/panda-reach.toml");
        let text = std::fs::read_to_string(&path).expect("the graph is there");
        let settings: Vec<Override> = SETTINGS.iter().map(|one| one.parse().expect("an override")).collect();
        let registry = motorium_tools::registry();
        let plan = graph::check(&path, text, &settings, &registry, &Machine::detect());
        let plan = plan.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
        let options = Options::inline().standing_in_for("policy");
        let model = motorium_robots::load("panda", std::path::Path::new(".")).unwrap().model;
        Self {
            session: Session::launch(plan, &registry, &options).expect("it starts"),
            dynamics: Dynamics::new(&model),
            model,
            time: Duration::ZERO,
            orientation: [1.0, 0.0, 0.0, 0.0],
        }
    }

    /// Runs a step of 1 ms with the hand's target at `place`, if given; returns the true state after it.
    fn step(&mut self, place: Option<([f64; 3], [f64; 3])>) -> JointState {
        if let Some((position, linear_velocity)) = place {
            let target = PoseTarget {
                position,
                orientation: self.orientation,
                linear_velocity,
                goal: 1,
                ..PoseTarget::default()
            };
            self.session.publish("panda/target", &target).expect("the session stands in for the policy");
        }
        self.time += MS;
        self.session.step_until(self.time).expect("it steps");
        self.session
            .read::<JointState>("panda/true_joint_state")
            .expect("a state")
            .expect("was published")
            .value
    }

    /// Returns position and orientation of the hand.
    fn hand(&self, q: &[f64]) -> ([f64; 3], [f64; 4]) {
        let mut kinematics = Kinematics::new(&self.model);
        kinematics.update(&self.model, q);
        let pose = kinematics.pose(&self.model, self.model.frame("panda_hand_tcp").unwrap());
        (pose.translation.vector.into(), pose.rotation.coords.into())
    }

    /// Returns the largest difference between the efforts of a state and gravity compensation, Nm.
    fn beyond_weight(&mut self, state: &JointState) -> f64 {
        let mut weight = vec![0.0; self.model.nv()];
        let gravity = [0.0, 0.0, -9.81].into();
        self.dynamics.gravity(&self.model, state.position(), gravity, &mut weight);
        state.effort().iter().zip(&weight).map(|(effort, weight)| (effort - weight).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn an_arm_stopped_without_a_solution_resumes_without_a_jump() {
    let mut arm = Arm::launch();
    let first = arm.step(None);
    let (home, orientation) = arm.hand(first.position());
    arm.orientation = orientation;
    // its acceleration results from the last torques before the stop
    let mut state = first;
    for tick in 1..=300 {
        let t = f64::from(tick) * 1e-3;
        let place = [home[0], home[1] + 0.5 * t * t, home[2]];
        state = arm.step(Some((place, [0.0, t, 0.0])));
    }
    assert!(arm.beyond_weight(&state) > 0.2, "it accelerates: {}", arm.beyond_weight(&state));
    let (at, _) = arm.hand(state.position());
    // no drive is that strong
    let far = [at[0], at[1] + 5.0, at[2]];
    let (mut last, mut still) = (state, None);
    for tick in 0..1500 {
        last = arm.step(Some((far, [0.0; 3])));
        if tick >= 500 {
            let beyond = arm.beyond_weight(&last);
            assert!(beyond < 0.05, "{tick} ms after it stopped: {beyond} Nm beyond its weight");
            let place = *still.get_or_insert(last);
            let moved = last.position().iter().zip(place.position()).map(|(now, then)| (now - then).abs());
            let moved = moved.fold(0.0, f64::max);
            assert!(moved < 1e-4, "{tick} ms: it stays where it came to rest: {moved} rad");
        }
    }
    let (stopped, orientation) = arm.hand(last.position());
    arm.orientation = orientation;
    assert!((stopped[1] - at[1]).abs() < 0.1, "it continued by {} m", stopped[1] - at[1]);
    // a feasible target: slowly on from the current pose
    let (mut fastest, mut before) = (0.0_f64, last);
    for tick in 1..=3000 {
        let t = f64::from(tick) * 1e-3;
        let place = [stopped[0], stopped[1] - 0.02 * t, stopped[2]];
        let now = arm.step(Some((place, [0.0, -0.02, 0.0])));
        let changes = now.velocity().iter().zip(before.velocity()).map(|(now, before)| (now - before).abs());
        fastest = changes.fold(fastest, f64::max);
        before = now;
    }
    let (reached, _) = arm.hand(before.position());
    let missed = (reached[1] - (stopped[1] - 0.06)).abs();
    assert!(missed < 5e-3, "it follows again: {missed} m");
    assert!(fastest < 0.03, "without a jump: {fastest} rad/s in a step");
}

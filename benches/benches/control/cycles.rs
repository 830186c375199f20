//! Whole control cycles: model, tasks, limits, solution.

use std::path::Path;

use criterion::Criterion;
use motorium_control::{
    DifferentialIk, JointSetpoint, RobotState,
    inverse_dynamics::{
        Contact, InverseDynamics, MotionState,
        tasks::{
            AccelerationTask, CartesianAcceleration, CentreOfMassAcceleration, Feedback, MomentumRate,
            PostureAcceleration,
        },
    },
    limits::{PositionLimit, VelocityLimit},
    solver::{Problem, Sides, Structure},
    tasks::{CartesianTask, PostureTask},
};
use motorium_robots::{Kinematics, Model, load};
use nalgebra::{Isometry3, Vector3};

const DT: f64 = 0.001;

/// Differential inverse kinematics of a Panda whose hand runs after targets.
struct PandaCycle {
    model: Model,
    kinematics: Kinematics,
    task: CartesianTask,
    posture: PostureTask,
    ik: DifferentialIk,
    setpoint: JointSetpoint,
    centre: Isometry3<f64>,
    tick: usize,
}

impl PandaCycle {
    fn new() -> Self {
        let panda = load("panda", Path::new(".")).expect("it is in the catalogue");
        let (model, profile) = (panda.model, panda.profile.expect("it has a profile"));
        let home = profile.home(&model).expect("it has a home");
        let hand = model.frame("panda_hand_tcp").expect("it has a hand");
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, home.as_slice());
        Self {
            centre: kinematics.pose(&model, hand),
            task: CartesianTask::new(&model, hand),
            posture: PostureTask::new(&model, home.as_slice()),
            ik: DifferentialIk::new(&model),
            setpoint: JointSetpoint::new(&model, home.as_slice()),
            kinematics,
            model,
            tick: 0,
        }
    }

    fn run(&mut self) {
        let offsets = [[0.1, 0.2, 0.1], [-0.1, -0.3, 0.2], [0.6, 0.0, 0.5], [0.0, 0.3, -0.3]];
        let offset = Vector3::from(offsets[self.tick / 1000 % offsets.len()]);
        self.tick += 1;
        let goal = self.centre.translation.vector + offset;
        self.task.set_target(Isometry3::from_parts(goal.into(), self.centre.rotation));
        self.kinematics.update(&self.model, self.setpoint.position());
        let state =
            RobotState { model: &self.model, kinematics: &self.kinematics, q: self.setpoint.position() };
        let limits = (PositionLimit::default(), VelocityLimit::default());
        self.ik.assemble(&state, &mut [&mut self.task, &mut self.posture], &[&limits.0, &limits.1], DT);
        let velocity = self.ik.solve().expect("limits admit rest");
        self.setpoint.integrate(velocity, DT);
    }
}

/// Inverse dynamics of the humanoid on two soles: centre of mass, momentum, hand, posture; a ring of states along a motion.
struct HumanoidCycle {
    model: Model,
    states: Vec<(Vec<f64>, Vec<f64>)>,
    next: usize,
    kinematics: Kinematics,
    control: InverseDynamics,
    centre: CentreOfMassAcceleration,
    momentum: MomentumRate,
    hand: CartesianAcceleration,
    posture: PostureAcceleration,
}

impl HumanoidCycle {
    fn new() -> Self {
        let humanoid = load("humanoid", Path::new(".")).expect("it is in the catalogue");
        let (model, profile) = (humanoid.model, humanoid.profile.expect("it has a profile"));
        let q = profile.configuration(&model, "standing").expect("it stands");
        let feet = profile.feet.iter();
        let feet = feet.map(|(name, foot)| Contact::of_foot(&model, name, foot).expect("its frame exists"));
        let control = InverseDynamics::new(&model, feet.collect());
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, q.as_slice());
        let palm = model.frame("left_palm").expect("it has a palm");
        let mut centre = CentreOfMassAcceleration::new(&model, Feedback::critical(4.0)).weight(10.0);
        let start = kinematics.centre_of_mass(&model).position;
        centre.set_target(start + Vector3::new(0.01, 0.04, -0.02));
        let mut hand = CartesianAcceleration::new(&model, palm, Feedback::critical(8.0));
        let mut goal = kinematics.pose(&model, palm);
        goal.translation.vector += Vector3::new(0.1, 0.0, 0.15);
        hand.set_target(goal);
        let posture =
            PostureAcceleration::new(&model, model.joints_of_q(q.as_slice()), Feedback::critical(4.0));
        let mut cycle = Self {
            momentum: MomentumRate::angular(&model, 5.0).weights(0.0, 0.2),
            posture: posture.weight(0.1),
            states: Vec::new(),
            next: 0,
            kinematics,
            control,
            centre,
            hand,
            model,
        };
        // the motion that it makes itself
        let (mut q, mut v) = (q.as_slice().to_vec(), vec![0.0; cycle.model.nv()]);
        for _ in 0..1000 {
            cycle.states.push((q.clone(), v.clone()));
            cycle.next = cycle.states.len() - 1;
            cycle.run();
            let a = cycle.control.solution().acceleration.clone();
            let step: Vec<f64> = v.iter().zip(a.iter()).map(|(v, a)| (v + 0.5 * a * DT) * DT).collect();
            let from = q.clone();
            cycle.model.integrate(&from, &step, &mut q);
            v.iter_mut().zip(a.iter()).for_each(|(v, a)| *v += a * DT);
        }
        cycle.next = 0;
        cycle
    }

    fn run(&mut self) {
        let (q, v) = &self.states[self.next];
        self.next = (self.next + 1) % self.states.len();
        self.kinematics.update_with_velocity(&self.model, q, v);
        let state = MotionState { model: &self.model, kinematics: &self.kinematics, q, v };
        self.control.begin(&state, DT);
        let tasks: [&mut dyn AccelerationTask; 4] =
            [&mut self.centre, &mut self.momentum, &mut self.hand, &mut self.posture];
        for task in tasks {
            self.control.add_task(&state, 0, task);
        }
        std::hint::black_box(self.control.solve().expect("it stands"));
    }
}

/// The problems of the humanoid along its motion.
pub(crate) fn humanoid_problems() -> (Structure, Vec<Problem>) {
    let mut cycle = HumanoidCycle::new();
    let mut problems = Vec::new();
    for _ in 0..300 {
        cycle.run();
        problems.push(cycle.control.problem().clone());
    }
    let first = &problems[0];
    let structure = Structure::new(first.gradient.len())
        .equalities(first.equality_value.len())
        .rows(first.row_lower.len(), Sides::Both)
        .bounds(Sides::Both);
    (structure, problems)
}

pub(crate) fn measure(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("cycle");
    let mut panda = PandaCycle::new();
    group.bench_function("panda differential inverse kinematics", |timer| timer.iter(|| panda.run()));
    let mut humanoid = HumanoidCycle::new();
    group.bench_function("humanoid inverse dynamics, two soles", |timer| timer.iter(|| humanoid.run()));
    group.finish();
}

//! Cycles of inverse dynamics of a humanoid on two soles: model, tasks, limits, solution; a ring of states along its own motion.

use motorium_control::{
    inverse_dynamics::{
        InverseDynamics, MotionState,
        tasks::{
            AccelerationTask, CartesianAcceleration, CentreOfMassAcceleration, Feedback, MomentumRate,
            PostureAcceleration,
        },
    },
    solver::{Problem, Sides, Structure},
};
use motorium_robots::{Kinematics, Model};
use nalgebra::Vector3;

use crate::bipeds::Biped;

const DT: f64 = 0.001;

/// Tasks of the humanoid besides standing.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Tasks {
    /// Centre of mass and posture.
    Two,
    /// Angular momentum and a hand, too.
    Four,
}

pub(crate) struct TorqueCycle {
    model: Model,
    states: Vec<(Vec<f64>, Vec<f64>)>,
    next: usize,
    kinematics: Kinematics,
    control: InverseDynamics,
    centre: CentreOfMassAcceleration,
    momentum: MomentumRate,
    hand: CartesianAcceleration,
    posture: PostureAcceleration,
    tasks: Tasks,
}

impl TorqueCycle {
    pub(crate) fn new(biped: &Biped, tasks: Tasks) -> Self {
        let (model, q) = (biped.model.clone(), biped.q.clone());
        let control = InverseDynamics::new(&model, biped.contacts.clone());
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let palm = biped.hands[0];
        let mut centre = CentreOfMassAcceleration::new(&model, Feedback::critical(4.0)).weight(10.0);
        let start = kinematics.centre_of_mass(&model).position;
        centre.set_target(start + Vector3::new(0.01, 0.04, -0.02));
        let mut hand = CartesianAcceleration::new(&model, palm, Feedback::critical(8.0));
        let mut goal = kinematics.pose(&model, palm);
        goal.translation.vector += Vector3::new(0.1, 0.0, 0.15);
        hand.set_target(goal);
        let posture = PostureAcceleration::new(&model, model.joints_of_q(&q), Feedback::critical(4.0));
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
            tasks,
        };
        let (mut q, mut v) = (q, vec![0.0; cycle.model.nv()]);
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

    pub(crate) fn run(&mut self) {
        let (q, v) = &self.states[self.next];
        self.next = (self.next + 1) % self.states.len();
        self.kinematics.update_with_velocity(&self.model, q, v);
        let state = MotionState { model: &self.model, kinematics: &self.kinematics, q, v };
        self.control.begin(&state, DT);
        let tasks: [&mut dyn AccelerationTask; 4] =
            [&mut self.centre, &mut self.posture, &mut self.momentum, &mut self.hand];
        let count = if self.tasks == Tasks::Two { 2 } else { 4 };
        for task in tasks.into_iter().take(count) {
            self.control.add_task(&state, 0, task);
        }
        std::hint::black_box(self.control.solve().expect("it stands"));
    }
}

/// The problems of the humanoid of the catalogue along its motion.
pub(crate) fn problems() -> (Structure, Vec<Problem>) {
    let mut cycle = TorqueCycle::new(&Biped::catalogue(), Tasks::Four);
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

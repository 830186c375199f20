//! Cycles of inverse dynamics of a humanoid on two soles: model, tasks, limits, solution; a ring of states
//! along its own motion.

use motorium_control::inverse_dynamics::{AccelerationTask, InverseDynamics, MotionState};
use motorium_control::tasks::Feedback;
use motorium_control::tasks::{
    CartesianSettings, CartesianTask, CentreOfMassTask, MomentumTask, PostureTask,
};
use motorium_qp::{Problem, Sides, Structure};
use motorium_robots::{Kinematics, Model};
use nalgebra::{Isometry3, Vector3};

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

/// Order in which the states of the recorded motion are replayed.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Motion {
    /// Back and forth: neighbours follow each other.
    ToAndFro,
    /// In a circle: every thousandth state follows a distant one.
    Round,
    /// In a circle of a closed motion: the humanoid leans over its left foot, lifts the right one, and sets
    /// it down in place.
    Step,
    /// The same motion as [`Step`](Self::Step), without control of the right foot. The foot lands elsewhere,
    /// the robot falls, and in the end no motion satisfies all constraints.
    Fall,
}

impl Motion {
    fn lifts(self) -> bool {
        matches!(self, Self::Step | Self::Fall)
    }
}

/// A state along the motion.
struct Moment {
    q: Vec<f64>,
    v: Vec<f64>,
    /// Desired position of the centre of mass.
    wanted: Vector3<f64>,
    /// Load fraction of the right foot; 0 when it is lifted, with its height above the ground \[m\].
    load: f64,
    height: f64,
}

pub(crate) struct TorqueCycle {
    model: Model,
    moments: Vec<Moment>,
    next: usize,
    /// `true` for the motion back.
    back: bool,
    motion: Motion,
    weight: f64,
    kinematics: Kinematics,
    control: InverseDynamics,
    centre: CentreOfMassTask,
    momentum: MomentumTask,
    hand: CartesianTask,
    /// The right foot while it is lifted.
    foot: CartesianTask,
    ground: Isometry3<f64>,
    posture: PostureTask,
    tasks: Tasks,
}

impl TorqueCycle {
    pub(crate) fn new(biped: &Biped, tasks: Tasks, motion: Motion) -> Self {
        let (model, q) = (biped.model.clone(), biped.q.clone());
        let control = InverseDynamics::new(&model, biped.contacts.clone());
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let palm = biped.hands[0];
        let centre = CentreOfMassTask::new(&model).feedback(Feedback::critical(4.0)).weight(10.0);
        let start = kinematics.centre_of_mass(&model).position;
        let above = kinematics.pose(&model, biped.feet[0]).translation.vector;
        let mut hand = CartesianTask::new(&model, palm)
            .with(CartesianSettings::geometric())
            .feedback(Feedback::critical(8.0));
        let mut goal = kinematics.pose(&model, palm);
        goal.translation.vector += Vector3::new(0.1, 0.0, 0.15);
        hand.set_target(goal);
        let ground = kinematics.pose(&model, biped.feet[1]);
        let posture =
            PostureTask::new(&model, model.joints_of_q(&q)).feedback(Feedback::critical(4.0)).weight(1.0);
        let mut cycle = Self {
            momentum: MomentumTask::angular(&model).rate(5.0).weights(0.0, 0.2),
            posture: posture.weight(0.1),
            weight: 9.81 * model.mass(),
            moments: Vec::new(),
            next: 0,
            back: false,
            kinematics,
            control,
            centre,
            hand,
            foot: CartesianTask::new(&model, biped.feet[1])
                .with(CartesianSettings::geometric())
                .feedback(Feedback::critical(20.0)),
            ground,
            model,
            tasks,
            motion,
        };
        let (mut q, mut v) = (q, vec![0.0; cycle.model.nv()]);
        for tick in 0..if motion.lifts() { 6000 } else { 1000 } {
            let (lean, load, height) = step(motion, f64::from(tick) * DT);
            let wanted = match motion {
                Motion::Step | Motion::Fall => {
                    start + lean * Vector3::new(above.x - start.x, above.y - start.y, -0.02)
                }
                _ => start + Vector3::new(0.01, 0.04, -0.02),
            };
            cycle.moments.push(Moment { q: q.clone(), v: v.clone(), wanted, load, height });
            cycle.next = cycle.moments.len() - 1;
            cycle.run();
            let a = cycle.control.solution().acceleration.clone();
            let step: Vec<f64> = v.iter().zip(a.iter()).map(|(v, a)| (v + 0.5 * a * DT) * DT).collect();
            let from = q.clone();
            cycle.model.integrate(&from, &step, &mut q);
            v.iter_mut().zip(a.iter()).for_each(|(v, a)| *v += a * DT);
        }
        (cycle.next, cycle.back) = (0, false);
        cycle
    }

    /// Computes the torques of the next state. Returns the iterations of the solver.
    pub(crate) fn run(&mut self) -> u32 {
        let moment = &self.moments[self.next];
        let last = self.moments.len() - 1;
        (self.next, self.back) = match (self.motion, self.back, self.next) {
            (Motion::ToAndFro, false, next) if next < last => (next + 1, false),
            (Motion::ToAndFro, true, next) if next > 0 => (next - 1, true),
            (Motion::ToAndFro, back, next) => (next, !back),
            (_, _, next) => ((next + 1) % self.moments.len(), false),
        };
        let (q, v) = (&moment.q, &moment.v);
        self.kinematics.update_with_velocity(&self.model, q, v);
        let state = MotionState { model: &self.model, kinematics: &self.kinematics, q, v };
        self.centre.set_target(moment.wanted);
        if self.motion.lifts() {
            self.control.set_active(1, moment.load > 0.0);
            let most = if moment.load < 1.0 { moment.load * 0.5 * self.weight } else { f64::INFINITY };
            self.control.set_max_force(1, most);
        }
        self.control.begin(&state, DT);
        let tasks: [&mut dyn AccelerationTask; 4] =
            [&mut self.centre, &mut self.posture, &mut self.momentum, &mut self.hand];
        let count = if self.tasks == Tasks::Two { 2 } else { 4 };
        for task in tasks.into_iter().take(count) {
            self.control.add_task(&state, 0, task);
        }
        if self.motion == Motion::Step && moment.load == 0.0 {
            let mut up = self.ground;
            up.translation.vector.z += moment.height;
            self.foot.set_target(up);
            self.control.add_task(&state, 0, &mut self.foot);
        }
        std::hint::black_box(self.control.solve().expect("it stands")).iterations
    }
}

/// Returns the desired position of the centre of mass on the line to the left foot (as a fraction), the load
/// fraction of the right foot, and its height \[m\], at a time \[s\].
fn step(motion: Motion, t: f64) -> (f64, f64, f64) {
    if !motion.lifts() {
        return (0.0, 1.0, 0.0);
    }
    let smooth = |t: f64| {
        let t = t.clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let lean = smooth(t) - smooth(t - 3.5);
    let load = (1.0 - 10.0 * (t - 2.0)).clamp(0.0, 1.0) + (10.0 * (t - 3.0)).clamp(0.0, 1.0);
    (lean, load, 0.05 * (smooth(4.0 * (t - 2.1)) - smooth(4.0 * (t - 2.7))))
}

/// Returns the problems of the humanoid of the catalogue along its motion.
pub(crate) fn problems() -> (Structure, Vec<Problem>) {
    let mut cycle = TorqueCycle::new(&Biped::catalogue(), Tasks::Four, Motion::Round);
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

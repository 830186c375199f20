//! The Panda, and reproducible random numbers.

use motorium_control::{
    DifferentialIk, RobotState, SetpointIntegrator,
    limits::{PositionLimit, VelocityLimit},
    tasks::{CartesianTask, PostureTask},
};
use motorium_robots::{FrameId, Gains, Kinematics, Model, load};
use nalgebra::{DVector, Isometry3};

pub(crate) struct Panda {
    pub(crate) model: Model,
    pub(crate) home: DVector<f64>,
    pub(crate) gains: Gains,
    pub(crate) hand: FrameId,
}

impl Panda {
    pub(crate) fn new() -> Self {
        let loaded = load("panda", std::path::Path::new(".")).unwrap();
        let profile = loaded.profile.unwrap();
        let model = loaded.model;
        let hand = model.frame(&profile.end_effector("hand").unwrap().frame).unwrap();
        Self { home: profile.home(&model).unwrap(), gains: profile.gains(&model).unwrap(), hand, model }
    }

    pub(crate) fn hand_at(&self, q: &[f64]) -> Isometry3<f64> {
        let mut kinematics = Kinematics::new(&self.model);
        kinematics.update(&self.model, q);
        kinematics.pose(&self.model, self.hand)
    }

    /// Random configuration within the limits: at `spread` 0 the home pose, at 1 any pose.
    pub(crate) fn near_home(&self, spread: f64, random: &mut Random) -> Vec<f64> {
        let (lower, upper) = (self.model.lower(), self.model.upper());
        (0..self.model.nv())
            .map(|j| {
                let anywhere = lower[j] + random.next() * (upper[j] - lower[j]);
                self.home[j] + spread * (anywhere - self.home[j])
            })
            .collect()
    }
}

/// Uniform numbers in [0, 1): Knuth's linear congruential generator.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn within(&mut self, magnitude: f64) -> f64 {
        magnitude * (2.0 * self.next() - 1.0)
    }
}

/// A Panda whose joints follow their setpoint exactly.
pub(crate) struct ClosedLoop<'a> {
    pub(crate) panda: &'a Panda,
    pub(crate) kinematics: Kinematics,
    pub(crate) task: CartesianTask,
    pub(crate) posture: PostureTask,
    pub(crate) position: PositionLimit,
    pub(crate) velocity: VelocityLimit,
    pub(crate) ik: DifferentialIk,
    pub(crate) setpoint: SetpointIntegrator,
}

impl<'a> ClosedLoop<'a> {
    pub(crate) fn new(panda: &'a Panda, start: &[f64]) -> Self {
        let model = &panda.model;
        Self {
            panda,
            kinematics: Kinematics::new(model),
            task: CartesianTask::new(model, panda.hand),
            posture: PostureTask::new(model, panda.home.as_slice()),
            position: PositionLimit::default(),
            velocity: VelocityLimit::default(),
            ik: DifferentialIk::new(model),
            setpoint: SetpointIntegrator::new(model, start),
        }
    }

    /// Runs one tick and asserts that the limits hold for any request.
    pub(crate) fn tick(&mut self, dt: f64) {
        let model = &self.panda.model;
        let before = self.setpoint.position().to_vec();
        self.kinematics.update(model, &before);
        let state = RobotState { model, kinematics: &self.kinematics, q: &before };
        self.ik.assemble(
            &state,
            &mut [&mut self.task, &mut self.posture],
            &[&self.position, &self.velocity],
            dt,
        );
        self.setpoint.integrate(self.ik.solve().unwrap(), dt);
        for (j, (q, v)) in self.setpoint.position().iter().zip(self.setpoint.velocity()).enumerate() {
            let (lower, upper) = (model.lower()[j].min(before[j]), model.upper()[j].max(before[j]));
            assert!((lower..=upper).contains(q), "joint {j} at {q}, limits {lower} to {upper}");
            let fastest = self.velocity.fraction * model.velocity_limit()[j];
            assert!(v.abs() <= fastest, "joint {j} moves at {v}, limit {fastest}");
        }
    }

    pub(crate) fn run(&mut self, seconds: f64, dt: f64) {
        for _ in 0..(seconds / dt).round() as usize {
            self.tick(dt);
        }
    }
}

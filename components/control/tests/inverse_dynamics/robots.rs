//! Robots of the catalogue in random states.

use motorium_control::inverse_dynamics::{Contact, MotionState};
use motorium_robots::{Kinematics, Model, Profile, load};
use nalgebra::{DVector, UnitQuaternion, Vector3};

pub(crate) struct Robot {
    pub(crate) model: Model,
    pub(crate) profile: Profile,
    pub(crate) kinematics: Kinematics,
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
}

impl Robot {
    /// Creates the robot at its home pose, at rest.
    pub(crate) fn new(name: &str) -> Self {
        let loaded = load(name, std::path::Path::new(".")).unwrap();
        let (model, profile) = (loaded.model, loaded.profile.unwrap());
        let mut q = model.neutral();
        let joints = model.nq() - model.joint_count();
        q[joints..].copy_from_slice(profile.home(&model).unwrap().as_slice());
        if let Some(base) = profile.base_poses.get(&profile.home) {
            q[..3].copy_from_slice(&base.position);
        }
        let v = vec![0.0; model.nv()];
        let mut robot = Self { kinematics: Kinematics::new(&model), model, profile, q, v };
        robot.update();
        robot
    }

    pub(crate) fn update(&mut self) {
        self.kinematics.update_with_velocity(&self.model, &self.q, &self.v);
    }

    /// Moves the robot near its home pose with a random velocity.
    pub(crate) fn moved(mut self, random: &mut Random) -> Self {
        let step: Vec<f64> = self.v.iter().map(|_| random.within(0.3)).collect();
        let from = self.q.clone();
        self.model.integrate(&from, &step, &mut self.q);
        self.v.iter_mut().for_each(|v| *v = random.within(0.8));
        self.update();
        self
    }

    pub(crate) fn state(&self) -> MotionState<'_> {
        MotionState { model: &self.model, kinematics: &self.kinematics, q: &self.q, v: &self.v }
    }

    pub(crate) fn feet(&self) -> Vec<Contact> {
        let feet = self.profile.feet.iter();
        feet.map(|(name, foot)| Contact::of_foot(&self.model, name, foot).unwrap()).collect()
    }

    /// Returns the robot after `dt` with the constant acceleration `a`.
    pub(crate) fn after(&self, a: &DVector<f64>, dt: f64) -> Self {
        let model = &self.model;
        let middle: Vec<f64> = self.v.iter().zip(a.iter()).map(|(v, a)| (v + 0.5 * a * dt) * dt).collect();
        let mut q = self.q.clone();
        model.integrate(&self.q, &middle, &mut q);
        let v = self.v.iter().zip(a.iter()).map(|(v, a)| v + a * dt).collect();
        let mut next = Self {
            model: model.clone(),
            profile: self.profile.clone(),
            kinematics: self.kinematics.clone(),
            q,
            v,
        };
        next.update();
        next
    }

    pub(crate) fn accelerations(&self, random: &mut Random) -> DVector<f64> {
        DVector::from_fn(self.model.nv(), |_, _| random.within(2.0))
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

    pub(crate) fn vector(&mut self, magnitude: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.within(magnitude))
    }

    pub(crate) fn rotation(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(self.vector(1.5))
    }
}

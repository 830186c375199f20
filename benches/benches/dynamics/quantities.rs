//! The measured calls. They cycle through a ring of states, so that branch predictors and caches do not adapt
//! to a single state.

use motorium_robots::{Derivatives, Dynamics, FrameId, Kinematics, Reference};
use nalgebra::{DMatrix, Matrix6xX, Vector3};

use crate::robots::Subject;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// States in the ring.
const STATES: usize = 64;

/// Names of the quantities, shared with the peer's driver.
pub(crate) const NAMES: [&str; 12] = [
    "rnea",
    "bias",
    "crba",
    "crba_full",
    "aba",
    "forward_kinematics",
    "frame_jacobian",
    "com_jacobian",
    "centroidal_map",
    "inverse_mass",
    "rnea_derivatives",
    "aba_derivatives",
];

struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

/// One robot ready to be measured.
pub(crate) struct Bench<'a> {
    subject: &'a Subject,
    frame: FrameId,
    states: Vec<State>,
    next: usize,
    dynamics: Dynamics,
    kinematics: Kinematics,
    out: Vec<f64>,
    mass: DMatrix<f64>,
    jacobian: Matrix6xX<f64>,
    com: nalgebra::Matrix3xX<f64>,
    derivatives: Derivatives,
}

impl<'a> Bench<'a> {
    pub(crate) fn new(subject: &'a Subject) -> Self {
        let model = &subject.model;
        let n = model.nv();
        // A fixed linear congruential generator (Knuth's MMIX): the same states in every run.
        let mut seed: u64 = 1;
        let mut random = move || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let states = (0..STATES)
            .map(|_| {
                let mut vector = |count: usize| -> Vec<f64> { (0..count).map(|_| random()).collect() };
                let (tangent, v, a) = (vector(n), vector(n), vector(n));
                let mut q = model.neutral();
                let start = q.clone();
                model.integrate(&start, &tangent, &mut q);
                State { q, v, a }
            })
            .collect();
        Self {
            subject,
            frame: model.frame(subject.frame).expect("the robot's own file names the frame"),
            states,
            next: 0,
            dynamics: Dynamics::new(model),
            kinematics: Kinematics::new(model),
            out: vec![0.0; n],
            mass: DMatrix::zeros(n, n),
            jacobian: Matrix6xX::zeros(n),
            com: nalgebra::Matrix3xX::zeros(n),
            derivatives: Derivatives::new(model),
        }
    }

    /// Evaluates one quantity at the next state; `false` if it is unknown.
    pub(crate) fn run(&mut self, name: &str) -> bool {
        self.next = (self.next + 1) % STATES;
        let State { q, v, a } = &self.states[self.next];
        let model = &self.subject.model;
        match name {
            "rnea" => self.dynamics.rnea(model, q, v, a, GRAVITY, &mut self.out),
            "bias" => self.dynamics.bias(model, q, v, GRAVITY, &mut self.out),
            "crba" => self.dynamics.crba_upper(model, q, &mut self.mass),
            "crba_full" => self.dynamics.crba(model, q, &mut self.mass),
            "aba" => {
                self.dynamics.forward(model, q, v, a, GRAVITY, &mut self.out).expect("all links have inertia")
            }
            "forward_kinematics" => self.kinematics.update(model, q),
            "frame_jacobian" => {
                let out = &mut self.jacobian;
                self.kinematics.jacobian_at(model, q, self.frame, Reference::Local, out);
            }
            "com_jacobian" => {
                self.kinematics.update(model, q);
                self.kinematics.com_jacobian(model, &mut self.com);
            }
            "centroidal_map" => self.dynamics.centroidal_map(model, q, &mut self.jacobian),
            "inverse_mass" => {
                self.dynamics.inverse_mass(model, q, &mut self.mass).expect("all links have inertia");
            }
            "rnea_derivatives" => {
                self.dynamics.rnea_derivatives(model, q, v, a, GRAVITY, &mut self.derivatives);
            }
            "aba_derivatives" => {
                let (a_out, out) = (&mut self.out, &mut self.derivatives);
                self.dynamics
                    .forward_derivatives(model, q, v, a, GRAVITY, a_out, out)
                    .expect("all links have inertia");
            }
            _ => return false,
        }
        std::hint::black_box((&self.out, &self.mass, &self.jacobian, &self.com, &self.derivatives));
        true
    }
}

//! Laws of mechanics for floating bases, with rotors, mimic joints and combined models.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, Dynamics, Kinematics, LoadOptions, MimicMode, Model, Reference, load_with, parse_mjcf,
    parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Matrix6xX, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

fn robots() -> Vec<Model> {
    let floating = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
    let independent = LoadOptions { mimic: MimicMode::Independent, ..floating.clone() };
    let branching = parse_urdf_with(include_str!("fixtures/branching.urdf"), None, &floating).unwrap().model;
    let panda = load_with("panda", Path::new("."), &independent).unwrap().model;
    let walker = parse_mjcf(include_str!("mujoco/walker.xml"), None, &LoadOptions::default()).unwrap().model;
    // bodies that are not in depth-first order
    let hand = panda.frame("panda_link4").unwrap();
    let arm = load_with("planar-3r", Path::new("."), &LoadOptions::default()).unwrap().model;
    let two = panda.attached(hand, &arm, &nalgebra::Isometry3::translation(0.1, 0.2, 0.3), "other/").unwrap();
    vec![branching, panda, walker, two]
}

/// Numbers in -1 .. 1: Knuth's MMIX generator.
struct Random(u64);

impl Random {
    fn vector(&mut self, count: usize, scale: f64) -> DVector<f64> {
        DVector::from_fn(count, |_, _| {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0) * scale
        })
    }
}

fn moved(model: &Model, q: &[f64], v: &DVector<f64>) -> Vec<f64> {
    let mut out = q.to_vec();
    model.integrate(q, v.as_slice(), &mut out);
    out
}

#[test]
fn mass_bias_inverse_and_forward_dynamics_are_consistent() {
    let mut random = Random(1);
    for model in robots() {
        let n = model.nv();
        let mut dynamics = Dynamics::new(&model);
        for _ in 0..10 {
            let q = moved(&model, &model.neutral(), &random.vector(n, 1.5));
            let (v, a) = (random.vector(n, 2.0), random.vector(n, 5.0));
            let mut mass = DMatrix::zeros(n, n);
            dynamics.crba(&model, &q, &mut mass);
            assert_eq!(mass, mass.transpose());
            assert!(mass.clone().cholesky().is_some());
            let (mut tau, mut bias, mut back) = (DVector::zeros(n), DVector::zeros(n), DVector::zeros(n));
            dynamics.rnea(&model, &q, v.as_slice(), a.as_slice(), GRAVITY, tau.as_mut_slice());
            dynamics.bias(&model, &q, v.as_slice(), GRAVITY, bias.as_mut_slice());
            let scale = tau.amax();
            assert_relative_eq!(tau, &mass * &a + &bias, epsilon = 1e-12 * scale);
            dynamics.forward(&model, &q, v.as_slice(), tau.as_slice(), GRAVITY, back.as_mut_slice()).unwrap();
            assert_relative_eq!(back, a, epsilon = 1e-8);
            assert_relative_eq!(
                dynamics.kinetic_energy(&model, &q, v.as_slice()),
                0.5 * v.dot(&(&mass * &v)),
                max_relative = 1e-12
            );
            let mut inverse = DMatrix::zeros(n, n);
            dynamics.inverse_mass(&model, &q, &mut inverse).unwrap();
            assert_relative_eq!(inverse * &mass, DMatrix::identity(n, n), epsilon = 1e-9);
        }
    }
}

#[test]
fn jacobians_are_derivatives_of_poses_on_the_manifold() {
    let mut random = Random(2);
    for model in robots() {
        let n = model.nv();
        let q = moved(&model, &model.neutral(), &random.vector(n, 1.5));
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let mut jacobian = Matrix6xX::zeros(n);
        let mut near = Kinematics::new(&model);
        for frame in model.frames() {
            let frame = model.frame(&frame.name).unwrap();
            kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut jacobian);
            for column in 0..n {
                let h = 1e-6;
                let mut step = DVector::zeros(n);
                step[column] = h;
                near.update(&model, &moved(&model, &q, &step));
                let plus = near.pose(&model, frame);
                near.update(&model, &moved(&model, &q, &-step));
                let minus = near.pose(&model, frame);
                let linear = (plus.translation.vector - minus.translation.vector) / (2.0 * h);
                let angular = (plus.rotation * minus.rotation.inverse()).scaled_axis() / (2.0 * h);
                assert_relative_eq!(
                    jacobian.fixed_view::<3, 1>(0, column).into_owned(),
                    linear,
                    epsilon = 1e-8
                );
                assert_relative_eq!(
                    jacobian.fixed_view::<3, 1>(3, column).into_owned(),
                    angular,
                    epsilon = 1e-8
                );
            }
        }
    }
}

/// Performs one step of the midpoint method along the mean velocity, which is second order on the manifold
/// too.
fn step(
    model: &Model,
    dynamics: &mut Dynamics,
    q: &[f64],
    v: &DVector<f64>,
    h: f64,
) -> (Vec<f64>, DVector<f64>) {
    let n = model.nv();
    let zero = DVector::zeros(n);
    let mut acceleration = |q: &[f64], v: &DVector<f64>| {
        let mut a = DVector::zeros(n);
        dynamics.forward(model, q, v.as_slice(), zero.as_slice(), GRAVITY, a.as_mut_slice()).unwrap();
        a
    };
    let k1 = acceleration(q, v);
    let middle = v + &k1 * (0.5 * h);
    let k2 = acceleration(&moved(model, q, &((v + &middle) * (0.25 * h))), &middle);
    let next = v + &k2 * h;
    (moved(model, q, &(&(v + &k2 * (0.5 * h)) * h)), next)
}

#[test]
fn falling_robot_conserves_energy_and_momentum() {
    let mut random = Random(3);
    for model in robots() {
        let n = model.nv();
        let mut dynamics = Dynamics::new(&model);
        let start = moved(&model, &model.neutral(), &random.vector(n, 1.0));
        let speed = random.vector(n, 0.5);
        let mut errors = [0.0; 2];
        // half the step gives a quarter of the error: the remainder is caused by the integrator, not the
        // dynamics
        for (error, steps) in errors.iter_mut().zip([100, 200]) {
            let (mut q, mut v) = (start.clone(), speed.clone());
            let energy = |dynamics: &mut Dynamics, q: &[f64], v: &DVector<f64>| {
                dynamics.kinetic_energy(&model, q, v.as_slice())
                    + dynamics.potential_energy(&model, q, GRAVITY)
            };
            let before = energy(&mut dynamics, &q, &v);
            let momentum = dynamics.momentum(&model, &q, v.as_slice());
            let time = 0.1;
            for _ in 0..steps {
                (q, v) = step(&model, &mut dynamics, &q, &v, time / f64::from(steps));
            }
            let scale = dynamics.kinetic_energy(&model, &q, v.as_slice());
            *error = ((energy(&mut dynamics, &q, &v) - before) / scale).abs();
            // gravity acts on the centre of mass only
            let after = dynamics.momentum(&model, &q, v.as_slice());
            let gained = after.linear - momentum.linear - GRAVITY * (model.mass() * time);
            assert!(gained.norm() < 1e-3 * after.linear.norm(), "{gained}");
            assert!((after.angular - momentum.angular).norm() < 1e-2 * momentum.angular.norm().max(0.1));
        }
        assert!(errors[1] < 1e-4 && (errors[1] < 0.35 * errors[0] || errors[1] < 1e-9), "{errors:?}");
    }
}

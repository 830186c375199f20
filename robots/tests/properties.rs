//! Laws of mechanics that hold for every robot, over random states.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    Coordinate, Dynamics, FrameId, Kinematics, MimicMode, Model, PackagePath, Reference, load, parse_urdf,
};
use nalgebra::{DMatrix, DVector, Isometry3, Vector3, Vector6};
use proptest::prelude::*;

const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

/// The Panda, and a tree with skew axes, welded links and a chain of mimic joints.
fn robots() -> [Model; 2] {
    let text = include_str!("fixtures/branching.urdf");
    let branching = parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap();
    [load("panda", Path::new(".")).unwrap().model, branching.model]
}

fn pose(model: &Model, q: &DVector<f64>, frame: FrameId) -> Isometry3<f64> {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q.as_slice());
    kinematics.pose(model, frame)
}

fn mass(model: &Model, q: &DVector<f64>) -> DMatrix<f64> {
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    Dynamics::new(model).crba(model, q.as_slice(), &mut mass);
    mass
}

/// Potential energy of all masses [J], from the poses of the bodies.
fn potential_energy(model: &Model, q: &DVector<f64>) -> f64 {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q.as_slice());
    let bodies = model.bodies().iter().enumerate();
    bodies
        .map(|(index, body)| {
            let com = kinematics.body_pose(index) * nalgebra::Point3::from(body.inertia.com);
            -body.inertia.mass * GRAVITY.dot(&com.coords)
        })
        .sum()
}

/// Kinetic energy [J], from the velocities of the bodies.
fn kinetic_energy(model: &Model, q: &DVector<f64>, v: &DVector<f64>) -> f64 {
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, q.as_slice(), v.as_slice());
    let bodies = model.bodies().iter();
    bodies
        .map(|body| {
            let frame = model.frame(&body.name).unwrap();
            let twist = kinematics.velocity_in(model, frame, Reference::Local);
            let com = twist.linear + twist.angular.cross(&body.inertia.com);
            0.5 * body.inertia.mass * com.norm_squared()
                + 0.5 * twist.angular.dot(&(body.inertia.rotational * twist.angular))
        })
        .sum()
}

/// Returns a vector of `model`'s size, from numbers in -1 .. 1.
fn state(model: &Model, numbers: &[f64], scale: f64) -> DVector<f64> {
    DVector::from_iterator(model.nv(), numbers.iter().cycle().take(model.nv()).map(|x| x * scale))
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-1.0..1.0, 8)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn jacobian_is_the_derivative_of_the_pose(q in numbers()) {
        for model in robots() {
            let q = state(&model, &q, 2.0);
            let mut kinematics = Kinematics::new(&model);
            kinematics.update(&model, q.as_slice());
            for index in 0..model.frames().len() {
                let frame = model.frame(&model.frames()[index].name).unwrap();
                let mut jacobian = DMatrix::zeros(6, model.nv());
                kinematics.jacobian(&model, frame, Reference::LocalWorldAligned, &mut jacobian);
                for column in 0..model.nv() {
                    let h = 1e-6;
                    let mut step = DVector::zeros(model.nv());
                    step[column] = h;
                    let (plus, minus) = (pose(&model, &(&q + &step), frame), pose(&model, &(&q - &step), frame));
                    let linear = (plus.translation.vector - minus.translation.vector) / (2.0 * h);
                    let angular = (plus.rotation * minus.rotation.inverse()).scaled_axis() / (2.0 * h);
                    assert_relative_eq!(jacobian.fixed_view::<3, 1>(0, column).into_owned(), linear, epsilon = 1e-8);
                    assert_relative_eq!(jacobian.fixed_view::<3, 1>(3, column).into_owned(), angular, epsilon = 1e-8);
                }
            }
        }
    }

    #[test]
    fn jacobian_times_velocity_is_the_velocity_of_the_frame(q in numbers(), v in numbers()) {
        for model in robots() {
            let (q, v) = (state(&model, &q, 2.0), state(&model, &v, 2.0));
            let mut kinematics = Kinematics::new(&model);
            kinematics.update_with_velocity(&model, q.as_slice(), v.as_slice());
            for index in 0..model.frames().len() {
                let frame = model.frame(&model.frames()[index].name).unwrap();
                let pose = kinematics.pose(&model, frame);
                let aligned = kinematics.velocity(&model, frame);
                for reference in [Reference::Local, Reference::World, Reference::LocalWorldAligned] {
                    let mut jacobian = DMatrix::zeros(6, model.nv());
                    kinematics.jacobian(&model, frame, reference, &mut jacobian);
                    let product = &jacobian * &v;
                    let (linear, angular) = match reference {
                        Reference::LocalWorldAligned => (aligned.linear, aligned.angular),
                        Reference::Local => (pose.rotation.inverse() * aligned.linear, pose.rotation.inverse() * aligned.angular),
                        // the point of the body at the world's origin
                        Reference::World => (aligned.linear - aligned.angular.cross(&pose.translation.vector), aligned.angular),
                    };
                    let expected = Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z);
                    assert_relative_eq!(Vector6::from_column_slice(product.as_slice()), expected, epsilon = 1e-12);
                    let twist = kinematics.velocity_in(&model, frame, reference).vector();
                    assert_relative_eq!(twist, expected, epsilon = 1e-12);
                }
            }
        }
    }

    #[test]
    fn mass_matrix_is_definite_and_gives_the_kinetic_energy(q in numbers(), v in numbers()) {
        for model in robots() {
            let (q, v) = (state(&model, &q, 2.0), state(&model, &v, 2.0));
            let mass = mass(&model, &q);
            assert_eq!(mass, mass.transpose());
            assert!(mass.clone().cholesky().is_some(), "{mass}");
            let energy = 0.5 * v.dot(&(&mass * &v));
            assert_relative_eq!(energy, kinetic_energy(&model, &q, &v), max_relative = 1e-12, epsilon = 1e-14);
        }
    }

    #[test]
    fn gravity_is_the_gradient_of_the_potential_energy(q in numbers()) {
        for model in robots() {
            let q = state(&model, &q, 2.0);
            let mut gravity = DVector::zeros(model.nv());
            Dynamics::new(&model).gravity(&model, q.as_slice(), GRAVITY, gravity.as_mut_slice());
            for column in 0..model.nv() {
                let h = 1e-5;
                let mut step = DVector::zeros(model.nv());
                step[column] = h;
                let rise = potential_energy(&model, &(&q + &step)) - potential_energy(&model, &(&q - &step));
                assert_relative_eq!(gravity[column], rise / (2.0 * h), epsilon = 1e-6);
            }
        }
    }

    #[test]
    fn inverse_dynamics_is_mass_times_acceleration_plus_bias(q in numbers(), v in numbers(), a in numbers()) {
        for model in robots() {
            let (q, v, a) = (state(&model, &q, 2.0), state(&model, &v, 3.0), state(&model, &a, 5.0));
            let mut dynamics = Dynamics::new(&model);
            let (mut tau, mut bias) = (DVector::zeros(model.nv()), DVector::zeros(model.nv()));
            dynamics.rnea(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, tau.as_mut_slice());
            dynamics.bias(&model, q.as_slice(), v.as_slice(), GRAVITY, bias.as_mut_slice());
            let expected = mass(&model, &q) * &a + bias;
            assert_relative_eq!(tau, expected, max_relative = 1e-11, epsilon = 1e-11);
        }
    }

    #[test]
    fn forward_dynamics_undoes_inverse_dynamics(q in numbers(), v in numbers(), a in numbers()) {
        for model in robots() {
            let (q, v, a) = (state(&model, &q, 2.0), state(&model, &v, 3.0), state(&model, &a, 5.0));
            let mut dynamics = Dynamics::new(&model);
            let (mut tau, mut back) = (DVector::zeros(model.nv()), DVector::zeros(model.nv()));
            dynamics.rnea(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, tau.as_mut_slice());
            dynamics
                .forward(&model, q.as_slice(), v.as_slice(), tau.as_slice(), GRAVITY, back.as_mut_slice())
                .unwrap();
            assert_relative_eq!(back, a, max_relative = 1e-9, epsilon = 1e-9);
        }
    }

    #[test]
    fn bias_forces_conserve_energy_in_free_motion(q in numbers(), v in numbers()) {
        // d/dt of the kinetic energy at a = M^-1 (-C v) must vanish: v' M a + 1/2 v' dM/dt v = 0.
        for model in robots() {
            let (q, v) = (state(&model, &q, 2.0), state(&model, &v, 2.0));
            let mut coriolis = DVector::zeros(model.nv());
            Dynamics::new(&model).bias(&model, q.as_slice(), v.as_slice(), Vector3::zeros(), coriolis.as_mut_slice());
            let h = 1e-5;
            let rate = (mass(&model, &(&q + &v * h)) - mass(&model, &(&q - &v * h))) / (2.0 * h);
            assert_relative_eq!(v.dot(&coriolis), 0.5 * v.dot(&(rate * &v)), epsilon = 1e-6);
        }
    }
}

#[test]
fn mimic_chain_follows_its_independent_master() {
    let [_, model] = robots();
    assert_eq!(model.joint_names(), ["waist", "lift_joint", "shoulder", "wheel_joint"]);
    let find = |name: &str| model.bodies().iter().find(|body| body.joint.name == name).unwrap();
    let q = [0.1, 0.2, 0.4, 0.5];
    // elbow = -1.5 * 0.4 + 0.3, slide = 0.1 * elbow - 0.05
    assert_relative_eq!(find("elbow").joint.coordinate.position(&q), -0.3, epsilon = 1e-15);
    assert_relative_eq!(find("slide").joint.coordinate.position(&q), -0.08, epsilon = 1e-15);
    assert!(matches!(find("slide").joint.coordinate, Coordinate::Mimic { of: 2, .. }));
}

//! Feed-forward efforts compared with energies, and gains that a drive cannot use.

use crate::robot::{Panda, Random};
use approx::assert_abs_diff_eq;
use motorium_control::{FeedForward, GainsError, SetpointIntegrator, check_gains};
use motorium_robots::{Dynamics, Kinematics, Model};
use nalgebra::{DMatrix, DVector, Point3, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn potential_energy(model: &Model, q: &[f64]) -> f64 {
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q);
    let height = |index: usize| {
        let com = kinematics.body_pose(index) * Point3::from(model.bodies()[index].inertia.com);
        -GRAVITY.dot(&com.coords)
    };
    (0..model.bodies().len()).map(|index| model.bodies()[index].inertia.mass * height(index)).sum()
}

#[test]
fn gravity_compensation_is_the_potential_energy_gradient() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut feed_forward = FeedForward::new(model, Some(GRAVITY));
    let mut random = Random(11);
    let h = 1e-6;
    for _ in 0..10 {
        let q = panda.near_home(1.0, &mut random);
        let setpoint = SetpointIntegrator::new(model, panda.home.as_slice());
        let effort = feed_forward.effort(model, &q, &[], &setpoint).to_vec();
        for joint in 0..model.nv() {
            let (mut ahead, mut behind) = (q.clone(), q.clone());
            ahead[joint] += h;
            behind[joint] -= h;
            let slope = (potential_energy(model, &ahead) - potential_energy(model, &behind)) / (2.0 * h);
            let limit = model.effort_limit()[joint];
            assert_abs_diff_eq!(effort[joint], slope.clamp(-limit, limit), epsilon = 1e-6);
        }
    }
}

#[test]
fn feed_forward_stays_within_the_effort_limits() {
    let panda = Panda::new();
    let heavy = Some(GRAVITY * 50.0);
    let mut feed_forward = FeedForward::new(&panda.model, heavy);
    let setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    let effort = feed_forward.effort(&panda.model, panda.home.as_slice(), &[], &setpoint);
    let shoulder = effort[1].abs();
    assert_eq!(shoulder, panda.model.effort_limit()[1]);
    assert!(effort.iter().zip(panda.model.effort_limit()).all(|(e, limit)| e.abs() <= *limit));
}

/// The power of the feed-forward efforts equals the rate of the kinetic energy.
#[test]
fn inertia_compensation_feeds_the_kinetic_energy_forward() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut dynamics = Dynamics::new(model);
    let mut mass = DMatrix::zeros(model.nv(), model.nv());
    let mut kinetic = |q: &[f64], v: &DVector<f64>| {
        dynamics.crba(model, q, &mut mass);
        0.5 * v.dot(&(&mass * v))
    };
    let mut random = Random(23);
    let dt = 1e-3;
    for _ in 0..5 {
        let q = panda.near_home(0.5, &mut random);
        let (v, a): (Vec<f64>, Vec<f64>) = (0..model.nv())
            .map(|joint| ((0.7 * joint as f64).sin(), 0.5 * (1.3 * joint as f64 + 1.0).cos()))
            .unzip();
        let mut feed_forward = FeedForward::new(model, None).with_inertia(0.0);
        let mut setpoint = SetpointIntegrator::new(model, &q);
        for back in [1.0, 0.0] {
            let velocity: Vec<f64> = v.iter().zip(&a).map(|(v, a)| v - back * a * dt).collect();
            setpoint.reset(&q);
            setpoint.integrate(&velocity, 1e-9);
            feed_forward.update(&setpoint, dt);
        }
        let effort = feed_forward.effort(model, &q, &[], &setpoint).to_vec();
        let (v, a, effort) = (DVector::from_vec(v), DVector::from_vec(a), DVector::from_vec(effort));
        let h = 1e-5;
        let at = |h: f64| (DVector::from_column_slice(&q) + &v * h, &v + &a * h);
        let ((ahead, v_ahead), (behind, v_behind)) = (at(h), at(-h));
        let growth = kinetic(ahead.as_slice(), &v_ahead) - kinetic(behind.as_slice(), &v_behind);
        assert_abs_diff_eq!(effort.dot(&v), growth / (2.0 * h), epsilon = 1e-5);
    }
}

#[test]
fn restarted_setpoint_has_no_acceleration() {
    let panda = Panda::new();
    let mut feed_forward = FeedForward::new(&panda.model, None).with_inertia(0.004);
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    feed_forward.update(&setpoint, 1e-3);
    setpoint.integrate(&vec![0.2; panda.model.nv()], 1e-3);
    feed_forward.update(&setpoint, 1e-3);
    let norm = |effort: &[f64]| DVector::from_column_slice(effort).norm();
    let pushed = norm(feed_forward.effort(&panda.model, panda.home.as_slice(), &[], &setpoint));
    feed_forward.reset();
    feed_forward.update(&setpoint, 1e-3);
    setpoint.hold();
    let calm = norm(feed_forward.effort(&panda.model, panda.home.as_slice(), &[], &setpoint));
    assert!(pushed > 1.0 && calm < 1e-9, "{pushed} {calm}");
}

#[test]
fn without_gravity_and_inertia_no_effort_is_fed_forward() {
    let panda = Panda::new();
    let mut feed_forward = FeedForward::new(&panda.model, None);
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    setpoint.integrate(&vec![0.1; panda.model.nv()], 0.01);
    feed_forward.update(&setpoint, 0.01);
    let effort = feed_forward.effort(&panda.model, panda.home.as_slice(), &[], &setpoint);
    assert_eq!(effort, vec![0.0; panda.model.nv()]);
}

#[test]
fn gains_that_no_drive_can_use_are_refused_by_joint() {
    let panda = Panda::new();
    assert_eq!(check_gains(&panda.model, &panda.gains), Ok(()));
    let mut gains = panda.gains.clone();
    gains.kd[2] = -1.0;
    let (joint, value) = ("panda_joint3".to_owned(), -1.0);
    assert_eq!(check_gains(&panda.model, &gains), Err(GainsError::Value { gain: "kd", joint, value }));
    gains.kp = DVector::zeros(3);
    let expected = panda.model.nv();
    assert_eq!(check_gains(&panda.model, &gains), Err(GainsError::Length { gain: "kp", found: 3, expected }));
}

//! The command a joint drive takes.

mod robot;

use approx::assert_abs_diff_eq;
use motorium_control::{CommandComposer, ComposeError, JointSetpoint};
use motorium_robots::{Dynamics, Kinematics, Model};
use nalgebra::{DMatrix, DVector, Point3, Vector3};
use robot::{Panda, Random};

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
fn gravity_compensation_is_the_gradient_of_the_potential_energy() {
    let panda = Panda::new();
    let model = &panda.model;
    let mut composer = CommandComposer::new(model, &panda.gains, Some(GRAVITY)).unwrap();
    let mut random = Random(11);
    let h = 1e-6;
    for _ in 0..10 {
        let q = panda.near_home(1.0, &mut random);
        let setpoint = JointSetpoint::new(model, panda.home.as_slice());
        let effort = composer.compose(model, &q, &setpoint).effort.clone();
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
    let mut composer = CommandComposer::new(&panda.model, &panda.gains, heavy).unwrap();
    let setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    let command = composer.compose(&panda.model, panda.home.as_slice(), &setpoint);
    let shoulder = command.effort[1].abs();
    assert_eq!(shoulder, panda.model.effort_limit()[1]);
    assert!(command.effort.iter().zip(panda.model.effort_limit()).all(|(e, limit)| e.abs() <= *limit));
}

/// The power of the efforts fed forward is what the kinetic energy grows by.
#[test]
fn compensation_of_inertia_feeds_forward_what_changes_the_kinetic_energy() {
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
        let mut composer = CommandComposer::new(model, &panda.gains, None).unwrap().with_inertia(0.0);
        let mut setpoint = JointSetpoint::new(model, &q);
        for back in [1.0, 0.0] {
            let velocity: Vec<f64> = v.iter().zip(&a).map(|(v, a)| v - back * a * dt).collect();
            setpoint.reset(&q);
            setpoint.integrate(&velocity, 1e-9);
            composer.follow(&setpoint, dt);
        }
        let effort = composer.compose(model, &q, &setpoint).effort.clone();
        let (v, a) = (DVector::from_vec(v), DVector::from_vec(a));
        let h = 1e-5;
        let at = |h: f64| (DVector::from_column_slice(&q) + &v * h, &v + &a * h);
        let ((ahead, v_ahead), (behind, v_behind)) = (at(h), at(-h));
        let growth = kinetic(ahead.as_slice(), &v_ahead) - kinetic(behind.as_slice(), &v_behind);
        assert_abs_diff_eq!(effort.dot(&v), growth / (2.0 * h), epsilon = 1e-5);
    }
}

#[test]
fn a_setpoint_that_begins_anew_has_no_acceleration() {
    let panda = Panda::new();
    let mut composer = CommandComposer::new(&panda.model, &panda.gains, None).unwrap().with_inertia(0.004);
    let mut setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    composer.follow(&setpoint, 1e-3);
    setpoint.integrate(&vec![0.2; panda.model.nv()], 1e-3);
    composer.follow(&setpoint, 1e-3);
    let pushed = composer.compose(&panda.model, panda.home.as_slice(), &setpoint).effort.norm();
    composer.rest();
    composer.follow(&setpoint, 1e-3);
    setpoint.hold();
    let calm = composer.compose(&panda.model, panda.home.as_slice(), &setpoint).effort.norm();
    assert!(pushed > 1.0 && calm < 1e-9, "{pushed} {calm}");
}

#[test]
fn a_command_carries_setpoint_and_gains_and_no_effort_without_compensation() {
    let panda = Panda::new();
    let mut composer = CommandComposer::new(&panda.model, &panda.gains, None).unwrap();
    let mut setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    let v = vec![0.1; panda.model.nv()];
    setpoint.integrate(&v, 0.01);
    let command = composer.compose(&panda.model, panda.home.as_slice(), &setpoint);
    assert_abs_diff_eq!(command.position[0], panda.home[0] + 0.001, epsilon = 1e-15);
    assert_eq!(command.velocity[0], 0.1);
    assert_eq!((&command.kp, &command.kd), (&panda.gains.kp, &panda.gains.kd));
    assert!(command.effort.iter().all(|effort| *effort == 0.0));
}

#[test]
fn gains_that_cannot_be_used_are_refused_by_joint_and_the_old_ones_stay() {
    let panda = Panda::new();
    let mut composer = CommandComposer::new(&panda.model, &panda.gains, None).unwrap();
    let mut gains = panda.gains.clone();
    gains.kd[2] = -1.0;
    let error = composer.set_gains(&panda.model, &gains).unwrap_err();
    assert_eq!(error.to_string(), "kd of joint \"panda_joint3\" is -1, expected a finite number >= 0");
    assert_eq!(composer.command().kd, panda.gains.kd);
    gains.kp = nalgebra::DVector::zeros(3);
    let expected = panda.model.nv();
    assert_eq!(
        composer.set_gains(&panda.model, &gains),
        Err(ComposeError::Length { what: "kp", found: 3, expected })
    );
}

#[test]
fn a_setpoint_stops_at_the_limit_and_says_how_fast_it_really_moved() {
    let panda = Panda::new();
    let mut setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    let upper = panda.model.upper()[0];
    let mut v = vec![0.0; panda.model.nv()];
    v[0] = (upper - panda.home[0]) / 0.1;
    setpoint.integrate(&v, 0.08);
    assert_eq!(setpoint.velocity()[0], v[0]);
    setpoint.integrate(&v, 0.08);
    assert_eq!(setpoint.position()[0], upper);
    assert_abs_diff_eq!(setpoint.velocity()[0], 0.25 * v[0], epsilon = 1e-9);
    setpoint.integrate(&v, 0.08);
    assert_eq!((setpoint.position()[0], setpoint.velocity()[0]), (upper, 0.0));
}

#[test]
fn a_setpoint_does_not_run_away_from_a_blocked_joint() {
    let panda = Panda::new();
    let mut setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    let v = vec![-0.5; panda.model.nv()];
    for _ in 0..100 {
        setpoint.integrate(&v, 0.01);
        setpoint.limit_lead(panda.home.as_slice(), 0.05);
    }
    assert_abs_diff_eq!(setpoint.position()[0], panda.home[0] - 0.05, epsilon = 1e-12);
    assert_eq!(setpoint.velocity()[0], 0.0, "it would go on pushing");
}

#[test]
fn a_velocity_that_is_no_number_moves_no_joint() {
    let panda = Panda::new();
    let mut setpoint = JointSetpoint::new(&panda.model, panda.home.as_slice());
    setpoint.integrate(&vec![f64::NAN; panda.model.nv()], 0.01);
    setpoint.limit_lead(&vec![f64::NAN; panda.model.nv()], 0.05);
    assert_eq!(setpoint.position(), panda.home.as_slice());
    assert!(setpoint.velocity().iter().all(|v| *v == 0.0));
}

//! The joint setpoint stays within limits and near the measured joints.

use approx::assert_abs_diff_eq;
use motorium_control::SetpointIntegrator;

use crate::robot::Panda;

#[test]
fn a_setpoint_stops_at_its_limit_and_reports_its_velocity() {
    let panda = Panda::new();
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
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
fn setpoint_stays_near_a_blocked_joint() {
    let panda = Panda::new();
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    let v = vec![-0.5; panda.model.nv()];
    for _ in 0..100 {
        setpoint.integrate(&v, 0.01);
        setpoint.limit_tracking_error(panda.home.as_slice(), 0.05);
    }
    assert_abs_diff_eq!(setpoint.position()[0], panda.home[0] - 0.05, epsilon = 1e-12);
    assert_eq!(setpoint.velocity()[0], 0.0, "a velocity would continue to push");
}

#[test]
fn nan_velocity_does_not_move_a_joint() {
    let panda = Panda::new();
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    setpoint.integrate(&vec![f64::NAN; panda.model.nv()], 0.01);
    setpoint.limit_tracking_error(&vec![f64::NAN; panda.model.nv()], 0.05);
    assert_eq!(setpoint.position(), panda.home.as_slice());
    assert!(setpoint.velocity().iter().all(|v| *v == 0.0));
}

#[test]
fn a_joint_slightly_outside_its_limit_starts_at_the_limit() {
    let panda = Panda::new();
    let mut setpoint = SetpointIntegrator::new(&panda.model, panda.home.as_slice());
    let mut q = panda.home.clone();
    q[0] = panda.model.upper()[0] + 5e-7;
    q[1] = panda.model.lower()[1] - 0.01;
    setpoint.reset(q.as_slice());
    assert_eq!((setpoint.position()[0], setpoint.position()[1]), (panda.model.upper()[0], q[1]));
}

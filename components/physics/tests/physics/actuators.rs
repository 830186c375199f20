//! Drives with non-ideal actuators.

use std::path::Path;

use motorium_physics::{
    ArticulatedSimulator, BuildError, JointSetpoint, Options, RapierSimulator, RobotSetup, Simulator, World,
};
use motorium_robots::{ActuatorSettings, Envelope, load};

/// A rod of 1 kg and 1 m without gravity, initially at rest.
fn rod(settings: ActuatorSettings) -> ArticulatedSimulator {
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let setup = RobotSetup { actuators: vec![Some(settings)], ..RobotSetup::from(model) };
    let world = World { gravity: [0.0; 3], ..World::default() };
    ArticulatedSimulator::new(setup, world, &[0.0], Options::default()).unwrap()
}

/// Inertia of the rod about its hinge \[kg m2\].
const INERTIA: f64 = 0.083_433_333 + 0.25;

#[test]
fn effort_lags_the_command_by_its_time_constant() {
    let lag = 0.02;
    let mut rod = rod(ActuatorSettings { lag, ..ActuatorSettings::default() });
    rod.commands_mut()[0] = JointSetpoint::effort(3.0);
    let mut impulse = 0.0;
    for step in 1..=200 {
        rod.step(1e-4).unwrap();
        impulse += 1e-4 * rod.efforts()[0];
        let expected = 3.0 * (1.0 - (-1e-4 * f64::from(step) / lag).exp());
        assert!((rod.efforts()[0] - expected).abs() < 0.01, "step {step}: {}, {expected}", rod.efforts()[0]);
    }
    // the reported effort is the acting one
    assert!((INERTIA * rod.velocities()[0] - impulse).abs() < 1e-9);
}

#[test]
fn delayed_command_acts_exactly_after_its_delay() {
    let mut rod = rod(ActuatorSettings { delay: 5e-3, ..ActuatorSettings::default() });
    for step in 0..20 {
        rod.commands_mut()[0] = JointSetpoint::effort(f64::from(step) + 1.0);
        rod.step(1e-3).unwrap();
        let expected = if step < 5 { 0.0 } else { f64::from(step - 5) + 1.0 };
        assert_eq!(rod.efforts()[0], expected.min(10.0), "step {step}");
    }
}

#[test]
fn speed_at_full_effort_approaches_the_no_load_speed() {
    let (stall, no_load) = (8.0, 5.0);
    let envelope = Some(Envelope { stall_effort: stall, no_load_velocity: no_load });
    let mut rod = rod(ActuatorSettings { envelope, ..ActuatorSettings::default() });
    rod.commands_mut()[0] = JointSetpoint::effort(10.0);
    let time_constant = INERTIA * no_load / stall;
    for step in 1..=1000 {
        rod.step(1e-3).unwrap();
        let expected = no_load * (1.0 - (-1e-3 * f64::from(step) / time_constant).exp());
        assert!(
            (rod.velocities()[0] - expected).abs() < 0.01,
            "{step} ms: {}, {expected}",
            rod.velocities()[0]
        );
    }
}

#[test]
fn effort_rate_is_limited_in_every_step() {
    let mut rod = rod(ActuatorSettings { rate_limit: Some(500.0), ..ActuatorSettings::default() });
    for step in 0..40 {
        rod.commands_mut()[0] = JointSetpoint::effort(if step < 20 { 6.0 } else { -6.0 });
        rod.step(1e-3).unwrap();
        let expected =
            if step < 20 { (0.5 * f64::from(step + 1)).min(6.0) } else { 6.0 - 0.5 * f64::from(step - 19) };
        assert!((rod.efforts()[0] - expected).abs() < 1e-9, "step {step}: {}", rod.efforts()[0]);
    }
}

#[test]
fn stiff_gains_behind_a_lag_hold_a_position_stably() {
    let arm = load("panda", Path::new(".")).unwrap();
    let profile = arm.profile.unwrap();
    let (home, gains) = (profile.home(&arm.model).unwrap(), profile.gains(&arm.model).unwrap());
    let settings =
        Some(ActuatorSettings { lag: 1e-3, rate_limit: Some(20_000.0), ..ActuatorSettings::default() });
    let setup = RobotSetup { actuators: vec![settings; 8], ..RobotSetup::from(arm.model) };
    let mut simulator =
        ArticulatedSimulator::new(setup, World::default(), home.as_slice(), Options::default()).unwrap();
    for (joint, command) in simulator.commands_mut().iter_mut().enumerate() {
        *command = JointSetpoint::hold(home[joint], gains.kp[joint], gains.kd[joint]);
    }
    for _ in 0..2000 {
        simulator.step(1e-3).unwrap();
    }
    for (joint, (q, home)) in simulator.positions().iter().zip(&home).enumerate() {
        assert!((q - home).abs() < 0.1, "joint {joint}: {q}, {home}");
    }
    assert!(simulator.velocities().iter().all(|v| v.abs() < 1e-3), "{:?}", simulator.velocities());
}

#[test]
fn saved_state_keeps_delayed_commands_and_reset_drops_them() {
    let settings = ActuatorSettings { delay: 7e-3, lag: 3e-3, ..ActuatorSettings::default() };
    let mut rod = rod(settings);
    let run = |rod: &mut ArticulatedSimulator, from: i32| -> Vec<u64> {
        let step = |step: i32| {
            rod.commands_mut()[0] = JointSetpoint::effort((0.3 * f64::from(step)).sin());
            rod.step(1e-3).unwrap();
            rod.positions()[0].to_bits()
        };
        (from..from + 30).map(step).collect()
    };
    let first = run(&mut rod, 0);
    let saved = rod.save();
    let second = run(&mut rod, 30);
    rod.restore(&saved).unwrap();
    assert_eq!(run(&mut rod, 30), second);
    rod.reset(&[0.0], &[0.0]).unwrap();
    assert_eq!(run(&mut rod, 0), first);
}

#[test]
fn rapier_rejects_non_ideal_actuators() {
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let slow = ActuatorSettings { lag: 1e-3, ..ActuatorSettings::default() };
    let setup = RobotSetup { actuators: vec![Some(slow)], ..RobotSetup::from(model.clone()) };
    let refused = RapierSimulator::new(setup, World::default(), &[0.0], Options::default()).map(drop);
    assert_eq!(refused, Err(BuildError::IdealDrives));
    let bad = ActuatorSettings { lag: -1.0, ..ActuatorSettings::default() };
    let setup = RobotSetup { actuators: vec![Some(bad)], ..RobotSetup::from(model) };
    let refused = ArticulatedSimulator::new(setup, World::default(), &[0.0], Options::default()).map(drop);
    assert!(refused.unwrap_err().to_string().starts_with("actuator of joint \"hinge\": lag = -1"));
}

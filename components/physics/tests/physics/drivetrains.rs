//! Drives behind springs and gears with backlash, and learned actuators, in the articulated engine.

use std::path::Path;
use std::sync::Arc;

use motorium::telemetry::{allocations, counts_allocations};
use motorium_physics::{ArticulatedSimulator, JointSetpoint, Options, RobotSetup, Simulator, World};
use motorium_robots::{
    Activation, ActuatorSettings, Drivetrain, InputOrder, NetworkSettings, NetworkWeights, load,
};

/// A rod of 1 kg and 1 m without gravity, initially at rest.
fn rod(settings: ActuatorSettings) -> ArticulatedSimulator {
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let setup = RobotSetup { actuators: vec![Some(settings)], ..RobotSetup::from(model) };
    let world = World { gravity: [0.0; 3], ..World::default() };
    ArticulatedSimulator::new(setup, world, &[0.0], Options::default()).unwrap()
}

/// Inertia of the rod about its hinge \[kg m2\].
const INERTIA: f64 = 0.083_433_333 + 0.25;

fn elastic(motor_inertia: f64, stiffness: f64) -> Drivetrain {
    Drivetrain { motor_inertia, stiffness, damping: 0.0, backlash: 0.0 }
}

fn behind(drivetrain: Drivetrain) -> ArticulatedSimulator {
    rod(ActuatorSettings { drivetrain: Some(drivetrain), ..ActuatorSettings::default() })
}

#[test]
fn motor_torque_reaches_the_rod_through_its_spring() {
    let (motor, stiffness, torque) = (0.15, 60.0, 2.0);
    let mut rod = behind(elastic(motor, stiffness));
    rod.commands_mut()[0] = JointSetpoint::effort(torque);
    let (whole, h) = (motor + INERTIA, 1e-5);
    let omega = (stiffness * whole / (motor * INERTIA)).sqrt();
    for step in 1..=30_000 {
        rod.step(h).unwrap();
        let time = h * f64::from(step);
        // both accelerate by torque / whole; the twist oscillates about the value that accelerates the rod
        let carried = torque * INERTIA / whole * (1.0 - (omega * time).cos());
        assert!((rod.efforts()[0] - carried).abs() < 0.02, "{time} s: {}, {carried}", rod.efforts()[0]);
        let velocity = torque / whole * (time - (omega * time).sin() / omega);
        assert!((rod.velocities()[0] - velocity).abs() < 0.005, "{time} s: {}", rod.velocities()[0]);
    }
}

#[test]
fn the_rod_moves_freely_in_the_gap_of_a_gear() {
    let teeth = Drivetrain { motor_inertia: 0.1, stiffness: 1e5, damping: 20.0, backlash: 0.04 };
    let mut rod = behind(teeth);
    rod.reset(&[0.0], &[0.4]).unwrap();
    let (h, mut impulse, mut met) = (1e-3, 0.0, None);
    // the motor starts with the joint's velocity: stop it
    for step in 0..1000 {
        rod.commands_mut()[0] = JointSetpoint { kp: 500.0, kd: 50.0, ..JointSetpoint::default() };
        rod.step(h).unwrap();
        impulse += h * rod.efforts()[0];
        assert!((INERTIA * (rod.velocities()[0] - 0.4) - impulse).abs() < 1e-9, "step {step}");
        if rod.efforts()[0] != 0.0 {
            met.get_or_insert(step);
        }
    }
    // half the gap at 0.4 rad/s: 50 ms, plus the motion of the motor in that time
    assert!(met.is_some_and(|step| (45..70).contains(&step)), "{met:?}");
}

#[test]
fn a_pose_is_held_through_a_gear_with_backlash() {
    let arm = load("panda", Path::new(".")).unwrap();
    let profile = arm.profile.unwrap();
    let (home, gains) = (profile.home(&arm.model).unwrap(), profile.gains(&arm.model).unwrap());
    let gear = Drivetrain { motor_inertia: 0.3, stiffness: 2e4, damping: 20.0, backlash: 1e-3 };
    let settings = Some(ActuatorSettings { drivetrain: Some(gear), ..ActuatorSettings::default() });
    let setup = RobotSetup { actuators: vec![settings; 7], ..RobotSetup::from(arm.model) };
    let mut simulator =
        ArticulatedSimulator::new(setup, World::default(), home.as_slice(), Options::default()).unwrap();
    for (joint, command) in simulator.commands_mut().iter_mut().enumerate() {
        *command = JointSetpoint::hold(home[joint], gains.kp[joint], gains.kd[joint]);
    }
    for _ in 0..4000 {
        simulator.step(1e-3).unwrap();
    }
    for (joint, (q, home)) in simulator.positions().iter().zip(&home).enumerate() {
        assert!((q - home).abs() < 0.1, "joint {joint}: {q}, {home}");
    }
    assert!(simulator.velocities().iter().all(|v| v.abs() < 2e-3), "{:?}", simulator.velocities());
}

/// A network of one layer: `effort = 30 error(now) + 5 error(4 ms ago) - 2 velocity(now)`.
fn network() -> Arc<NetworkSettings> {
    let header = br#"{"net.0.weight":{"dtype":"F64","shape":[1,4],"data_offsets":[0,32]},"net.0.bias":{"dtype":"F64","shape":[1],"data_offsets":[32,40]}}"#;
    let mut file = (header.len() as u64).to_le_bytes().to_vec();
    file.extend(header);
    file.extend([30.0_f64, 5.0, -2.0, 0.0, 0.0].iter().flat_map(|number| number.to_le_bytes()));
    Arc::new(NetworkSettings {
        weights: NetworkWeights::read(&file, 4, Activation::Softsign).unwrap(),
        times: vec![0.0, 4e-3],
        input_order: InputOrder::PositionVelocity,
        position_scale: 1.0,
        velocity_scale: 1.0,
        effort_scale: 1.0,
    })
}

#[test]
fn a_network_computes_effort_from_its_history() {
    let mut rod = rod(ActuatorSettings { network: Some(network()), ..ActuatorSettings::default() });
    let (mut errors, mut saturated) = (Vec::new(), 0);
    for step in 0..400 {
        let wanted = if step < 200 { 0.2 } else { -0.3 };
        let (error, v) = (wanted - rod.positions()[0], rod.velocities()[0]);
        errors.push(error);
        // the network uses its own gains and ignores the gains of the command
        rod.commands_mut()[0] = JointSetpoint::hold(wanted, 7.0, 1.0);
        rod.step(1e-3).unwrap();
        let before = errors[errors.len().saturating_sub(5)];
        let asked = 30.0 * error + 5.0 * before - 2.0 * v;
        saturated += usize::from(asked.abs() > 10.0);
        let expected = asked.clamp(-10.0, 10.0);
        assert!((rod.efforts()[0] - expected).abs() < 1e-12, "{step}: {}, {expected}", rod.efforts()[0]);
    }
    assert!(saturated > 0 && errors.last().unwrap().abs() < 0.3, "{saturated}, {errors:?}");
    rod.commands_mut()[0] = JointSetpoint::effort(1.25);
    rod.step(1e-3).unwrap();
    assert_eq!(rod.efforts()[0], 1.25, "a command without a position is one of effort");
}

#[test]
fn drivetrain_state_is_saved_exactly_without_allocation() {
    let gear = Drivetrain { motor_inertia: 0.1, stiffness: 3e3, damping: 1.0, backlash: 0.01 };
    let settings = ActuatorSettings {
        delay: 3e-3,
        lag: 2e-3,
        drivetrain: Some(gear),
        network: Some(network()),
        ..ActuatorSettings::default()
    };
    let mut rod = rod(settings);
    assert!(counts_allocations());
    let mut found = vec![0_u64; 600];
    let mut run = |rod: &mut ArticulatedSimulator, from: i32| -> Vec<u64> {
        let before = allocations().own;
        for (step, found) in (from..).zip(found.chunks_exact_mut(2)) {
            rod.commands_mut()[0] = JointSetpoint::hold((0.03 * f64::from(step)).sin(), 1.0, 0.0);
            rod.step(1e-3).unwrap();
            found.copy_from_slice(&[rod.positions()[0].to_bits(), rod.efforts()[0].to_bits()]);
        }
        assert_eq!(allocations().own, before);
        found.clone()
    };
    let first = run(&mut rod, 0);
    let saved = rod.save();
    let second = run(&mut rod, 300);
    rod.restore(&saved).unwrap();
    assert_eq!(run(&mut rod, 300), second);
    rod.reset(&[0.0], &[0.0]).unwrap();
    assert_eq!(run(&mut rod, 0), first);
}

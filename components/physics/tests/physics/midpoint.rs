//! The midpoint rule against closed forms, against a Runge-Kutta integration of the dynamics, and against
//! Euler's method.

use std::path::Path;

use motorium_physics::{
    ArticulatedSimulator, Ground, Integrator, JointProperties, JointSetpoint, JointSpaceIntegrator,
    MujocoSimulator, Object, ObjectShape, Options, RapierSimulator, Simulator, World,
};
use motorium_robots::{
    Dynamics, LoadOptions, MimicMode, Model, PackagePath, load, parse_urdf, parse_urdf_with,
};
use nalgebra::Vector3;

use crate::engines::has_mujoco;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const METHODS: [Integrator; 2] = [Integrator::Euler, Integrator::Midpoint];

fn options(integrator: Integrator) -> Options {
    Options { integrator, self_collision: false, ..Options::default() }
}

/// A catalogue robot without friction, damping and joint limits.
fn without_losses(name: &str) -> Model {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/catalogue").join(name).join(name);
    let text = std::fs::read_to_string(file.with_extension("urdf")).unwrap();
    let text = text.replace("type=\"revolute\"", "type=\"continuous\"");
    let kept: String =
        text.lines().filter(|line| !line.contains("<dynamics")).map(|line| format!("{line}\n")).collect();
    let floating = name == "quadruped";
    if floating {
        let options = LoadOptions { base: motorium_robots::BaseMode::Floating, ..LoadOptions::default() };
        return parse_urdf_with(&kept, Some(Path::new(".")), &options).unwrap().model;
    }
    parse_urdf(&kept, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

fn energy(model: &Model, q: &[f64], v: &[f64], gravity: Vector3<f64>) -> f64 {
    let mut dynamics = Dynamics::new(model);
    dynamics.kinetic_energy(model, q, v) + dynamics.potential_energy(model, q, gravity)
}

#[test]
fn a_double_pendulum_keeps_energy_better_than_euler() {
    let model = without_losses("double-pendulum");
    let drift = METHODS.map(|method| {
        let mut rods =
            ArticulatedSimulator::new(model.clone(), World::default(), &[2.0, 0.5], options(method)).unwrap();
        rods.commands_mut().fill(JointSetpoint::default());
        let start = energy(&model, rods.configuration(), rods.velocity(), GRAVITY);
        let mut most = 0.0_f64;
        for _ in 0..10_000 {
            rods.step(1e-3).unwrap();
            most = most.max((energy(&model, rods.configuration(), rods.velocity(), GRAVITY) - start).abs());
        }
        // Between hanging and standing, the energy of two rods of 1 kg and 0.5 m differs by 19.62 J.
        most / 19.62
    });
    println!(
        "double pendulum, 10 s: {:.2e} with Euler's method, {:.2e} with the midpoint rule",
        drift[0], drift[1]
    );
    assert!(drift[0] > 1e-2 && drift[1] < 2e-3 * drift[0], "{drift:?}");
}

#[test]
fn half_the_step_has_a_quarter_of_the_error() {
    let model = without_losses("ur5e");
    let n = model.nv();
    let (q0, v0) = (vec![0.3, -1.0, 1.2, 0.4, -0.7, 0.2], vec![0.5, -0.3, 0.8, 1.0, -1.0, 0.4]);
    let seconds = 0.4_f64;
    let mut dynamics = Dynamics::new(&model);
    let mut slope = |state: &[f64]| {
        let (q, v) = state.split_at(n);
        let mut a = vec![0.0; n];
        dynamics.forward(&model, q, v, &vec![0.0; n], GRAVITY, &mut a).unwrap();
        [v, &a].concat()
    };
    let along = |state: &[f64], slope: &[f64], h: f64| -> Vec<f64> {
        state.iter().zip(slope).map(|(x, s)| x + h * s).collect()
    };
    let (mut exact, h) = ([q0.clone(), v0.clone()].concat(), 1e-4);
    for _ in 0..(seconds / h).round() as usize {
        let k1 = slope(&exact);
        let k2 = slope(&along(&exact, &k1, 0.5 * h));
        let k3 = slope(&along(&exact, &k2, 0.5 * h));
        let k4 = slope(&along(&exact, &k3, h));
        for (i, x) in exact.iter_mut().enumerate() {
            *x += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    let joints: Vec<JointProperties> = JointProperties::from_model(&model, 0.0);
    let error = |method: Integrator, h: f64| {
        let mut arm = JointSpaceIntegrator::new(&model, joints.clone()).with_method(method);
        let (mut q, mut v, mut tau) = (q0.clone(), v0.clone(), vec![0.0; n]);
        let commands = vec![JointSetpoint::default(); n];
        for _ in 0..(seconds / h).round() as usize {
            arm.advance(&model, &mut q, &mut v, &commands, GRAVITY, h, &mut tau).unwrap();
        }
        let state = [q, v].concat();
        state.iter().zip(&exact).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    };
    for (method, share) in [(Integrator::Euler, 0.5), (Integrator::Midpoint, 0.25)] {
        let (coarse, fine) = (error(method, 2e-3), error(method, 1e-3));
        println!("{method:?}: {coarse:.2e} at 2 ms, {fine:.2e} at 1 ms");
        assert!((fine / coarse / share - 1.0).abs() < 0.15, "{method:?}: {coarse}, {fine}");
    }
    assert!(error(Integrator::Midpoint, 1e-3) < 0.01 * error(Integrator::Euler, 1e-3));
}

#[test]
fn flying_robot_conserves_energy_and_momentum() {
    let model = without_losses("quadruped");
    let mut v = vec![0.0; model.nv()];
    v[..6].copy_from_slice(&[0.3, -0.2, 0.1, 1.5, -2.0, 1.0]);
    v[6..].iter_mut().enumerate().for_each(|(index, v)| *v = 2.0 * (1.7 * index as f64).sin());
    let world = World { gravity: [0.0; 3], ..World::default() };
    let lost = METHODS.map(|method| {
        let mut robot =
            ArticulatedSimulator::new(model.clone(), world.clone(), &model.neutral(), options(method))
                .unwrap();
        robot.reset(&model.neutral(), &v).unwrap();
        robot.commands_mut().fill(JointSetpoint::default());
        let mut dynamics = Dynamics::new(&model);
        let start = energy(&model, robot.configuration(), robot.velocity(), Vector3::zeros());
        let before = dynamics.momentum(&model, robot.configuration(), robot.velocity());
        let mut most = 0.0_f64;
        for _ in 0..2_000 {
            robot.step(1e-3).unwrap();
            let now = energy(&model, robot.configuration(), robot.velocity(), Vector3::zeros());
            most = most.max((now / start - 1.0).abs());
        }
        let after = dynamics.momentum(&model, robot.configuration(), robot.velocity());
        assert!((after.linear - before.linear).norm() < 1e-9, "{method:?}");
        assert!((after.angular - before.angular).norm() < 1e-9, "{method:?}");
        most
    });
    println!("flying quadruped, 2 s: energy off by {:.2e} with Euler's method, {:.2e}", lost[0], lost[1]);
    assert!(lost[1] < 0.02 * lost[0], "{lost:?}");
}

#[test]
fn drives_of_any_gain_are_stable_and_rest_equally() {
    let arm = load("ur5e", Path::new(".")).unwrap();
    let home = arm.profile.as_ref().unwrap().home(&arm.model).unwrap();
    let goal: Vec<f64> = home.iter().map(|q| q + 0.1).collect();
    for kp in [1e2, 1e4, 1e6, 1e8_f64] {
        // A weak drive without damping oscillates for a long time with both methods.
        for kd in [0.0, 0.05 * kp.min(1e6)].into_iter().filter(|kd| *kd > 0.0 || kp > 1e3) {
            let rest = METHODS.map(|method| {
                let mut robot = ArticulatedSimulator::new(
                    arm.model.clone(),
                    World::default(),
                    home.as_slice(),
                    options(method),
                )
                .unwrap();
                for (command, goal) in robot.commands_mut().iter_mut().zip(&goal) {
                    *command = JointSetpoint::hold(*goal, kp, kd);
                }
                for _ in 0..20_000 {
                    robot.step(1e-3).unwrap();
                }
                let speed = robot.velocity().iter().fold(0.0_f64, |most, v| most.max(v.abs()));
                assert!(speed < 1e-3, "{method:?}, kp {kp}, kd {kd}: still moves at {speed} rad/s");
                robot.positions().to_vec()
            });
            for (one, two) in rest[0].iter().zip(&rest[1]) {
                assert!((one - two).abs() < 1e-4, "kp {kp}, kd {kd}: {one}, {two}");
            }
        }
    }
}

fn box_in_flight(method: Integrator, gravity: [f64; 3]) -> ArticulatedSimulator {
    let brick = Object {
        name: "brick".to_owned(),
        shape: ObjectShape::Box { size: [0.3, 0.2, 0.05] },
        mass: Some(1.0),
        position: [2.0, 0.0, 50.0],
        ..Object::default()
    };
    let world = World { gravity, objects: vec![brick], ..World::default() };
    let pendulum = load("pendulum", Path::new(".")).unwrap().model;
    ArticulatedSimulator::new(pendulum, world, &[0.0], options(method)).unwrap()
}

#[test]
fn object_falls_as_in_closed_form_up_to_rounding() {
    for (method, expected) in [(Integrator::Euler, 0.5 * 9.81 * 2e-3), (Integrator::Midpoint, 0.0)] {
        let mut flight = box_in_flight(method, [0.0, 0.0, -9.81]);
        (0..2000).for_each(|_| _ = flight.step(1e-3).unwrap());
        let brick = flight.object("brick").unwrap();
        let fallen = 50.0 - flight.object_pose(brick).translation.z - 0.5 * 9.81 * 4.0;
        assert!((fallen - expected).abs() < 1e-9, "{method:?}: {fallen} m beyond");
    }
}

#[test]
fn floating_robot_falls_as_in_closed_form_up_to_rounding() {
    let model = without_losses("quadruped");
    let mut robot = ArticulatedSimulator::new(
        model.clone(),
        World::default(),
        &model.neutral(),
        options(Integrator::Midpoint),
    )
    .unwrap();
    let start = robot.configuration()[2];
    for (command, q) in robot.commands_mut().iter_mut().zip(&model.neutral()[7..]) {
        *command = JointSetpoint::hold(*q, 100.0, 1.0);
    }
    (0..1000).for_each(|_| _ = robot.step(1e-3).unwrap());
    let fallen = start - robot.configuration()[2];
    assert!((fallen - 0.5 * 9.81).abs() < 1e-9, "{fallen}");
}

#[test]
fn standing_robot_moves_as_with_eulers_method() {
    let quadruped = load("quadruped", Path::new(".")).unwrap();
    let profile = quadruped.profile.as_ref().unwrap();
    let q = profile.configuration(&quadruped.model, &profile.home).unwrap();
    let gains = profile.gains(&quadruped.model).unwrap();
    let world = World { ground: Some(Ground::default()), ..World::default() };
    let [euler, midpoint] = METHODS.map(|integrator| {
        let options = Options { integrator, ..Options::default() };
        let mut robot =
            ArticulatedSimulator::new(quadruped.model.clone(), world.clone(), q.as_slice(), options).unwrap();
        let home = robot.positions().to_vec();
        for (index, command) in robot.commands_mut().iter_mut().enumerate() {
            *command = JointSetpoint::hold(home[index], gains.kp[index], gains.kd[index]);
        }
        (0..1000).for_each(|_| _ = robot.step(1e-3).unwrap());
        robot.configuration().to_vec()
    });
    assert_eq!(euler, midpoint);
}

#[test]
fn joint_arrives_at_its_stop_without_rebound() {
    let text = r#"<robot name="flap"><link name="base"/>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="flap"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="3" effort="1" velocity="100"/></joint>
  <link name="flap"><inertial><origin xyz="0 0 -0.3"/><mass value="1"/>
    <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;
    let model = parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
    let mut flap =
        ArticulatedSimulator::new(model, World::default(), &[1.0], options(Integrator::Midpoint)).unwrap();
    let mut arrived = false;
    for _ in 0..3000 {
        flap.step(1e-3).unwrap();
        let (q, v) = (flap.positions()[0], flap.velocities()[0]);
        assert!(q > -0.5 - 1e-12, "{q}");
        arrived |= q < -0.5 + 1e-9;
        // Only gravity moves it away again: no faster than from rest at the stop.
        let most = (2.0 * 9.81 * 0.3 / 0.1 * ((-q).cos() - 0.5_f64.cos()).max(0.0)).sqrt();
        assert!(!arrived || v < most + 1e-6, "came back with {v} rad/s at {q}");
    }
    assert!(arrived);
}

#[test]
fn saved_flight_continues_bit_for_bit() {
    let mut flight = box_in_flight(Integrator::Midpoint, [0.3, 0.0, -9.81]);
    (0..100).for_each(|_| _ = flight.step(1e-3).unwrap());
    let saved = flight.save();
    let state = |flight: &ArticulatedSimulator| {
        let brick = flight.object("brick").unwrap();
        (flight.positions()[0].to_bits(), flight.object_pose(brick))
    };
    (0..200).for_each(|_| _ = flight.step(1e-3).unwrap());
    let first = state(&flight);
    flight.restore(&saved).unwrap();
    (0..200).for_each(|_| _ = flight.step(1e-3).unwrap());
    assert_eq!(first, state(&flight));
}

#[test]
fn engines_with_a_fixed_method_reject_the_choice() {
    let pendulum = || load("pendulum", Path::new(".")).unwrap().model;
    let refused = RapierSimulator::new(pendulum(), World::default(), &[0.0], options(Integrator::Midpoint));
    assert!(
        refused
            .map(drop)
            .unwrap_err()
            .to_string()
            .contains("does not support a choice of integration method")
    );
    if has_mujoco() {
        let refused =
            MujocoSimulator::new(pendulum(), World::default(), &[0.0], options(Integrator::Midpoint));
        assert!(
            refused
                .map(drop)
                .unwrap_err()
                .to_string()
                .contains("MuJoCo engine does not support a choice of integration method")
        );
    }
}

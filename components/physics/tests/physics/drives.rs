//! The joint drives: the impedance law, its limits, its stability.

use motorium_physics::{JointSetpoint, Options, Simulator, StepError, World};
use motorium_robots::{Dynamics, MimicMode, Model, PackagePath, parse_urdf};
use nalgebra::{DMatrix, Vector3};

use crate::engines::{Engine, engines};
use crate::panda;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const DT: f64 = 1e-3;
fn options() -> Options {
    Options { self_collision: false, ..Options::default() }
}

fn gravity_torques(model: &Model, q: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; model.nv()];
    Dynamics::new(model).gravity(model, q, GRAVITY, &mut out);
    out
}

fn run(simulation: &mut dyn Simulator, seconds: f64) {
    for _ in 0..(seconds / DT).round() as usize {
        simulation.step(DT).unwrap();
    }
}

/// A block on a rail; its motion is known in closed form.
fn slider(damping: f64, friction: f64, effort: f64) -> Model {
    let urdf = format!(
        r#"<robot name="slider"><link name="rail"/><link name="block"><inertial><mass value="2"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="slide" type="prismatic"><parent link="rail"/><child link="block"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" velocity="3" effort="{effort}"/>
        <dynamics damping="{damping}" friction="{friction}"/></joint></robot>"#
    );
    parse_urdf(&urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn gravity_compensation_alone_holds_the_arm() {
    for engine in engines() {
        let home = panda::home();
        let mut simulation = panda::at_home(engine, World::default(), options());
        for _ in 0..500 {
            let torques = gravity_torques(simulation.model(), simulation.positions());
            for (command, effort) in simulation.commands_mut().iter_mut().zip(torques) {
                *command = JointSetpoint::effort(effort);
            }
            simulation.step(DT).unwrap();
        }
        for (q, home) in simulation.positions().iter().zip(&home) {
            assert!((q - home).abs() < 1e-6, "{engine:?}: {q} instead of {home}");
        }
    }
}

#[test]
fn a_held_arm_settles_where_gains_and_gravity_balance() {
    for engine in engines() {
        let home = panda::home();
        let mut simulation = panda::at_home(engine, World::default(), options());
        panda::command_hold(&mut *simulation, &home);
        run(&mut *simulation, 4.0);
        let gravity = gravity_torques(simulation.model(), simulation.positions());
        for (i, command) in panda::hold(&home).iter().enumerate() {
            let sag = gravity[i] / command.kp;
            let found = home[i] - simulation.positions()[i];
            assert!((found - sag).abs() < 1e-5, "{engine:?} joint {i}: sags {found}, expected {sag}");
            assert!((simulation.efforts()[i] - gravity[i]).abs() < 1e-2, "{engine:?} joint {i}");
        }
    }
}

#[test]
fn gains_of_any_size_are_stable_at_the_wrist() {
    for engine in engines() {
        let home = panda::home();
        let mut simulation = panda::at_home(engine, World::default(), options());
        let mut goal = home.clone();
        goal[6] += 0.01;
        goal[5] -= 0.005;
        for (command, q) in simulation.commands_mut().iter_mut().zip(&goal) {
            *command = JointSetpoint::hold(*q, 20_000.0, 500.0);
        }
        run(&mut *simulation, 2.0);
        for (i, goal) in goal.iter().enumerate() {
            assert!((simulation.positions()[i] - goal).abs() < 5e-3, "{engine:?} joint {i}");
            assert!(simulation.velocities()[i].abs() < 1e-4, "{engine:?} joint {i} still moves");
        }
    }
}

#[test]
fn a_stiff_position_loop_follows_the_closed_form() {
    // m x'' = -kp x - kd x' from x = 0.1: critically damped at 10 rad/s.
    let (m, omega) = (2.0, 10.0);
    for engine in engines() {
        let mut simulation = engine.simulate(slider(0.0, 0.0, 1e3), World::default(), &[0.1], options());
        simulation.commands_mut()[0] = JointSetpoint::hold(0.0, m * omega * omega, 2.0 * m * omega);
        for step in 1..=500 {
            simulation.step(DT).unwrap();
            let t = f64::from(step) * DT;
            let expected = 0.1 * (1.0 + omega * t) * (-omega * t).exp();
            let found = simulation.positions()[0];
            assert!((found - expected).abs() < 1e-3, "{engine:?} at {t} s: {found}, expected {expected}");
        }
    }
}

#[test]
fn velocity_control_settles_against_joint_damping() {
    // Steady state of kd (v_d - v) = damping v.
    for engine in engines() {
        let mut simulation = engine.simulate(slider(5.0, 0.0, 1e3), World::default(), &[-0.9], options());
        simulation.commands_mut()[0] = JointSetpoint { velocity: 0.5, kd: 20.0, ..JointSetpoint::default() };
        run(&mut *simulation, 1.5);
        let expected = 0.5 * 20.0 / 25.0;
        let found = simulation.velocities()[0];
        assert!((found - expected).abs() < 1e-4, "{engine:?}: {found}, expected {expected}");
        assert!((simulation.efforts()[0] - 5.0 * expected).abs() < 1e-2, "{engine:?}");
    }
}

#[test]
fn law_and_feed_forward_keep_the_effort_limit() {
    for engine in engines() {
        let mut simulation = engine.simulate(slider(0.0, 0.0, 8.0), World::default(), &[0.0], options());
        simulation.commands_mut()[0] =
            JointSetpoint { effort: 50.0, ..JointSetpoint::hold(0.5, 5_000.0, 3_000.0) };
        let report = simulation.step(DT).unwrap();
        assert_eq!(report.saturated, 1);
        assert_eq!(simulation.efforts()[0], 8.0);
        // 8 N on 2 kg.
        assert!((simulation.velocities()[0] - 4.0 * DT).abs() < 1e-9, "{engine:?}");
        for _ in 0..8000 {
            simulation.step(DT).unwrap();
            assert!(simulation.efforts()[0].abs() <= 8.0, "{engine:?}: {} N", simulation.efforts()[0]);
        }
        // kp (0.5 - q) + 50 = 0.
        assert!((simulation.positions()[0] - 0.51).abs() < 1e-6, "{engine:?}: {}", simulation.positions()[0]);
    }
}

#[test]
fn reported_effort_matches_the_acceleration() {
    // Newton's second law from outside: M (v1 - v0) / dt + bias + damping v1 = reported effort.
    for engine in engines() {
        let model = panda::loaded().model;
        let mut home = panda::home();
        // Away from its stop, whose reaction would affect every joint.
        home[7] = 0.02;
        // One integration step per step, so that its start and its end are both visible.
        let options = Options { contact_iterations: 1, ..options() };
        let mut simulation = engine.simulate(model.clone(), World::default(), &home, options);
        panda::command_hold(&mut *simulation, &home.iter().map(|q| q + 0.002).collect::<Vec<_>>());
        run(&mut *simulation, 0.01);
        let (q, v) = (simulation.positions().to_vec(), simulation.velocities().to_vec());
        simulation.step(1e-5).unwrap();
        let (mut bias, mut mass) = (vec![0.0; q.len()], DMatrix::zeros(q.len(), q.len()));
        let mut dynamics = Dynamics::new(&model);
        dynamics.bias(&model, &q, &v, GRAVITY, &mut bias);
        dynamics.crba(&model, &q, &mut mass);
        for i in 0..7 {
            let joint_damping = model.joint(i).dynamics.damping;
            let mut moved = bias[i] + joint_damping * simulation.velocities()[i];
            for j in 0..q.len() {
                moved += mass[(i, j)] * (simulation.velocities()[j] - v[j]) / 1e-5;
            }
            let reported = simulation.efforts()[i];
            assert!(
                (moved - reported).abs() < 2e-3 * (1.0 + reported.abs()),
                "{engine:?} {i}: {moved} {reported}"
            );
        }
    }
}

#[test]
fn coulomb_friction_holds_until_it_is_overcome() {
    for engine in engines() {
        let mut simulation = engine.simulate(slider(0.0, 3.0, 1e3), World::default(), &[0.0], options());
        simulation.commands_mut()[0] = JointSetpoint::effort(2.9);
        run(&mut *simulation, 0.2);
        assert!(simulation.positions()[0].abs() < 1e-9, "{engine:?}: {}", simulation.positions()[0]);
        simulation.commands_mut()[0] = JointSetpoint::effort(4.0);
        run(&mut *simulation, 0.2);
        // (4 - 3) N on 2 kg for 0.2 s.
        assert!(
            (simulation.velocities()[0] - 0.1).abs() < 1e-6,
            "{engine:?}: {}",
            simulation.velocities()[0]
        );
        simulation.commands_mut()[0] = JointSetpoint::default();
        run(&mut *simulation, 0.2);
        assert!(simulation.velocities()[0].abs() < 1e-9, "{engine:?}: it comes to rest and stays");
    }
}

#[test]
fn joint_stops_at_its_limit_and_leaves_it() {
    for engine in engines() {
        let overshoot = if engine == Engine::Articulated { 1e-12 } else { 5e-3 };
        let mut simulation = engine.simulate(slider(0.0, 0.0, 1e3), World::default(), &[0.5], options());
        simulation.commands_mut()[0] = JointSetpoint::effort(10.0);
        let mut held = 0;
        for _ in 0..1000 {
            held += simulation.step(DT).unwrap().at_limit;
            assert!(
                simulation.positions()[0] <= 1.0 + overshoot,
                "{engine:?}: {}",
                simulation.positions()[0]
            );
        }
        assert!(held > 400, "{engine:?}: at the limit in {held} steps");
        assert!((simulation.positions()[0] - 1.0).abs() < 1e-3);
        assert!(simulation.velocities()[0].abs() < 1e-3);
        simulation.commands_mut()[0] = JointSetpoint::effort(-10.0);
        run(&mut *simulation, 0.1);
        assert!(simulation.positions()[0] < 0.98, "{engine:?}: {}", simulation.positions()[0]);
    }
}

#[test]
fn joint_beyond_its_limit_returns_without_an_impact() {
    for engine in engines() {
        let mut simulation = engine.simulate(slider(0.0, 0.0, 1e3), World::default(), &[1.1], options());
        assert!(simulation.warnings()[0].to_string().contains("\"slide\" starts at 1.1"));
        let mut fastest = 0.0_f64;
        for _ in 0..500 {
            simulation.step(DT).unwrap();
            fastest = fastest.max(simulation.velocities()[0].abs());
        }
        assert!(fastest < 2.1, "{engine:?}: {fastest} m/s");
        assert!(simulation.positions()[0] < 1.0 + 1e-4, "{engine:?}: {}", simulation.positions()[0]);
    }
}

#[test]
fn the_fingers_move_together() {
    for engine in engines() {
        let model = panda::loaded().model;
        let (left, right) =
            (model.frame("panda_leftfinger").unwrap(), model.frame("panda_rightfinger").unwrap());
        let hand = model.frame("panda_hand").unwrap();
        let mut home = panda::home();
        home[7] = 0.01;
        let mut simulation = engine.simulate(model, World::default(), &home, options());
        home[7] = 0.03;
        panda::command_hold(&mut *simulation, &home);
        run(&mut *simulation, 1.0);
        let y = |frame| {
            let hand = simulation.frame_pose(hand);
            hand.inv_mul(&simulation.frame_pose(frame)).translation.y
        };
        assert!((simulation.positions()[7] - 0.03).abs() < 1e-3, "{engine:?}: {}", simulation.positions()[7]);
        assert!((y(left) - simulation.positions()[7]).abs() < 1e-9);
        assert!((y(left) + y(right)).abs() < 1e-9, "{engine:?}");
    }
}

#[test]
fn non_finite_command_is_rejected_without_effect() {
    let mut simulation = panda::at_home(Engine::Articulated, World::default(), Options::default());
    simulation.commands_mut()[3].effort = f64::NAN;
    let before = simulation.positions().to_vec();
    let error = simulation.step(DT).unwrap_err();
    assert!(matches!(error, StepError::InvalidCommand { joint: 3, .. }), "{error}");
    assert!(error.to_string().contains("panda_joint4"), "{error}");
    assert_eq!(simulation.positions(), before);
    simulation.commands_mut()[3] = JointSetpoint { kp: -1.0, ..JointSetpoint::default() };
    assert!(simulation.step(DT).is_err());
    simulation.commands_mut()[3] = JointSetpoint::default();
    simulation.step(DT).unwrap();
    assert!(matches!(simulation.step(0.0), Err(StepError::InvalidStep(_))));
}

#[test]
fn diverged_state_is_rejected_and_reset_recovers() {
    for engine in engines() {
        let mut simulation = engine.simulate(slider(0.0, 0.0, 1e9), World::default(), &[-1.0], options());
        simulation.commands_mut()[0] = JointSetpoint::effort(1e9);
        let error = (0..100).find_map(|_| simulation.step(DT).err()).expect("the simulation diverges");
        assert!(matches!(error, StepError::Diverged { joint: 0, .. }), "{engine:?}: {error}");
        assert!(simulation.positions()[0].is_finite() && simulation.velocities()[0].abs() <= 100.0);
        simulation.reset(&[0.0], &[0.0]).unwrap();
        run(&mut *simulation, 0.1);
        assert!(simulation.positions()[0].abs() < 1e-9, "{engine:?}");
    }
}

#[test]
fn speed_beyond_the_limit_is_flagged() {
    let mut simulation =
        Engine::Articulated.simulate(slider(0.0, 0.0, 1e3), World::default(), &[-1.0], Options::default());
    simulation.reset(&[-1.0], &[3.5]).unwrap();
    assert_eq!(simulation.step(DT).unwrap().overspeed, 1);
    simulation.reset(&[-1.0], &[2.5]).unwrap();
    assert_eq!(simulation.step(DT).unwrap().overspeed, 0);
}

/// Largest speed of joint `moved` as a fraction of its limit. Its commands change every five milliseconds for
/// a second, while the other joints are held.
fn fastest_under(moved: usize, mut command: impl FnMut(&mut u64) -> JointSetpoint) -> f64 {
    let mut simulation = panda::at_home(Engine::Articulated, World::default(), options());
    let model = simulation.model();
    let (limit, low, high) = (model.velocity_limit()[moved], model.lower()[moved], model.upper()[moved]);
    let home = panda::home();
    for (command, home) in simulation.commands_mut().iter_mut().zip(&home) {
        *command = JointSetpoint::hold(*home, 600.0, 40.0);
    }
    let mut seed = 7_u64;
    let mut fastest = 0.0_f64;
    let mut wanted = JointSetpoint::default();
    for step in 0..1_000 {
        if step % 5 == 0 {
            wanted = command(&mut seed);
        }
        let q = simulation.positions()[moved];
        // As in a command gate: no faster than the joint can be stopped at the end of its range.
        let towards = |distance: f64| (10.0 * limit * distance.max(0.0)).sqrt().clamp(0.05 * limit, limit);
        let (min_velocity, max_velocity) = (-towards(q - low), towards(high - q));
        simulation.commands_mut()[moved] = JointSetpoint { min_velocity, max_velocity, ..wanted };
        simulation.step(DT).unwrap();
        fastest = fastest.max(simulation.velocities()[moved].abs() / limit);
    }
    fastest
}

/// Uniformly distributed in -1 to 1.
fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
}

#[test]
fn drive_keeps_its_velocity_limit_under_any_command() {
    type Commands = fn(&mut u64) -> JointSetpoint;
    let commands: [(&str, Commands); 6] = [
        ("full effort forwards", |_| JointSetpoint::effort(1e9)),
        ("full effort backwards", |_| JointSetpoint::effort(-1e9)),
        ("full effort in alternating directions", |seed| JointSetpoint::effort(1e9 * noise(seed))),
        ("a distant position", |seed| JointSetpoint::hold(10.0 * noise(seed).signum(), 600.0, 0.0)),
        ("a fast velocity", |seed| JointSetpoint {
            velocity: 1e6 * noise(seed),
            kd: 40.0,
            ..JointSetpoint::default()
        }),
        ("stiff gains", |seed| JointSetpoint::hold(noise(seed), 1e12, 1e12)),
    ];
    for (what, command) in commands {
        let shares: Vec<f64> = (0..8).map(|joint| fastest_under(joint, command)).collect();
        assert!(shares.iter().all(|share| *share < 1.05), "{what}: {shares:?} of the velocity limits");
    }
    // Without a velocity limit in the command the same efforts exceed it by far, so the drive law enforces
    // it.
    let mut simulation = panda::at_home(Engine::Articulated, World::default(), options());
    simulation.commands_mut().fill(JointSetpoint::effort(1e9));
    run(&mut *simulation, 0.2);
    let limits = simulation.model().velocity_limit().clone();
    assert!(simulation.velocities().iter().zip(&limits).any(|(v, limit)| v.abs() > 2.0 * limit));
}

#[test]
fn a_velocity_limit_changes_nothing_below_it() {
    let run_with = |limited: bool| {
        let mut simulation = panda::at_home(Engine::Articulated, World::default(), options());
        let limits = simulation.model().velocity_limit().clone();
        let home = panda::home();
        for step in 0..1_000 {
            for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
                let position = home[i] - 0.1 * (1.0 - (f64::from(step) * 3e-3).cos()) * f64::from(i < 7);
                let max_velocity = if limited { limits[i] } else { f64::INFINITY };
                let min_velocity = -max_velocity;
                *command = JointSetpoint {
                    min_velocity,
                    max_velocity,
                    ..JointSetpoint::hold(position, 600.0, 40.0)
                };
            }
            assert_eq!(simulation.step(DT).unwrap().overspeed, 0);
        }
        simulation.positions().to_vec()
    };
    assert_eq!(run_with(true), run_with(false));
}

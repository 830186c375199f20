//! Placed robots: they move as they are placed, and push everything else as driven robots do.

use std::path::Path;

use motorium::telemetry::allocations;
use motorium_physics::{
    ArticulatedSimulator, Ground, JointSetpoint, MujocoSimulator, Object, ObjectShape, Options, ResetError,
    RobotSetup, Simulator, World,
};
use motorium_robots::{Model, load};
use nalgebra::{Isometry3, Vector3};

use crate::conformance::object;
use crate::engines::{Engine, engines, has_mujoco};
use crate::panda;

const DT: f64 = 1e-3;

fn rod() -> Model {
    load("pendulum", Path::new(".")).unwrap().model
}

/// A cube on the ground in the path of a rod that hangs down to 5 cm above the ground.
fn cube_below_the_rod() -> World {
    let cube = object("cube", ObjectShape::Box { size: [0.1; 3] }, Some(0.2), [0.1, 0.0, -1.0]);
    let ground = Some(Ground { height: -1.05, ..Ground::default() });
    World { ground, objects: vec![cube], ..World::default() }
}

fn cube(simulation: &dyn Simulator) -> Vector3<f64> {
    simulation.object_pose(simulation.object("cube").unwrap()).translation.vector
}

/// A state of the robot and the position of the cube after a step.
type Sample = (Vec<f64>, Vec<f64>, Vector3<f64>);

/// A box between two walls in the path of a rod that hangs down to 5 cm above the ground. The walls leave it
/// a quarter of a millimetre on each side: a box pushed at a single point turns away. Only the ground has
/// friction, and the box is too long to tip over.
fn box_below_the_rod() -> World {
    let smooth = |object| Object { friction: 0.0, ..object };
    let wall =
        |name, y| smooth(object(name, ObjectShape::Box { size: [0.8, 0.1, 0.1] }, None, [0.35, y, -1.0]));
    let cube = object("cube", ObjectShape::Box { size: [0.2, 0.1, 0.1] }, Some(0.2), [0.15, 0.0, -1.0]);
    let objects = vec![wall("left", 0.10025), wall("right", -0.10025), Object { friction: 0.2, ..cube }];
    World { ground: Some(Ground { height: -1.05, ..Ground::default() }), objects, ..World::default() }
}

/// Moves the rod by its drive at 0.3 rad/s, so that it pushes the box, and records every step.
fn pushed_by_drives(simulation: &mut dyn Simulator) -> Vec<Sample> {
    let record = |step: u32| {
        let position = 0.2 - 0.3 * DT * f64::from(step);
        simulation.commands_mut()[0] =
            JointSetpoint { velocity: -0.3, ..JointSetpoint::hold(position, 2000.0, 50.0) };
        simulation.step(DT).unwrap();
        (simulation.configuration().to_vec(), simulation.velocity().to_vec(), cube(simulation))
    };
    (0..1500).map(record).collect()
}

/// Returns the largest distance \[m\] between the object of a live run and the object of its twin, which is
/// placed in every recorded state.
fn farthest(live: &[Sample], mut twin: Box<dyn Simulator>) -> f64 {
    let mut worst = 0.0_f64;
    for (q, v, position) in live {
        twin.place_at(0, q, v).unwrap();
        twin.step(DT).unwrap();
        assert_eq!((twin.configuration(), twin.velocity()), (q.as_slice(), v.as_slice()));
        worst = worst.max((cube(&*twin) - position).norm());
    }
    worst
}

#[test]
fn placed_rod_pushes_a_box_like_a_driven_rod() {
    for engine in engines() {
        let options = Options { friction: 0.0, ..Options::default() };
        let simulate = || engine.simulate(rod(), box_below_the_rod(), &[0.2], options);
        let live = pushed_by_drives(&mut *simulate());
        let moved = live.last().unwrap().2.x - 0.15;
        assert!(moved > 0.1, "{engine:?}: the rod pushes the box by {moved} m");
        let worst = farthest(&live, simulate());
        println!("{engine:?}: box within {:.1} um over {moved:.3} m", worst * 1e6);
        assert!(worst < 1e-3, "{engine:?}: {worst} m apart");
    }
}

/// A box on a table next to the hand of a Panda [turned sideways](sideways). The table ends in front of the
/// arm's shoulder, and the box is too long to tip over.
fn box_next_to_the_hand() -> World {
    let table = object("table", ObjectShape::Box { size: [0.3, 0.9, 0.05] }, None, [0.38, 0.25, 0.405]);
    let cube = object("cube", ObjectShape::Box { size: [0.14, 0.12, 0.08] }, Some(0.2), [0.31, 0.11, 0.47]);
    World { objects: vec![table, Object { friction: 0.3, ..cube }], ..World::default() }
}

/// Returns a Panda's home pose with its fingers side by side along x, so that both push along y. One finger
/// alone would not push straight ahead, because a box pushed at a single point turns away.
fn sideways() -> Vec<f64> {
    let mut q = panda::home();
    q[6] += core::f64::consts::FRAC_PI_2;
    q
}

/// Turns the first joint of a Panda by its drive at 0.3 rad/s, so that its hand pushes the box at 9 cm/s.
fn pushed_by_an_arm(simulation: &mut dyn Simulator) -> Vec<Sample> {
    let home = sideways();
    let record = |step: u32| {
        for (command, hold) in simulation.commands_mut().iter_mut().zip(panda::hold(&home)) {
            *command = JointSetpoint { kp: 4.0 * hold.kp, kd: 4.0 * hold.kd, ..hold };
        }
        let turn = &mut simulation.commands_mut()[0];
        (turn.position, turn.velocity) = (home[0] + 0.3 * DT * f64::from(step), 0.3);
        simulation.step(DT).unwrap();
        (simulation.configuration().to_vec(), simulation.velocity().to_vec(), cube(simulation))
    };
    (0..2000).map(record).collect()
}

#[test]
fn placed_arm_pushes_a_box_like_a_driven_arm() {
    // In MuJoCo the fingers chatter, and the free box turns away from them differently in each run.
    for engine in [Engine::Articulated, Engine::Rapier] {
        let model = panda::loaded().model;
        let simulate =
            || engine.simulate(model.clone(), box_next_to_the_hand(), &sideways(), Options::default());
        let live = pushed_by_an_arm(&mut *simulate());
        let moved = live.last().unwrap().2.y - 0.11;
        assert!(moved > 0.05, "{engine:?}: the hand pushes the box by {moved} m");
        let worst = farthest(&live, simulate());
        println!("{engine:?}: box within {:.1} um over {moved:.3} m", worst * 1e6);
        assert!(worst < 1e-3, "{engine:?}: {worst} m apart");
    }
}

#[test]
fn placed_state_ends_every_step_exactly() {
    for engine in engines() {
        let home = panda::home();
        let mut simulation =
            engine.simulate(panda::loaded().model, World::default(), &home, Options::default());
        for step in 0..50 {
            let wave = |i: usize, phase: f64| 0.3 * (0.07 * f64::from(step) + i as f64 + phase).sin();
            let q: Vec<f64> = home.iter().enumerate().map(|(i, q)| q + wave(i, 0.0)).collect();
            let v: Vec<f64> = (0..home.len()).map(|i| 7.0 * wave(i, 1.6)).collect();
            simulation.commands_mut().fill(JointSetpoint::effort(30.0));
            simulation.place_at(0, &q, &v).unwrap();
            assert_eq!((simulation.positions(), simulation.velocities()), (q.as_slice(), v.as_slice()));
            for _ in 0..2 {
                let report = simulation.step(DT).unwrap();
                assert_eq!((report.saturated, report.at_limit), (0, 0), "{engine:?}");
                assert_eq!(simulation.positions(), q, "{engine:?}");
                assert_eq!(simulation.velocities(), v, "{engine:?}");
                assert_eq!(simulation.efforts(), [0.0; 8], "{engine:?}");
            }
        }
    }
}

/// Two rods in one plane, half a metre apart, and a ball that flies past them.
fn two_rods(engine: &str) -> Box<dyn Simulator> {
    let ball = Object {
        velocity: [1.0, 0.0, 2.0],
        ..object("cube", ObjectShape::Sphere { radius: 0.05 }, Some(0.3), [0.0, 3.0, 0.0])
    };
    let world = World { objects: vec![ball], ..World::default() };
    let second = rod().placed(&Isometry3::translation(0.5, 0.0, 0.0));
    let robots = [rod().prefixed("one/"), second.prefixed("two/")].map(RobotSetup::from);
    let (q, options) = ([0.5, 0.1], Options::default());
    match engine {
        "MuJoCo" => Box::new(MujocoSimulator::of_robots(robots, world, &q, options).unwrap()),
        _ => Box::new(ArticulatedSimulator::of_robots(robots, world, &q, options).unwrap()),
    }
}

/// Engines with several articulations.
fn engines_of_several() -> impl Iterator<Item = &'static str> {
    ["articulated"].into_iter().chain(has_mujoco().then_some("MuJoCo"))
}

#[test]
fn objects_and_other_robots_continue_across_placements() {
    for engine in engines_of_several() {
        let (mut free, mut placed) = (two_rods(engine), two_rods(engine));
        for step in 0..200 {
            let angle = 0.5 + 1e-3 * f64::from(step);
            placed.place_at(0, &[angle], &[1.0]).unwrap();
            free.step(DT).unwrap();
            placed.step(DT).unwrap();
            let apart = (cube(&*free) - cube(&*placed)).norm();
            assert!(apart < 1e-12, "{engine}: the ball is {apart} m away after step {step}");
            let apart = (free.positions()[1] - placed.positions()[1]).abs();
            assert!(apart < 1e-12, "{engine}: the other rod is {apart} rad away after step {step}");
        }
        assert!(cube(&*placed).x > 0.19, "{engine}: the ball flies");
        assert!((free.positions()[0] - placed.positions()[0]).abs() > 0.1, "{engine}");
    }
}

#[test]
fn placed_robot_pushes_another_robot() {
    for engine in engines_of_several() {
        let mut simulation = two_rods(engine);
        simulation.set_gravity(Vector3::zeros());
        for step in 0..1200 {
            let angle = 0.5 - 1e-3 * f64::from(step);
            simulation.place_at(0, &[angle], &[-1.0]).unwrap();
            simulation.step(DT).unwrap();
            assert_eq!((simulation.positions()[0], simulation.velocities()[0]), (angle, -1.0), "{engine}");
        }
        let other = simulation.positions()[1];
        assert!(other < -0.1, "{engine}: the other rod is at {other} rad");
    }
}

#[test]
fn placed_base_pushes_a_ball_along() {
    for engine in engines_of_several() {
        let model = load("quadruped", Path::new(".")).unwrap().model;
        let ball = object("cube", ObjectShape::Sphere { radius: 0.1 }, Some(0.2), [0.6, 0.0, 0.1]);
        let world = World { ground: Some(Ground::default()), objects: vec![ball], ..World::default() };
        let (mut q, mut v) = (model.neutral(), vec![0.0; model.nv()]);
        q[2] = 0.4;
        let mut simulation: Box<dyn Simulator> = match engine {
            "MuJoCo" => Box::new(MujocoSimulator::new(model, world, &q, Options::default()).unwrap()),
            _ => Box::new(ArticulatedSimulator::new(model, world, &q, Options::default()).unwrap()),
        };
        // It glides with its trunk at the height of the ball.
        q[2] = 0.15;
        v[0] = 0.5;
        for step in 0..1500 {
            q[0] = 0.5 * DT * f64::from(step);
            simulation.place_at(0, &q, &v).unwrap();
            simulation.step(DT).unwrap();
            assert_eq!((simulation.configuration(), simulation.velocity()), (&q[..], &v[..]), "{engine}");
        }
        let ball = cube(&*simulation);
        assert!(ball.x > 0.75, "{engine}: {ball}");
    }
}

#[test]
fn released_rod_falls_from_its_placed_state() {
    for engine in engines() {
        let simulate = || engine.simulate(rod(), World::default(), &[0.0], Options::default());
        let (mut falling, mut released) = (simulate(), simulate());
        falling.reset(&[0.8], &[0.5]).unwrap();
        released.place_at(0, &[0.8], &[0.5]).unwrap();
        for _ in 0..20 {
            released.step(DT).unwrap();
        }
        released.release(0);
        released.release(0);
        for _ in 0..200 {
            falling.step(DT).unwrap();
            released.step(DT).unwrap();
        }
        let apart = (falling.positions()[0] - released.positions()[0]).abs();
        assert!(apart < 1e-9, "{engine:?}: {apart} rad apart");
        assert!(released.positions()[0] < 0.75, "{engine:?}");
    }
}

#[test]
fn reset_ends_a_placement() {
    for engine in engines() {
        let mut simulation = engine.simulate(rod(), World::default(), &[0.0], Options::default());
        simulation.place_at(0, &[0.8], &[0.0]).unwrap();
        assert!(simulation.articulations()[0].is_placed());
        simulation.step(DT).unwrap();
        assert_eq!(simulation.positions(), [0.8], "{engine:?}: it does not fall");
        simulation.reset(&[0.8], &[0.0]).unwrap();
        assert!(!simulation.articulations()[0].is_placed());
        simulation.step(DT).unwrap();
        assert!(simulation.velocities()[0] < -1e-3, "{engine:?}: it falls");
    }
}

#[test]
fn saved_placement_continues_bit_for_bit() {
    for engine in engines() {
        let mut simulation = engine.simulate(rod(), cube_below_the_rod(), &[0.2], Options::default());
        let sweep = |simulation: &mut dyn Simulator, steps: core::ops::Range<u32>| {
            for step in steps {
                simulation.place_at(0, &[0.2 - 5e-4 * f64::from(step)], &[-0.5]).unwrap();
                simulation.step(DT).unwrap();
            }
            (simulation.positions().to_vec(), cube(simulation))
        };
        sweep(&mut *simulation, 0..400);
        let saved = simulation.save();
        let before = sweep(&mut *simulation, 400..500);
        simulation.release(0);
        simulation.step(DT).unwrap();
        simulation.restore(&saved).unwrap();
        assert!(simulation.articulations()[0].is_placed());
        assert_eq!(sweep(&mut *simulation, 400..500), before, "{engine:?}");
    }
}

#[test]
fn invalid_placements_change_nothing() {
    for engine in engines() {
        let mut simulation = engine.simulate(rod(), World::default(), &[0.3], Options::default());
        let long = simulation.place_at(0, &[0.1, 0.2], &[0.0]).unwrap_err();
        assert!(matches!(long, ResetError::Length { positions: 2, velocities: 1, expected: (1, 1) }));
        let missing = simulation.place_at(0, &[f64::NAN], &[0.0]).unwrap_err();
        assert!(matches!(missing, ResetError::NotFinite { joint: 0, .. }), "{missing}");
        assert_eq!(simulation.positions(), [0.3], "{engine:?}");
        assert!(!simulation.articulations()[0].is_placed(), "{engine:?}");
    }
}

#[test]
fn steps_of_a_placed_robot_allocate_nothing() {
    let mut simulation =
        ArticulatedSimulator::new(rod(), cube_below_the_rod(), &[0.2], Options::default()).unwrap();
    let mut before = 0;
    for step in 0..1500 {
        if step == 20 {
            before = allocations().own;
        }
        simulation.place_at(0, &[0.2 - 3e-4 * f64::from(step)], &[-0.3]).unwrap();
        simulation.step(DT).unwrap();
    }
    assert_eq!(allocations().own - before, 0);
    assert!(cube(&simulation).x > 0.15, "the rod pushes the cube");
}

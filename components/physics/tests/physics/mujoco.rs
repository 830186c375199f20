//! The MuJoCo engine against the articulated engine: the same motion without contacts, and the same rest and
//! slip with contacts.
//!
//! Every test here reports when it is skipped: MuJoCo's library is not part of the repository.

use std::path::Path;
use std::process::Command;

use motorium_physics::{
    ArticulatedSimulator, BuildError, Ground, JointSetpoint, MujocoSimulator, Object, ObjectShape, Options,
    RobotSetup, Simulator, Terrain, World,
};
use motorium_robots::{Model, load};
use nalgebra::{Point3, UnitQuaternion, Vector3};

use crate::engines::{Engine, has_mujoco};
use crate::{legged, panda};

const DT: f64 = 1e-3;
const BOTH: [Engine; 2] = [Engine::Articulated, Engine::Mujoco];

/// One integration step per step, without self-collision.
fn plain_options() -> Options {
    Options { contact_iterations: 1, self_collision: false, ..Options::default() }
}

/// The largest difference between two lists of numbers.
fn apart(one: &[f64], two: &[f64]) -> f64 {
    assert_eq!(one.len(), two.len());
    one.iter().zip(two).fold(0.0, |most, (a, b)| most.max((a - b).abs()))
}

#[test]
fn pendulum_swings_as_in_the_articulated_engine() {
    if !has_mujoco() {
        return;
    }
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let [ours, theirs] = BOTH.map(|engine| {
        let mut simulation = engine.simulate(model.clone(), World::default(), &[1.2], plain_options());
        (0..1000).for_each(|_| _ = simulation.step(DT).unwrap());
        [simulation.positions()[0], simulation.velocities()[0]]
    });
    println!("{ours:?} {theirs:?}");
    assert!(apart(&ours, &theirs) < 1e-9, "{ours:?} and {theirs:?}");
}

#[test]
fn driven_panda_moves_as_in_the_articulated_engine() {
    if !has_mujoco() {
        return;
    }
    let mut home = panda::home();
    home[7] = 0.02;
    let [ours, theirs] = BOTH.map(|engine| {
        let mut simulation = engine.simulate(panda::loaded().model, World::default(), &home, plain_options());
        for step in 0..1000 {
            let phase = 4e-3 * f64::from(step);
            let goal: Vec<f64> = home.iter().map(|q| q + 0.2 * (1.0 - phase.cos())).collect();
            panda::command_hold(&mut *simulation, &goal);
            simulation.commands_mut()[7] = JointSetpoint::hold(0.02, 500.0, 20.0);
            simulation.step(DT).unwrap();
        }
        [simulation.positions(), simulation.velocities(), simulation.efforts()].map(<[f64]>::to_vec)
    });
    let [q, v, tau] = [0, 1, 2].map(|index| apart(&ours[index], &theirs[index]));
    println!("positions {q:.1e}, velocities {v:.1e}, efforts {tau:.1e}");
    assert!(q < 1e-6 && v < 1e-5 && tau < 1e-3, "{q} {v} {tau}");
}

/// A quadruped that tumbles and kicks in the air: base, joints and all velocities after a second, in steps of
/// `h`.
fn tumble(engine: Engine, h: f64) -> Vec<f64> {
    let robot = load("quadruped", Path::new(".")).unwrap();
    let mut q = robot.model.neutral();
    q[2] = 20.0;
    let mut v = vec![0.0; robot.model.nv()];
    v[..6].copy_from_slice(&[0.5, -0.3, 2.0, 0.6, -1.0, 0.4]);
    let mut simulation = engine.simulate(robot.model, World::default(), &q, plain_options());
    simulation.reset(&q, &v).unwrap();
    let steps = (1.0 / h).round() as u32;
    for step in 0..steps {
        for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
            let goal = 0.2 * (5.0 * h * f64::from(step) + i as f64).sin();
            *command = JointSetpoint::hold(goal, 6.0, 0.2);
        }
        simulation.step(h).unwrap();
    }
    simulation.configuration().iter().chain(simulation.velocity()).copied().collect()
}

#[test]
fn a_tumbling_tree_agrees_between_engines() {
    if !has_mujoco() {
        return;
    }
    // Both methods are of first order: twice the result of the half step minus the result of the whole step
    // is of second order.
    let [ours, theirs] = BOTH.map(|engine| {
        let (coarse, fine) = (tumble(engine, 2e-4), tumble(engine, 1e-4));
        coarse.iter().zip(&fine).map(|(coarse, fine)| 2.0 * fine - coarse).collect::<Vec<_>>()
    });
    let (q, v) = (apart(&ours[..19], &theirs[..19]), apart(&ours[19..], &theirs[19..]));
    println!("configuration {q:.1e}, velocity {v:.1e}");
    assert!(q < 1e-6 && v < 1e-5, "{q} {v}");
}

#[test]
fn floating_first_step_matches_the_articulated_engine() {
    if !has_mujoco() {
        return;
    }
    for name in ["quadruped", "humanoid", "quadrotor"] {
        let robot = load(name, Path::new(".")).unwrap();
        let setup = RobotSetup::from_loaded(&robot).unwrap();
        let model = robot.model;
        let mut q = model.neutral();
        let turned = UnitQuaternion::from_euler_angles(0.4, -0.7, 1.1);
        q[2] = 5.0;
        q[3..7].copy_from_slice(turned.coords.as_slice());
        let inside = |(low, high): (&f64, &f64)| 0.4 * low.max(-1.0) + 0.6 * high.min(1.0);
        let joints: Vec<f64> = model.lower().iter().zip(model.upper().iter()).map(inside).collect();
        q[7..].copy_from_slice(&joints);
        let v: Vec<f64> = (0..model.nv()).map(|i| (1.7 * i as f64 + 0.3).sin()).collect();
        let h = 1e-6;
        let step = |simulation: &mut dyn Simulator| {
            simulation.reset(&q, &v).unwrap();
            for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
                *command = JointSetpoint::effort(1.0 + (0.9 * i as f64).sin());
            }
            simulation.step(h).unwrap();
            let gained = simulation.velocity().iter().zip(&v).map(|(after, before)| (after - before) / h);
            gained.collect::<Vec<f64>>()
        };
        let ours = step(
            &mut ArticulatedSimulator::new(setup.clone(), World::default(), &q, plain_options()).unwrap(),
        );
        let theirs = step(&mut MujocoSimulator::new(setup, World::default(), &q, plain_options()).unwrap());
        let scale = ours.iter().fold(1.0_f64, |most, a| most.max(a.abs()));
        let difference = apart(&ours, &theirs) / scale;
        println!("{name}: {difference:.1e} of the largest acceleration");
        assert!(difference < 1e-5, "{name}: {ours:?} and {theirs:?}");
    }
}

/// A catalogue robot on the ground, held at home by its gains, after this number of milliseconds.
fn settled(name: &str, milliseconds: usize) -> (MujocoSimulator, ArticulatedSimulator) {
    let robot = load(name, Path::new(".")).unwrap();
    let mut ours = legged::held(name);
    ours.place_on_ground();
    let (setup, world) = (RobotSetup::from_loaded(&robot).unwrap(), legged::grounded(vec![]));
    let mut theirs = MujocoSimulator::new(setup, world, ours.configuration(), Options::default()).unwrap();
    theirs.commands_mut().copy_from_slice(ours.commands_mut());
    for _ in 0..milliseconds {
        ours.step(DT).unwrap();
        theirs.step(DT).unwrap();
    }
    (theirs, ours)
}

#[test]
fn legged_robots_rest_equally_on_both_engines() {
    if !has_mujoco() {
        return;
    }
    for name in ["quadruped", "hexapod"] {
        let (theirs, ours) = settled(name, 2000);
        let (a, b) = (theirs.base_pose(), ours.base_pose());
        let (moved, turned) =
            ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation));
        let mut up = 0.0;
        theirs.visit_contacts(&mut |contact| {
            let on_robot = contact.normal * contact.force + contact.friction;
            up += if contact.second == "ground" { -on_robot.z } else { on_robot.z };
        });
        println!("{name}: {moved:.1e} m and {turned:.1e} rad apart, {up} N");
        assert!(moved < 1.5e-3 && turned < 2e-3, "{name}: {moved} m, {turned} rad");
        let weight = 9.81 * theirs.model().mass();
        assert!((up - weight).abs() < 0.01 * weight, "{name}: {up} N carry {weight} N");
        assert!(theirs.velocity().iter().all(|v| v.abs() < 1e-2), "{:?}", theirs.velocity());
    }
}

/// A free box of 2 kg, 0.2 x 0.3 x 0.1 m.
fn block() -> Model {
    legged::body(r#"<box size="0.2 0.3 0.1"/>"#)
}

#[test]
fn block_slides_as_in_closed_form_and_articulated() {
    if !has_mujoco() {
        return;
    }
    let ground = Some(Ground { friction: 0.3, ..Ground::default() });
    let (world, options) =
        (World { ground, ..World::default() }, Options { friction: 0.3, ..Options::default() });
    let start = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
    let [ours, theirs] = BOTH.map(|engine| {
        let mut simulation = engine.simulate(block(), world.clone(), &start, options);
        simulation.reset(&start, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        (0..1000).for_each(|_| _ = simulation.step(DT).unwrap());
        simulation.configuration()[0]
    });
    let expected = 1.0 / (2.0 * 0.3 * 9.81);
    println!("{theirs} m, ours {ours} m, expected {expected} m");
    assert!((theirs - ours).abs() < 0.02 * ours && (theirs - expected).abs() < 0.02 * expected);
}

#[test]
fn a_block_on_a_slope_keeps_to_the_friction_cone() {
    if !has_mujoco() {
        return;
    }
    let angle = 0.5_f64;
    let gravity = [9.81 * angle.sin(), 0.0, -9.81 * angle.cos()];
    let start = [0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 1.0];
    let slide = |friction: f64| {
        let ground = Some(Ground { friction, ..Ground::default() });
        let world = World { gravity, ground, ..World::default() };
        let options = Options { friction, ..Options::default() };
        let mut simulation = Engine::Mujoco.simulate(block(), world, &start, options);
        (0..1000).for_each(|_| _ = simulation.step(DT).unwrap());
        simulation.configuration()[0]
    };
    // MuJoCo's friction is soft: a held block creeps.
    let (holds, slides) = (slide(0.6), slide(0.4));
    let expected = 0.5 * 9.81 * (angle.sin() - 0.4 * angle.cos());
    println!("crept {holds} m, slid {slides} m of {expected} m");
    assert!(holds < 0.01 * expected && (slides - expected).abs() < 0.02 * expected);
}

#[test]
fn ball_rebounds_with_its_restitution() {
    if !has_mujoco() {
        return;
    }
    for restitution in [0.3, 0.5, 0.8] {
        // The mean of 0 (the robot's) and twice the value, up to 1; beyond that, two objects with the same
        // value.
        let ball = Object {
            name: "ball".to_owned(),
            shape: ObjectShape::Sphere { radius: 0.1 },
            mass: Some(1.0),
            position: [1.0, 0.0, 0.6],
            friction: 0.5,
            restitution,
            ..Object::default()
        };
        let ground = Some(Ground { restitution, ..Ground::default() });
        let world = World { ground, objects: vec![ball], ..World::default() };
        let mut simulation = panda::at_home(Engine::Mujoco, world, Options::default());
        let ball = simulation.object("ball").unwrap();
        let (mut before, mut after) = (0.0_f64, 0.0_f64);
        for _ in 0..450 {
            simulation.step(DT).unwrap();
            let up = simulation.object_velocity(ball).0.z;
            before = before.max(-up);
            after = after.max(up);
        }
        println!("restitution {restitution}: {:.3}", after / before);
        assert!((after / before - restitution).abs() < 0.05, "{restitution}: {}", after / before);
    }
}

#[test]
fn external_forces_and_rotors_change_momentum() {
    if !has_mujoco() {
        return;
    }
    let model = block();
    let start = [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0];
    let mut simulation =
        MujocoSimulator::new(model, World { gravity: [0.0; 3], ..World::default() }, &start, plain_options())
            .unwrap();
    let base = simulation.model().frame("body").unwrap();
    for step in 0..200 {
        if step < 100 {
            simulation.apply_wrench(
                base,
                Point3::new(0.0, 0.1, 0.0),
                Vector3::new(3.0, 0.0, 1.0),
                Vector3::zeros(),
            );
        }
        simulation.step(DT).unwrap();
    }
    // 3 and 1 N for 0.1 s on 2 kg, with an arm of 0.1 m; the block rotates slightly in that time.
    let linear = simulation.base_pose().rotation * Vector3::from_column_slice(&simulation.velocity()[..3]);
    assert!((linear - Vector3::new(0.15, 0.0, 0.05)).norm() < 1e-6, "{linear}");
    let turn = simulation.velocity()[5];
    assert!((turn + 0.1 * 3.0 / 0.008 * 0.1).abs() < 0.1, "{turn} rad/s about z");

    let quadrotor = load("quadrotor", Path::new(".")).unwrap();
    let setup = RobotSetup::from_loaded(&quadrotor).unwrap();
    let (count, weight) = (setup.rotors.len(), 9.81 * quadrotor.model.mass());
    let mut q = quadrotor.model.neutral();
    q[2] = 1.0;
    let mut simulation = MujocoSimulator::new(setup, World::default(), &q, plain_options()).unwrap();
    simulation.commands_mut().fill(JointSetpoint::effort(weight / count as f64));
    (0..1000).for_each(|_| _ = simulation.step(DT).unwrap());
    let pose = simulation.base_pose();
    assert!((pose.translation.z - 1.0).abs() < 1e-3 && pose.rotation.angle() < 1e-2, "{pose}");
}

#[test]
fn balls_touch_a_terrain_at_its_height_everywhere() {
    if !has_mujoco() {
        return;
    }
    // Longer along x than along y, off the origin, and different in every quadrant, to detect mirrored or
    // rotated terrain.
    let text = "size = [6.0, 3.0]\ncentre = [0.5, 0.25]\nlayers = [{ equation = { height = '0.1 * x + 0.3 * sin(x) * y' } }]";
    let terrain: Terrain = toml::from_str(text).unwrap();
    let field = terrain.height_field().unwrap();
    let places = [[1.5, 1.0], [1.5, -0.8], [-1.2, 1.1], [-1.2, -0.7]];
    let radius = 0.1;
    let ball = |(index, place): (usize, &[f64; 2])| Object {
        name: format!("ball {index}"),
        shape: ObjectShape::Sphere { radius },
        mass: Some(1.0),
        position: [place[0], place[1], field.height(place[0], place[1]) + 0.15],
        ..Object::default()
    };
    let objects: Vec<Object> = places.iter().enumerate().map(ball).collect();
    let world = World { terrain: Some(terrain), objects, ..World::default() };
    // A robot that falls from far above in the meantime.
    let q = [0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0];
    let mut simulation = Engine::Mujoco.simulate(block(), world, &q, plain_options());
    let (mut lowest, mut touched) = ([f64::INFINITY; 4], [false; 4]);
    for _ in 0..400 {
        simulation.step(DT).unwrap();
        for index in 0..4 {
            let name = format!("ball {index}");
            let place = simulation.object_pose(simulation.object(&name).unwrap()).translation.vector;
            let (height, normal) = (field.height(place.x, place.y), field.normal(place.x, place.y));
            lowest[index] = lowest[index].min((place.z - height) * normal.z - radius);
            touched[index] |= simulation.touching(&name, "terrain");
        }
    }
    println!("gaps {lowest:?}");
    assert!(touched.iter().all(|touched| *touched), "{touched:?}");
    assert!(lowest.iter().all(|gap| gap.abs() < 3e-3), "{lowest:?}");
}

#[test]
fn unsupported_features_are_rejected_by_name() {
    if !has_mujoco() {
        return;
    }
    // No mass and inertia behind a joint.
    let urdf = r#"<robot name="thin"><link name="wall"/><link name="rod"/><joint name="hinge" type="revolute">
        <parent link="wall"/><child link="rod"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/>
        </joint></robot>"#;
    let model = motorium_robots::parse_urdf(
        urdf,
        None,
        motorium_robots::MimicMode::Follow,
        &motorium_robots::PackagePath::default(),
    );
    let refused = MujocoSimulator::new(model.unwrap().model, World::default(), &[0.0], plain_options());
    let error = refused.err().unwrap();
    assert!(matches!(&error, BuildError::Refused { .. }), "{error}");
    assert!(error.to_string().contains("rejects the model: error 'inertia must have positive"), "{error}");
}

/// The variable that names the library is read once per process, so this test starts another process.
#[test]
fn a_library_that_is_not_there_is_named_with_what_to_install() {
    const IN_CHILD: &str = "MOTORIUM_PHYSICS_NO_MUJOCO";
    if std::env::var_os(IN_CHILD).is_some() {
        let built =
            MujocoSimulator::new(panda::loaded().model, World::default(), &panda::home(), plain_options());
        println!("the answer: {}", built.err().unwrap());
        return;
    }
    let test = "mujoco::a_library_that_is_not_there_is_named_with_what_to_install";
    let answer = |variable: Option<&str>| {
        let mut child = Command::new(std::env::current_exe().unwrap());
        child.args([test, "--exact", "--nocapture"]).env_clear().env(IN_CHILD, "1").env("HOME", "/nowhere");
        variable.map(|value| child.env("MOTORIUM_MUJOCO", value));
        String::from_utf8(child.output().unwrap().stdout).unwrap()
    };
    let elsewhere = answer(Some("/no/such/folder"));
    let expected =
        "MOTORIUM_MUJOCO is set to `/no/such/folder`, which does not contain `libmujoco.so.3.17.0`";
    assert!(elsewhere.contains(expected) && elsewhere.contains("pip install mujoco==3.17.0"), "{elsewhere}");
    if !Path::new("/usr/lib/libmujoco.so.3.17.0").exists()
        && !Path::new("/usr/local/lib/libmujoco.so.3.17.0").exists()
    {
        let missing = answer(None);
        assert!(
            missing.contains("`libmujoco.so.3.17.0` was not found; install it with `pip install"),
            "{missing}"
        );
    }
    let other = answer(Some("/dev/null"));
    assert!(other.contains("MOTORIUM_MUJOCO is set to `/dev/null`"), "{other}");
}

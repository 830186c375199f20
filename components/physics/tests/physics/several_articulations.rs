//! Several robots in one simulation, some with a floating base: each moves as if alone until they touch, and
//! then they push each other as bodies do.

use std::path::Path;

use motorium_physics::{
    ArticulatedSimulator, BuildError, Engine, Ground, JointSetpoint, MujocoSimulator, Object, ObjectShape,
    Options, RapierSimulator, RobotSetup, Simulation, Simulator, StepError, World,
};
use motorium_robots::load;
use nalgebra::{Point3, Vector3};

use crate::engines::has_mujoco;
use crate::legged::{body, grounded};

/// A catalogue robot in its home pose at position `at`, and the commands that hold it there.
struct Held {
    setup: RobotSetup,
    q: Vec<f64>,
    commands: Vec<JointSetpoint>,
}

fn held(name: &str, prefix: &str, at: [f64; 3]) -> Held {
    let robot = load(name, Path::new(".")).unwrap();
    let profile = robot.profile.as_ref().unwrap();
    let mut q = profile.configuration(&robot.model, &profile.home).unwrap().as_slice().to_vec();
    let home = robot.model.joints_of_q(&q).to_vec();
    let gains = profile.gains(&robot.model).unwrap();
    let gains = gains.kp.iter().zip(gains.kd.iter());
    let commands = home.iter().zip(gains).map(|(q, (kp, kd))| JointSetpoint::hold(*q, *kp, *kd)).collect();
    let model = if robot.model.base().floating {
        q.iter_mut().zip(at).for_each(|(q, offset)| *q += offset);
        robot.model.prefixed(prefix)
    } else {
        robot.model.placed(&nalgebra::Isometry3::translation(at[0], at[1], at[2])).prefixed(prefix)
    };
    Held { setup: RobotSetup::from(model), q, commands }
}

fn simulate<E: Engine>(robots: &[&Held], world: World) -> Simulation<E> {
    let setups = robots.iter().map(|robot| robot.setup.clone());
    let q: Vec<f64> = robots.iter().flat_map(|robot| robot.q.clone()).collect();
    // Fixes the length of integration steps, whether or not anything is near a contact.
    let options = Options { contact_iterations: 1, ..Options::default() };
    let mut simulation = Simulation::of_robots(setups, world, &q, options).unwrap();
    let commands: Vec<_> = robots.iter().flat_map(|robot| robot.commands.clone()).collect();
    simulation.commands_mut().copy_from_slice(&commands);
    simulation
}

/// Two quadrupeds that fall a few centimetres onto the same ground, and a Panda between them.
fn zoo() -> [Held; 3] {
    [
        held("quadruped", "one/", [0.0, 0.0, 0.03]),
        held("panda", "arm/", [1.5, 0.0, 0.0]),
        held("quadruped", "two/", [3.0, 0.4, 0.03]),
    ]
}

fn swing(commands: &mut [JointSetpoint], held: &[JointSetpoint], step: usize) {
    for (i, (command, held)) in commands.iter_mut().zip(held).enumerate() {
        let offset = 0.1 * (6e-3 * step as f64 + i as f64).sin();
        *command = JointSetpoint { position: held.position + offset, ..*held };
    }
}

#[test]
fn robots_that_do_not_touch_move_as_if_alone() {
    let robots = zoo();
    let mut all: ArticulatedSimulator = simulate(&robots.each_ref(), grounded(vec![]));
    let mut alone =
        robots.each_ref().map(|robot| simulate::<motorium_physics::Articulated>(&[robot], grounded(vec![])));
    let places: Vec<_> = all.articulations().iter().map(|own| (own.q(), own.v(), own.drives())).collect();
    let weight = 9.81 * all.articulations().iter().map(|own| own.model().mass()).fold(f64::MAX, f64::min);
    let (mut worst, mut pressed) = (0.0_f64, 0);
    for step in 0..1500 {
        let held: Vec<_> = robots.iter().flat_map(|robot| robot.commands.clone()).collect();
        swing(all.commands_mut(), &held, step);
        let commands = all.commands_mut().to_vec();
        all.step(1e-3).unwrap();
        pressed += usize::from(all.contact_force().z > weight);
        for (single, (q, v, drives)) in alone.iter_mut().zip(&places) {
            single.commands_mut().copy_from_slice(&commands[drives.clone()]);
            single.step(1e-3).unwrap();
            let of_all = all.configuration()[q.clone()].iter().chain(&all.velocity()[v.clone()]);
            let efforts = all.efforts()[drives.clone()].iter().zip(single.efforts());
            let states = of_all.zip(single.configuration().iter().chain(single.velocity()));
            worst = states.chain(efforts).fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
        }
        assert!(worst <= 1e-12, "step {step}: {worst:e}");
    }
    println!("largest difference {worst:e}");
    assert!(pressed > 300, "the ground bears more than one quadruped in {pressed} steps");
}

#[test]
fn robots_fall_and_stand_as_in_mujoco() {
    if !has_mujoco() {
        return;
    }
    let robots = zoo();
    let mut ours: ArticulatedSimulator = simulate(&robots.each_ref(), grounded(vec![]));
    let mut theirs: MujocoSimulator = simulate(&robots.each_ref(), grounded(vec![]));
    for step in 1..=1200 {
        ours.step(1e-3).unwrap();
        theirs.step(1e-3).unwrap();
        if step % 100 != 0 {
            continue;
        }
        for robot in [0, 2] {
            let (a, b) = (ours.base_pose_of(robot), theirs.base_pose_of(robot));
            let apart = (a.translation.vector - b.translation.vector).norm();
            let turned = a.rotation.angle_to(&b.rotation);
            println!("robot {robot} at {step} ms: {apart:.6} m, {turned:.6} rad");
            assert!(apart < 1.5e-3 && turned < 5e-3, "robot {robot} at {step} ms: {apart} m, {turned} rad");
        }
        let drives = ours.articulations()[1].drives();
        for (a, b) in ours.positions()[drives.clone()].iter().zip(&theirs.positions()[drives]) {
            assert!((a - b).abs() < 1e-4, "the arm at {step} ms: {a} and {b}");
        }
    }
}

/// Two bodies of 2 kg that meet in weightlessness.
fn meeting<E: Engine>() -> Simulation<E> {
    let shape = r#"<box size="0.2 0.2 0.2"/>"#;
    let robots = ["one/", "two/"].map(|prefix| RobotSetup::from(body(shape).prefixed(prefix)));
    let mut q = [robots[0].model.neutral(), robots[1].model.neutral()].concat();
    (q[7], q[8], q[9]) = (0.4, 0.03, 0.02);
    let mut simulation = Simulation::of_robots(robots, World::default(), &q, Options::default()).unwrap();
    simulation.set_gravity(Vector3::zeros());
    let mut v = vec![0.0; 12];
    (v[0], v[9]) = (1.0, 0.5);
    simulation.reset(&q, &v).unwrap();
    simulation
}

/// Linear momentum, and angular momentum about the world origin.
fn momentum<E: Engine>(simulation: &Simulation<E>) -> [Vector3<f64>; 2] {
    let mut sum = [Vector3::zeros(); 2];
    for (of, own) in simulation.articulations().iter().enumerate() {
        let (pose, v) = (simulation.base_pose_of(of), &simulation.velocity()[own.v()]);
        let linear = pose.rotation * Vector3::from_column_slice(&v[..3]) * 2.0;
        let spin = pose.rotation * Vector3::from_column_slice(&v[3..6]) * 0.008;
        sum[0] += linear;
        sum[1] += pose.translation.vector.cross(&linear) + spin;
    }
    sum
}

#[test]
fn colliding_robots_conserve_their_total_momentum() {
    let mut simulation: ArticulatedSimulator = meeting();
    let before = momentum(&simulation);
    let mut touched = false;
    for _ in 0..1000 {
        simulation.step(1e-3).unwrap();
        touched |= simulation.touching("one/body", "two/body");
    }
    let after = momentum(&simulation);
    assert!(touched, "they pass through one another");
    assert!((before[0] - after[0]).norm() < 1e-9, "{} and {}", before[0], after[0]);
    // the positions between impulse and point of contact are of first order in the step
    assert!((before[1] - after[1]).norm() < 2e-3, "{} and {}", before[1], after[1]);
    let second = Vector3::from_column_slice(&simulation.velocity()[6..9]);
    assert!(second.norm() > 0.3, "the second was pushed: {second}");
}

#[test]
fn robot_of_one_free_body_moves_like_a_free_object() {
    // The same problem with two other blocks: an articulation with its mass factor, and an object with mass
    // and inertia.
    let shape = ObjectShape::Box { size: [0.2, 0.2, 0.2] };
    let i = 2.0 / 6.0 * 0.04;
    let urdf = format!(
        r#"<robot name="body"><link name="body"><inertial><mass value="2"/>
        <inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link></robot>"#
    );
    let options = motorium_robots::LoadOptions {
        base: motorium_robots::BaseMode::Floating,
        ..motorium_robots::LoadOptions::default()
    };
    let model = motorium_robots::parse_urdf_with(&urdf, None, &options).unwrap().model;
    let object = |name: &str, position| Object {
        name: name.to_owned(),
        shape,
        mass: Some(2.0),
        position,
        rpy: [0.3, 0.2, 0.0],
        ..Object::default()
    };
    // Both fall onto the ground ten metres apart.
    let far = object("far", [10.0, 0.0, 0.3]);
    let rotation = far.pose().rotation;
    let mut q = model.neutral();
    q[..3].copy_from_slice(&[0.0, 0.0, 0.3]);
    q[3..7].copy_from_slice(rotation.coords.as_slice());
    let world = World { ground: Some(Ground::default()), objects: vec![far], ..World::default() };
    let mut simulation = ArticulatedSimulator::new(model, world, &q, Options::default()).unwrap();
    let id = simulation.object("far").unwrap();
    for step in 0..1500 {
        simulation.step(1e-3).unwrap();
        let (a, b) = (simulation.base_pose(), simulation.object_pose(id));
        let apart = (a.translation.vector - b.translation.vector + Vector3::x() * 10.0).norm();
        assert!(apart < 2e-3, "step {step}: {apart} m");
    }
    assert!((simulation.base_pose().translation.z - 0.1).abs() < 1e-3);
}

#[test]
fn states_of_several_robots_restore_and_reset_exactly() {
    let robots = zoo();
    let cube = Object {
        name: "cube".to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass: Some(0.5),
        position: [0.0, 0.0, 0.6],
        rpy: [0.1, 0.2, 0.0],
        friction: 0.5,
        ..Object::default()
    };
    let mut simulation: ArticulatedSimulator = simulate(&robots.each_ref(), grounded(vec![cube.clone()]));
    let held: Vec<_> = robots.iter().flat_map(|robot| robot.commands.clone()).collect();
    let advance = |simulation: &mut ArticulatedSimulator, from: usize| -> Vec<u64> {
        for step in from..from + 300 {
            swing(simulation.commands_mut(), &held, step);
            simulation.step(1e-3).unwrap();
        }
        let state =
            simulation.configuration().iter().chain(simulation.velocity()).chain(simulation.efforts());
        state.map(|x| x.to_bits()).collect()
    };
    let first = advance(&mut simulation, 0);
    let saved = simulation.save();
    let second = advance(&mut simulation, 300);
    simulation.restore(&saved).unwrap();
    assert_eq!(advance(&mut simulation, 300), second);
    let mut other: ArticulatedSimulator = simulate(&robots.each_ref(), grounded(vec![cube]));
    other.restore(&saved).unwrap();
    assert_eq!(advance(&mut other, 300), second, "in another simulator");
    let (q, v) =
        (robots.iter().flat_map(|robot| robot.q.clone()).collect::<Vec<_>>(), vec![0.0; second.len()]);
    let nv = simulation.velocity().len();
    simulation.reset(&q, &v[..nv]).unwrap();
    assert_eq!(advance(&mut simulation, 0), first, "after a reset");
    let error = simulation.reset(&q[1..], &v[..nv]).unwrap_err().to_string();
    assert!(error.contains("positions"), "{error}");
}

#[test]
fn wrench_moves_the_robot_it_is_applied_to() {
    fn pushed<E: Engine>() {
        let mut simulation: Simulation<E> = meeting();
        let (q, v) = (simulation.configuration().to_vec(), vec![0.0; 12]);
        simulation.reset(&q, &v).unwrap();
        let link = simulation.articulations()[1].model().frame("two/body").unwrap();
        for _ in 0..100 {
            simulation.apply_wrench_to((1, link), Point3::origin(), Vector3::y() * 4.0, Vector3::zeros());
            simulation.step(1e-3).unwrap();
        }
        let v = simulation.velocity();
        assert!(v[..6].iter().all(|v| v.abs() < 1e-9), "{v:?}");
        assert!((v[7] - 0.2).abs() < 1e-6, "4 N on 2 kg for 0.1 s: {v:?}");
    }
    pushed::<motorium_physics::Articulated>();
    if has_mujoco() {
        pushed::<motorium_physics::Mujoco>();
    }
}

#[test]
fn a_diverging_step_names_its_joint_and_changes_nothing() {
    let robots = zoo();
    let mut simulation: ArticulatedSimulator = simulate(&robots.each_ref(), grounded(vec![]));
    let drives = simulation.articulations()[2].drives();
    simulation.commands_mut()[drives.start].position = f64::NAN;
    let before = simulation.configuration().to_vec();
    match simulation.step(1e-3).unwrap_err() {
        StepError::InvalidCommand { joint, name, .. } => {
            assert_eq!(joint, drives.start);
            assert!(name.starts_with("two/"), "{name}");
        }
        other => panic!("{other}"),
    }
    assert_eq!(simulation.configuration(), before);
}

#[test]
fn incompatible_robots_are_rejected() {
    let one = RobotSetup::from(body(r#"<sphere radius="0.1"/>"#));
    let q = [one.model.neutral(), one.model.neutral()].concat();
    let twice = [one.clone(), one.clone()];
    let built = ArticulatedSimulator::of_robots(twice, World::default(), &q, Options::default());
    assert!(matches!(built.err(), Some(BuildError::Name { name }) if name == "body"));
    let none = ArticulatedSimulator::of_robots([], World::default(), &[], Options::default());
    assert_eq!(none.err(), Some(BuildError::NoRobot));
    let both = [one.clone(), RobotSetup::from(one.model.prefixed("two/"))];
    let rapier = RapierSimulator::of_robots(both, World::default(), &q, Options::default());
    assert!(matches!(rapier.err(), Some(BuildError::FloatingBase { .. })));
    let arm = load("pendulum", Path::new(".")).unwrap().model;
    let arms = ["one/", "two/"].map(|prefix| RobotSetup::from(arm.prefixed(prefix)));
    let rapier = RapierSimulator::of_robots(arms, World::default(), &[0.0, 0.0], Options::default());
    assert_eq!(rapier.err(), Some(BuildError::SeveralArticulations));
}

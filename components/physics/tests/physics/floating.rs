//! Robots with a floating base, in the air and on the ground, against physical laws.

use motorium_physics::{
    ArticulatedSimulator, BuildError, Ground, JointSetpoint, Object, ObjectShape, Options, RapierSimulator,
    RobotSetup, RotorDrive, Simulator, World,
};
use motorium_robots::{Dynamics, load};
use nalgebra::{UnitQuaternion, Vector3};

use crate::legged::{body, grounded, held, run, standing};

const DT: f64 = 1e-3;

const BOX: &str = r#"<box size="0.2 0.3 0.1"/>"#;
const BALL: &str = r#"<sphere radius="0.1"/>"#;

/// A plane inclined by `angle` about y, in the frame of the plane: gravity is inclined instead.
fn slope(angle: f64, friction: f64) -> World {
    let gravity = [9.81 * angle.sin(), 0.0, -9.81 * angle.cos()];
    World { gravity, ground: Some(Ground { friction, ..Ground::default() }), ..World::default() }
}

fn at_height(z: f64) -> Vec<f64> {
    vec![0.0, 0.0, z, 0.0, 0.0, 0.0, 1.0]
}

#[test]
fn body_in_the_air_falls_as_in_closed_form() {
    let mut simulation =
        ArticulatedSimulator::new(body(BOX), World::default(), &at_height(10.0), Options::default()).unwrap();
    run(&mut simulation, 1.0);
    // Semi-implicit: g t (t + dt) / 2.
    let fallen = 10.0 - simulation.base_pose().translation.z;
    assert!((fallen - 0.5 * 9.81 * 1.001).abs() < 1e-9, "{fallen}");
    assert!((simulation.velocity()[2] + 9.81).abs() < 1e-9);
}

#[test]
fn tumbling_robot_conserves_momentum_in_the_air() {
    let robot = load("quadruped", std::path::Path::new(".")).unwrap();
    let mut simulation = standing("quadruped", World::default());
    let mut v = vec![0.0; 18];
    v[..6].copy_from_slice(&[0.5, -0.3, 2.0, 3.0, -5.0, 2.0]);
    let q = simulation.configuration().to_vec();
    simulation.reset(&q, &v).unwrap();
    let mut dynamics = Dynamics::new(&robot.model);
    let before = dynamics.momentum(&robot.model, &q, &v);
    let weight = robot.model.mass() * 9.81;
    for step in 0..1000 {
        for (i, command) in simulation.commands_mut().iter_mut().enumerate() {
            let goal = 0.8 * (0.01 * f64::from(step) + i as f64).sin();
            *command = JointSetpoint::hold(goal, 6.0, 0.2);
        }
        simulation.step(DT).unwrap();
    }
    let after = dynamics.momentum(&robot.model, simulation.configuration(), simulation.velocity());
    let fall = Vector3::new(0.0, 0.0, -weight);
    assert!((after.linear - before.linear - fall).norm() < 1e-9 * weight, "{after:?}");
    assert!((after.angular - before.angular).norm() < 1e-9, "{:?} then {:?}", before.angular, after.angular);
}

#[test]
fn a_box_on_a_slope_keeps_to_the_friction_cone() {
    let (angle, options) = (0.5_f64, Options { friction: 0.6, ..Options::default() });
    let mut stuck =
        ArticulatedSimulator::new(body(BOX), slope(angle, 0.6), &at_height(0.05), options).unwrap();
    run(&mut stuck, 0.5);
    let place = stuck.base_pose().translation.vector;
    run(&mut stuck, 5.0);
    let creep = (stuck.base_pose().translation.vector - place).norm();
    assert!(creep < 1e-6, "crept {creep} m in 5 s");

    let options = Options { friction: 0.4, ..Options::default() };
    let mut sliding =
        ArticulatedSimulator::new(body(BOX), slope(angle, 0.4), &at_height(0.05), options).unwrap();
    run(&mut sliding, 1.0);
    // g (sin - mu cos), from rest.
    let speed = (sliding.base_pose().rotation * Vector3::from_column_slice(&sliding.velocity()[..3])).x;
    let expected = 9.81 * (angle.sin() - 0.4 * angle.cos());
    assert!((speed - expected).abs() < 0.005 * expected, "{speed}, expected {expected}");
    let force = sliding.contact_force();
    assert!((force.x.abs() / force.z - 0.4).abs() < 1e-3, "{force}");
}

#[test]
fn friction_opposes_the_slip_in_every_direction() {
    for degrees in (0..360).step_by(25) {
        let heading = f64::from(degrees).to_radians();
        let options = Options { friction: 0.3, ..Options::default() };
        let mut simulation =
            ArticulatedSimulator::new(body(BOX), slope(0.0, 0.3), &at_height(0.05), options).unwrap();
        let mut v = [0.0; 6];
        (v[0], v[1]) = (heading.cos(), heading.sin());
        simulation.reset(&at_height(0.05), &v).unwrap();
        run(&mut simulation, 0.2);
        let force = simulation.contact_force();
        let along = force.x * heading.cos() + force.y * heading.sin();
        let aside = force.y * heading.cos() - force.x * heading.sin();
        assert!((along + 0.3 * 2.0 * 9.81).abs() < 0.03, "{along} N along {degrees} degrees");
        assert!(aside.abs() < 0.06, "{aside} N aside of {degrees} degrees");
    }
}

#[test]
fn ball_bounces_to_the_height_of_its_restitution() {
    // The mean of 0 (the robot's) and 1.
    let ground = Some(Ground { restitution: 1.0, ..Ground::default() });
    let world = World { ground, ..World::default() };
    let mut simulation =
        ArticulatedSimulator::new(body(BALL), world, &at_height(0.6), Options::default()).unwrap();
    let (mut lowest, mut highest) = (f64::MAX, 0.0_f64);
    for _ in 0..700 {
        simulation.step(DT).unwrap();
        let height = simulation.base_pose().translation.z;
        lowest = lowest.min(height);
        if lowest < 0.11 {
            highest = highest.max(height);
        }
    }
    assert!(lowest > 0.098, "{lowest}");
    assert!((highest - 0.1 - 0.25 * 0.5).abs() < 0.005, "rose to {highest}");
}

#[test]
fn sliding_ball_rolls_at_five_sevenths_of_its_speed() {
    // A uniform ball thrown without spin loses 2/7 of its speed until it rolls.
    let mut simulation =
        ArticulatedSimulator::new(body(BALL), grounded(vec![]), &at_height(0.1), Options::default()).unwrap();
    let mut v = [0.0; 6];
    v[0] = 1.4;
    simulation.reset(&at_height(0.1), &v).unwrap();
    run(&mut simulation, 1.0);
    let pose = simulation.base_pose();
    let speed = pose.rotation * Vector3::from_column_slice(&simulation.velocity()[..3]);
    let spin = pose.rotation * Vector3::from_column_slice(&simulation.velocity()[3..6]);
    assert!((speed.x - 1.0).abs() < 5e-3, "{speed}");
    assert!((spin.y * 0.1 - speed.x).abs() < 1e-3, "{spin} {speed}");
}

#[test]
fn a_standing_quadruped_carries_its_weight() {
    let robot = load("quadruped", std::path::Path::new(".")).unwrap();
    let mut simulation = held("quadruped");
    run(&mut simulation, 1.0);
    let place = simulation.base_pose().translation.vector;
    let force = simulation.contact_force();
    let weight = robot.model.mass() * 9.81;
    assert!((force.z - weight).abs() < 1e-3 * weight, "{force} N, weight {weight}");
    assert!(force.xy().norm() < 1e-3 * weight, "{force}");
    let mut normal = 0.0;
    simulation.visit_contacts(&mut |contact| {
        assert!(contact.first == "ground" && contact.second.ends_with("shank"), "{contact:?}");
        normal += contact.force;
    });
    assert!((normal - weight).abs() < 1e-3 * weight, "{normal} N");
    run(&mut simulation, 4.0);
    let creep = (simulation.base_pose().translation.vector - place).norm();
    assert!(creep < 1e-6, "crept {creep} m in 4 s");
    assert!(simulation.velocity().iter().all(|v| v.abs() < 1e-5));
}

#[test]
fn wheel_rotation_matches_the_distance_travelled() {
    let robot = load("differential-drive", std::path::Path::new(".")).unwrap();
    let base = robot.profile.as_ref().unwrap().mobile_base.as_ref().unwrap().clone();
    let radius = base.wheel_radius.unwrap();
    let mut simulation = held("differential-drive");
    run(&mut simulation, 0.2);
    let drive = |simulation: &mut ArticulatedSimulator, left: f64, right: f64, seconds: f64| {
        for (command, velocity) in simulation.commands_mut().iter_mut().zip([left, right]) {
            *command = JointSetpoint { velocity, kd: 0.1, ..JointSetpoint::default() };
        }
        run(simulation, seconds);
    };
    drive(&mut simulation, 5.0, 5.0, 0.5);
    let (start, turned) = (simulation.base_pose(), simulation.positions()[0]);
    drive(&mut simulation, 5.0, 5.0, 2.0);
    let way = simulation.base_pose().translation.vector - start.translation.vector;
    let rolled = radius * (simulation.positions()[0] - turned);
    assert!((way.norm() - rolled).abs() < 0.01 * rolled, "{way} for {rolled} m of wheel");
    assert!(way.x > 0.25 && way.y.abs() < 0.01 && way.z.abs() < 1e-3, "{way}");
    // Turning on the spot: track and radius determine the rate.
    drive(&mut simulation, -5.0, 5.0, 0.5);
    let (before, wheels) = (simulation.base_pose().rotation, simulation.positions().to_vec());
    drive(&mut simulation, -5.0, 5.0, 0.5);
    let turn = (before.inverse() * simulation.base_pose().rotation).scaled_axis().z;
    let rolled = simulation.positions()[1] - wheels[1] - (simulation.positions()[0] - wheels[0]);
    // A rigid wheel touches with both its edges; the edge that holds determines the track.
    let expected = rolled * radius / base.track.unwrap();
    assert!((0.85..1.15).contains(&(turn / expected)), "{turn} rad, expected {expected}");
}

#[test]
fn a_quadrotor_hovers_and_turns_by_rotor_drag() {
    let robot = load("quadrotor", std::path::Path::new(".")).unwrap();
    let profile = robot.profile.as_ref().unwrap();
    let rotors = RotorDrive::from_profile(&robot.model, profile).unwrap();
    let q = profile.configuration(&robot.model, "hovering").unwrap();
    let weight = robot.model.mass() * 9.81;
    let names: Vec<_> = rotors.iter().map(|rotor| rotor.name.clone()).collect();
    let mut simulation = ArticulatedSimulator::new(
        RobotSetup::from_loaded(&robot).unwrap(),
        World::default(),
        q.as_slice(),
        Options::default(),
    )
    .unwrap();
    assert_eq!(simulation.joint_names(), names);
    simulation.commands_mut().fill(JointSetpoint::effort(0.25 * weight));
    run(&mut simulation, 1.0);
    assert!((simulation.base_pose().translation.z - q[2]).abs() < 1e-6);
    assert!(simulation.velocity().iter().all(|v| v.abs() < 1e-6), "{:?}", simulation.velocity());
    // More thrust from the rotors that turn it counterclockwise, less from the others.
    for (command, rotor) in simulation.commands_mut().iter_mut().zip(&rotors) {
        *command = JointSetpoint::effort(0.25 * weight * (1.0 + 0.1 * rotor.torque_per_thrust.signum()));
    }
    run(&mut simulation, 0.2);
    let inertia = {
        let mut mass = nalgebra::DMatrix::zeros(6, 6);
        Dynamics::new(&robot.model).crba(&robot.model, q.as_slice(), &mut mass);
        mass[(5, 5)]
    };
    let expected = 0.1 * weight * rotors[0].torque_per_thrust.abs() / inertia * 0.2;
    assert!((simulation.velocity()[5] - expected).abs() < 1e-6, "{} {expected}", simulation.velocity()[5]);
}

#[test]
fn objects_stack_and_are_pushed_by_a_robot() {
    let cube = |name: &str, mass, position| Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass,
        position,
        ..Object::default()
    };
    let world = grounded(vec![
        cube("below", Some(1.0), [1.0, 0.0, 0.05]),
        Object {
            shape: ObjectShape::Box { size: [0.06; 3] },
            ..cube("above", Some(0.5), [1.015, 0.01, 0.131])
        },
        cube("wall", None, [-1.0, 0.0, 0.05]),
        cube("hit", Some(2.0), [0.4, 0.0, 0.06]),
    ]);
    let options = Options { friction: 0.0, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(body(BOX), world, &at_height(0.05), options).unwrap();
    run(&mut simulation, 0.5);
    let object = |simulation: &ArticulatedSimulator, name: &str| {
        simulation.object_pose(simulation.object(name).unwrap())
    };
    assert!((object(&simulation, "above").translation.z - 0.13).abs() < 1e-4);
    assert!(object(&simulation, "above").rotation.angle() < 1e-4);
    let mut force = 0.0;
    simulation.visit_contacts(&mut |contact| {
        if contact.first == "ground" && contact.second == "below" {
            force += contact.force;
        }
    });
    assert!((force - 1.5 * 9.81).abs() < 0.02, "{force} N");
    // The frictionless box of 2 kg runs into the cube of 2 kg. The impact is inelastic: half of its speed
    // remains, minus the effect of the cube's friction during the impact.
    let mut v = [0.0; 6];
    v[0] = 3.0;
    let q = simulation.configuration().to_vec();
    simulation.reset(&q, &v).unwrap();
    let hit = simulation.object("hit").unwrap();
    for _ in 0..1000 {
        simulation.step(DT).unwrap();
        if simulation.touching("body", "hit") {
            break;
        }
    }
    run(&mut simulation, 0.003);
    let speeds = (simulation.velocity()[0], simulation.object_velocity(hit).0.x);
    assert!((speeds.0 - speeds.1).abs() < 0.02 && (1.47..1.5).contains(&speeds.1), "{speeds:?}");
    assert!((object(&simulation, "wall").translation.x + 1.0).abs() < 1e-12);
    assert!(!simulation.touching("body", "above"));
}

#[test]
fn a_ball_and_a_lying_capsule_rest() {
    let block = Object {
        name: "block".to_owned(),
        shape: ObjectShape::Box { size: [0.5, 0.5, 0.2] },
        mass: None,
        position: [0.0, 0.0, 0.1],
        ..Object::default()
    };
    let mut simulation =
        ArticulatedSimulator::new(body(BALL), grounded(vec![block]), &at_height(0.35), Options::default())
            .unwrap();
    run(&mut simulation, 1.0);
    assert!((simulation.base_pose().translation.z - 0.3).abs() < 1e-4);
    assert!(simulation.touching("block", "body") && !simulation.touching("ground", "body"));
    let capsule = body(r#"<cylinder radius="0.05" length="0.3"/>"#);
    let mut q = at_height(0.2);
    let lying = UnitQuaternion::from_euler_angles(0.0, 1.2, 0.3);
    q[3..7].copy_from_slice(lying.coords.as_slice());
    let mut simulation =
        ArticulatedSimulator::new(capsule, grounded(vec![]), &q, Options::default()).unwrap();
    run(&mut simulation, 3.0);
    let pose = simulation.base_pose();
    assert!((pose.translation.z - 0.05).abs() < 1e-3, "{pose}");
    assert!((pose.rotation * Vector3::z()).z.abs() < 1e-3);
}

#[test]
fn reset_sets_the_whole_state_and_rejects_invalid_ones() {
    let mut simulation = held("quadruped");
    let q = simulation.configuration().to_vec();
    run(&mut simulation, 0.2);
    simulation.reset(&q, &[0.0; 18]).unwrap();
    assert_eq!(simulation.configuration(), q);
    let error = simulation.reset(&q[7..], &[0.0; 12]).unwrap_err().to_string();
    assert!(error.contains("12 positions and 12 velocities, expected 19 and 18"), "{error}");
    let mut bent = q.clone();
    bent[6] = 0.5;
    let error = simulation.reset(&bent, &[0.0; 18]).unwrap_err().to_string();
    assert!(error.contains("a unit quaternion"), "{error}");
}

#[test]
fn a_robot_is_placed_on_the_ground_from_any_height() {
    for name in ["quadruped", "hexapod", "humanoid"] {
        let mut simulation = standing(name, grounded(vec![]));
        let standing = simulation.configuration()[2];
        let mut q = simulation.configuration().to_vec();
        q[2] = 1e3;
        simulation.reset(&q, &vec![0.0; simulation.velocity().len()]).unwrap();
        simulation.place_on_ground();
        assert!((simulation.configuration()[2] - standing).abs() < 1e-6, "{name}");
    }
}

#[test]
fn rapier_rejects_a_floating_base_and_names_another_engine() {
    let error =
        RapierSimulator::new(body(BOX), World::default(), &at_height(0.5), Options::default()).err().unwrap();
    assert_eq!(error, BuildError::FloatingBase { robot: "body".to_owned() });
    assert!(error.to_string().contains("physics.articulated"), "{error}");
}

#[test]
fn a_freely_falling_robot_is_never_near_a_contact() {
    for name in ["quadruped", "humanoid"] {
        let mut simulation = crate::legged::held_in(name, World::default());
        let mut near = 0;
        for _ in 0..3000 {
            near += usize::from(simulation.step(1e-3).unwrap().near_contact);
        }
        let speed = simulation.velocity()[..3].iter().map(|v| v * v).sum::<f64>().sqrt();
        assert!(speed > 29.0 && near == 0, "{name}: near contact in {near} steps, at {speed} m/s in the end");
    }
}

//! Simulations of every catalogue robot with a fixed base: its default gains hold it in place, and it moves
//! when pushed.

use std::path::Path;

use motorium_physics::{ArticulatedSimulator, Ground, JointSetpoint, Options, Simulator, World};
use motorium_robots::{Loaded, catalogue, load};

/// The robot held at home by its drives; joints without drives are free.
fn held(robot: &Loaded) -> (ArticulatedSimulator, Vec<f64>) {
    held_in(robot, World::default())
}

fn held_in(robot: &Loaded, world: World) -> (ArticulatedSimulator, Vec<f64>) {
    let profile = robot.profile.as_ref().unwrap();
    let home = profile.home(&robot.model).unwrap().as_slice().to_vec();
    let gains = profile.gains(&robot.model).unwrap();
    let mut simulation =
        ArticulatedSimulator::new(robot.model.clone(), world, &home, Options::default()).unwrap();
    for (index, command) in simulation.commands_mut().iter_mut().enumerate() {
        *command = JointSetpoint::hold(home[index], gains.kp[index], gains.kd[index]);
    }
    (simulation, home)
}

fn fixed() -> impl Iterator<Item = Loaded> {
    let robots = catalogue().iter().map(|entry| load(entry.name, Path::new(".")).unwrap());
    robots.filter(|robot| !robot.model.base().floating)
}

#[test]
fn every_fixed_base_robot_is_held_by_default_gains() {
    let mut names = Vec::new();
    for robot in fixed() {
        let name = robot.model.name();
        let profile = robot.profile.as_ref().unwrap();
        names.push(name.to_owned());
        // A planar biped falls until its feet reach the ground; this world has no ground.
        if name == "planar-biped" {
            continue;
        }
        let (mut simulation, home) = held(&robot);
        for _ in 0..300 {
            simulation.step(0.001).unwrap();
        }
        for (index, joint) in robot.model.joint_names().iter().enumerate() {
            let sag = (simulation.positions()[index] - home[index]).abs();
            let passive = profile.passive.contains(joint);
            assert!(sag < 0.12, "{name}: {joint} (passive: {passive}) went {sag:.3} from home");
            assert!(simulation.velocities()[index].abs() < 0.6, "{name}: {joint} is still moving");
        }
    }
    assert!(names.len() >= 11, "{names:?}");
}

#[test]
fn every_drive_follows_its_setpoint() {
    for robot in fixed() {
        let name = robot.model.name();
        let model = &robot.model;
        let passive =
            |index: usize| robot.profile.as_ref().unwrap().passive.contains(&model.joint_names()[index]);
        let ((mut still, home), (mut moving, _)) = (held(&robot), held(&robot));
        for (index, command) in moving.commands_mut().iter_mut().enumerate() {
            let middle = 0.5 * (model.lower()[index] + model.upper()[index]);
            let way = if middle.is_finite() && middle < home[index] { -1.0 } else { 1.0 };
            command.position += if passive(index) { 0.0 } else { 0.01 * way };
        }
        for _ in 0..500 {
            still.step(0.001).unwrap();
            moving.step(0.001).unwrap();
        }
        // Freely swinging joints shake the drives next to them.
        let (least, most) = if model.joint_names().len() > 2 { (0.006, 0.016) } else { (0.002, 0.03) };
        for index in (0..home.len()).filter(|index| !passive(*index)) {
            let apart = (moving.positions()[index] - still.positions()[index]).abs();
            assert!(
                (least..most).contains(&apart),
                "{name}: {} followed 0.01 by {apart:.4}",
                model.joint_names()[index]
            );
        }
    }
}

#[test]
fn the_planar_biped_stands_on_its_point_feet() {
    let robot = load("planar-biped", Path::new(".")).unwrap();
    let ground = Some(Ground { friction: 1.0, ..Ground::default() });
    let (mut simulation, home) = held_in(&robot, World { ground, ..World::default() });
    for _ in 0..1500 {
        simulation.step(0.001).unwrap();
    }
    let at = |joint: &str| robot.model.joint_index(joint).unwrap();
    for joint in ["base_x", "base_z", "base_pitch"] {
        let moved = (simulation.positions()[at(joint)] - home[at(joint)]).abs();
        assert!(moved < 0.08, "{joint} moved by {moved:.3}");
    }
    assert!(simulation.touching("left_shank", "ground") && simulation.touching("right_shank", "ground"));
}

//! Simulations of robots with a floating base.

use std::path::Path;

use motorium_physics::{
    ArticulatedSimulator, Ground, JointSetpoint, Object, Options, RobotSetup, Simulator, World,
};
use motorium_robots::{BaseMode, LoadOptions, Model, load, parse_urdf_with};

/// Runs the simulation at 1 kHz.
pub(crate) fn run(simulation: &mut ArticulatedSimulator, seconds: f64) {
    for _ in 0..(seconds * 1e3).round() as usize {
        simulation.step(1e-3).unwrap();
    }
}

pub(crate) fn grounded(objects: Vec<Object>) -> World {
    World { ground: Some(Ground::default()), objects, ..World::default() }
}

/// One free link of 2 kg with this shape and the inertia of a uniform ball of 0.1 m.
pub(crate) fn body(shape: &str) -> Model {
    let urdf = format!(
        r#"<robot name="body"><link name="body"><inertial><mass value="2"/>
        <inertia ixx="0.008" iyy="0.008" izz="0.008" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry>{shape}</geometry></collision></link></robot>"#
    );
    let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
    parse_urdf_with(&urdf, None, &options).unwrap().model
}

/// A catalogue robot at home in `world`, with slack drives.
pub(crate) fn standing(name: &str, world: World) -> ArticulatedSimulator {
    let robot = load(name, Path::new(".")).unwrap();
    let setup = RobotSetup::from_loaded(&robot).unwrap();
    let profile = robot.profile.unwrap();
    let q = profile.configuration(&robot.model, &profile.home).unwrap();
    ArticulatedSimulator::new(setup, world, q.as_slice(), Options::default()).unwrap()
}

/// A catalogue robot at home on the ground, held there by its default gains.
pub(crate) fn held(name: &str) -> ArticulatedSimulator {
    held_in(name, grounded(vec![]))
}

/// The same robot in `world`.
pub(crate) fn held_in(name: &str, world: World) -> ArticulatedSimulator {
    let robot = load(name, Path::new(".")).unwrap();
    let mut simulation = standing(name, world);
    let gains = robot.profile.unwrap().gains(&robot.model).ok();
    let home = simulation.positions().to_vec();
    for (i, gains) in gains.iter().flat_map(|gains| gains.kp.iter().zip(gains.kd.iter())).enumerate() {
        simulation.commands_mut()[i] = JointSetpoint::hold(home[i], *gains.0, *gains.1);
    }
    simulation
}

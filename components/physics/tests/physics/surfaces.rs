//! The surfaces of robots: restitution of all links and of single links.

use motorium_physics::{ArticulatedSimulator, Object, ObjectShape, Options, RobotSetup, Simulator, World};
use motorium_robots::{MimicMode, Model, PackagePath, parse_urdf};

use crate::engines::engines;

/// A fixed anvil, and a pointer that rotates next to it.
const ANVIL: &str = r#"<robot name="anvil">
  <link name="anvil">
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.4 0.4 0.1"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="anvil"/><child link="pointer"/><origin xyz="1 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/>
  </joint>
  <link name="pointer">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>"#;

fn anvil() -> Model {
    parse_urdf(ANVIL, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

fn ball(restitution: f64) -> World {
    let ball = Object {
        name: "ball".to_owned(),
        shape: ObjectShape::Sphere { radius: 0.05 },
        mass: Some(0.2),
        position: [0.0, 0.0, 0.6],
        friction: 0.5,
        restitution,
        ..Object::default()
    };
    World { objects: vec![ball], ..World::default() }
}

/// Share of its speed with which the ball rebounds.
fn rebound(simulation: &mut dyn Simulator) -> f64 {
    let ball = simulation.object("ball").unwrap();
    let (mut before, mut after) = (0.0_f64, 0.0_f64);
    for _ in 0..420 {
        simulation.step(1e-3).unwrap();
        let up = simulation.object_velocity(ball).0.z;
        (before, after) = (before.max(-up), after.max(up));
    }
    after / before
}

#[test]
fn a_ball_rebounds_with_the_mean_restitution() {
    for engine in engines() {
        for (robot, object) in [(0.9, 0.7), (0.6, 0.0), (0.0, 0.6)] {
            let options = Options { restitution: robot, ..Options::default() };
            let mut simulation = engine.simulate(anvil(), ball(object), &[0.0], options);
            let (found, expected) = (rebound(&mut *simulation), 0.5 * (robot + object));
            assert!((found - expected).abs() < 0.05, "{engine:?}, {robot}, {object}: {found}, {expected}");
        }
    }
}

#[test]
fn single_link_has_its_configured_restitution() {
    for (link, expected) in [("anvil", 0.8), ("pointer", 0.4)] {
        let mut setup = RobotSetup::from(anvil());
        setup.restitution.insert(link.to_owned(), 0.8);
        let mut simulation = ArticulatedSimulator::new(setup, ball(0.8), &[0.0], Options::default()).unwrap();
        let found = rebound(&mut simulation);
        assert!((found - expected).abs() < 0.05, "{link}: {found}, {expected}");
    }
}

#[test]
fn restitution_above_one_is_rejected() {
    let options = Options { restitution: 1.5, ..Options::default() };
    let refused = ArticulatedSimulator::new(anvil(), ball(0.0), &[0.0], options).map(drop).unwrap_err();
    assert_eq!(refused.to_string(), "`restitution` is 1.5, expected a number from 0 to 1");
}

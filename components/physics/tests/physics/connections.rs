//! Connections against closed forms: loops of links, objects fixed to each other, and free flight.

use motorium_physics::{
    ArticulatedSimulator, ConnectError, Connection, ConnectionKind, Ground, JointSetpoint, MujocoSimulator,
    Object, ObjectShape, Options, RapierSimulator, Simulator, World,
};
use motorium_robots::{MimicMode, Model, PackagePath, load, parse_urdf};
use nalgebra::{Isometry3, Vector3};

use crate::engines::has_mujoco;

/// A crank of 0.2 m at the origin with a coupler of 0.5 m, and a rocker of 0.4 m at x = 0.5 m, all about y.
/// At zero angles they are stretched out along x, z and so on, according to `links`.
fn linkage() -> Model {
    let link = |name: &str, length: f64| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{} 0 0"/><mass value="1"/>
  <inertia ixx="0.001" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>"#,
            0.5 * length
        )
    };
    let joint = |name: &str, parent: &str, child: &str, x: f64| {
        format!(
            r#"<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="{x} 0 0"/><axis xyz="0 -1 0"/><limit effort="100" velocity="50"/></joint>"#
        )
    };
    let text = format!(
        r#"<robot name="linkage"><link name="base"/>{}{}{}{}{}{}</robot>"#,
        joint("crank_joint", "base", "crank", 0.0),
        link("crank", 0.2),
        joint("coupler_joint", "crank", "coupler", 0.2),
        link("coupler", 0.5),
        joint("rocker_joint", "base", "rocker", 0.5),
        link("rocker", 0.4)
    );
    parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

/// Angles of coupler and rocker, both against x, that close the loop at this angle of the crank: the upper
/// intersection of the two circles about the end of the crank and about the pivot of the rocker.
fn closed(crank: f64) -> (f64, f64) {
    let (tip, pivot) = ([0.2 * crank.cos(), 0.2 * crank.sin()], [0.5, 0.0]);
    let (dx, dz) = (pivot[0] - tip[0], pivot[1] - tip[1]);
    let apart = dx.hypot(dz);
    let along = (0.25 - 0.16 + apart * apart) / (2.0 * apart);
    let beside = (0.25 - along * along).sqrt();
    let pin = [tip[0] + (along * dx - beside * dz) / apart, tip[1] + (along * dz + beside * dx) / apart];
    ((pin[1] - tip[1]).atan2(pin[0] - tip[0]), (pin[1] - pivot[1]).atan2(pin[0] - pivot[0]))
}

fn pin() -> Connection {
    let parts = ["coupler", "rocker"].map(str::to_owned);
    Connection { parts, kind: ConnectionKind::Ball, point: [0.5, 0.0, 0.0] }
}

#[test]
fn four_bar_linkage_follows_its_geometry() {
    let (coupler, rocker) = closed(0.3);
    let q = [0.3, coupler - 0.3, rocker];
    let mut bars = ArticulatedSimulator::new(linkage(), World::default(), &q, Options::default()).unwrap();
    bars.connect(&pin()).unwrap();
    // The crank is driven through two turns.
    for step in 0..8000 {
        let goal = 0.3 + 12.566_370_614 * f64::from(step) / 8000.0;
        bars.commands_mut()[0] =
            JointSetpoint { velocity: 12.566_370_614 / 8.0, ..JointSetpoint::hold(goal, 500.0, 50.0) };
        bars.step(1e-3).unwrap();
        let q = bars.positions();
        let (coupler, rocker) = closed(q[0]);
        let wrap = |angle: f64| {
            (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
        };
        let (one, two) = (wrap(q[0] + q[1] - coupler), wrap(q[2] - rocker));
        assert!(
            one.abs() < 1e-3 && two.abs() < 1e-3,
            "crank at {}: coupler off by {one}, rocker by {two}",
            q[0]
        );
    }
    assert!(bars.positions()[0] > 12.0, "{:?}", bars.positions());
}

#[test]
fn linkage_conserves_energy_like_a_tree_of_links() {
    let (coupler, rocker) = closed(1.0);
    let world = World { gravity: [0.0; 3], ..World::default() };
    let mut bars =
        ArticulatedSimulator::new(linkage(), world, &[1.0, coupler - 1.0, rocker], Options::default())
            .unwrap();
    bars.connect(&pin()).unwrap();
    let model = linkage();
    let energy = |bars: &ArticulatedSimulator| {
        motorium_robots::Dynamics::new(&model).kinetic_energy(&model, bars.configuration(), bars.velocity())
    };
    bars.commands_mut()[0] = JointSetpoint::effort(0.5);
    (0..300).for_each(|_| _ = bars.step(1e-3).unwrap());
    bars.commands_mut()[0] = JointSetpoint::default();
    bars.step(1e-3).unwrap();
    let start = energy(&bars);
    (0..3000).for_each(|_| _ = bars.step(1e-3).unwrap());
    assert!((energy(&bars) / start - 1.0).abs() < 0.02, "{} of {start} J", energy(&bars));
}

fn brick(name: &str, x: f64) -> Object {
    Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.2, 0.1, 0.1] },
        mass: Some(1.5),
        position: [x, 0.0, 3.0],
        ..Object::default()
    }
}

fn above() -> Model {
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0))
}

fn with_bricks(gravity: [f64; 3]) -> ArticulatedSimulator {
    let objects = vec![brick("one", 0.0), brick("two", 0.25)];
    let world = World { gravity, ground: Some(Ground::default()), objects, ..World::default() };
    ArticulatedSimulator::new(above(), world, &[0.0], Options::default()).unwrap()
}

#[test]
fn two_bricks_fixed_together_fall_and_land_as_one() {
    let mut bricks = with_bricks([0.0, 0.0, -9.81]);
    bricks.attach("one", "two").unwrap();
    let relative = |bricks: &ArticulatedSimulator| {
        let [one, two] = ["one", "two"].map(|name| bricks.object_pose(bricks.object(name).unwrap()));
        one.inv_mul(&two)
    };
    let start = relative(&bricks);
    for step in 0..2000 {
        bricks.step(1e-3).unwrap();
        let now = relative(&bricks);
        let (moved, turned) =
            (start.translation.vector - now.translation.vector, start.rotation.angle_to(&now.rotation));
        assert!(moved.norm() < 1e-4 && turned < 1e-4, "step {step}: {} m, {turned} rad", moved.norm());
    }
    let one = bricks.object_pose(bricks.object("one").unwrap());
    assert!((one.translation.z - 0.05).abs() < 1e-3, "they lie on the ground: {one}");
    assert!(bricks.detach("one", "two") && !bricks.detach("one", "two"));
}

#[test]
fn connected_bodies_conserve_momentum_in_flight() {
    for kind in [ConnectionKind::Ball, ConnectionKind::Fixed] {
        let mut bricks = with_bricks([0.0; 3]);
        let parts = ["one", "two"].map(str::to_owned);
        bricks.connect(&Connection { parts, kind, point: [0.125, 0.0, 0.0] }).unwrap();
        // Gravity moves both from rest for a moment, without any support: it causes no spin, so the momentum
        // is the momentum of the fall.
        bricks.set_gravity(Vector3::new(0.3, 0.0, 1.0));
        (0..200).for_each(|_| _ = bricks.step(1e-3).unwrap());
        bricks.set_gravity(Vector3::zeros());
        let momentum = |bricks: &ArticulatedSimulator| -> Vector3<f64> {
            ["one", "two"]
                .iter()
                .map(|name| bricks.object_velocity(bricks.object(name).unwrap()).0 * 1.5)
                .sum()
        };
        let before = momentum(&bricks);
        (0..500).for_each(|_| _ = bricks.step(1e-3).unwrap());
        assert!((momentum(&bricks) - before).norm() < 1e-9, "{kind:?}");
        assert!((before - Vector3::new(0.3, 0.0, 1.0) * 0.2 * 3.0).norm() < 1e-9, "{kind:?}: {before}");
    }
}

#[test]
fn a_rod_with_a_weight_attached_swings_with_the_period_of_both() {
    let rod = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let last = rod.frames().last().unwrap().name.clone();
    let weight = Object {
        name: "weight".to_owned(),
        shape: ObjectShape::Sphere { radius: 0.02 },
        mass: Some(2.0),
        position: [-(0.8 * 0.1_f64.sin()), 0.0, -(0.8 * 0.1_f64.cos())],
        ..Object::default()
    };
    let world = World { objects: vec![weight], ..World::default() };
    let mut swing = ArticulatedSimulator::new(rod.clone(), world, &[0.1], Options::default()).unwrap();
    swing.attach(&last, "weight").unwrap();
    // Inertia about the hinge and gravity moment of the rod, from its mass matrix and gravity, plus the
    // weight's inertia about its centre.
    let mut dynamics = motorium_robots::Dynamics::new(&rod);
    let mut mass = nalgebra::DMatrix::zeros(1, 1);
    dynamics.crba(&rod, &[0.0], &mut mass);
    let mut torque = vec![0.0];
    dynamics.bias(&rod, &[0.01], &[0.0], Vector3::new(0.0, 0.0, -9.81), &mut torque);
    let place = swing.object_pose(swing.object("weight").unwrap()).translation.vector;
    let arm = place.norm();
    let inertia = mass[(0, 0)] + 2.0 * arm * arm + 0.4 * 2.0 * 0.02 * 0.02;
    let stiffness = torque[0].abs() / 0.01_f64.sin() + 2.0 * 9.81 * arm;
    let period = std::f64::consts::TAU * (inertia / stiffness).sqrt();
    let mut passes = Vec::new();
    let mut before = swing.object_pose(swing.object("weight").unwrap()).translation.x;
    for step in 1..10_000 {
        swing.step(5e-4).unwrap();
        let now = swing.object_pose(swing.object("weight").unwrap()).translation.x;
        if before > 0.0 && now <= 0.0 {
            passes.push(5e-4 * (f64::from(step) - now / (now - before)));
        }
        before = now;
    }
    let found = passes[1] - passes[0];
    // An amplitude of 0.1 rad lengthens the period by 0.06 %; the effect of the rod's damping is negligible.
    assert!((found / period - 1.0).abs() < 3e-3, "{found} s, expected {period} s");
}

#[test]
fn reset_keeps_connections_and_drops_attachments() {
    let mut bricks = with_bricks([0.0; 3]);
    let parts = ["one", "two"].map(str::to_owned);
    bricks.connect(&Connection { parts, kind: ConnectionKind::Fixed, point: [0.0; 3] }).unwrap();
    bricks.attach("two", "world").unwrap();
    bricks.reset(&[0.0], &[0.0]).unwrap();
    assert!(!bricks.detach("world", "two") && bricks.detach("two", "one"));
}

#[test]
fn saved_loop_continues_bit_for_bit() {
    let (coupler, rocker) = closed(0.3);
    let q = [0.3, coupler - 0.3, rocker];
    let mut bars = ArticulatedSimulator::new(linkage(), World::default(), &q, Options::default()).unwrap();
    let before = bars.save();
    bars.connect(&pin()).unwrap();
    (0..100).for_each(|_| _ = bars.step(1e-3).unwrap());
    let saved = bars.save();
    let on = |bars: &mut ArticulatedSimulator| {
        (0..300).for_each(|_| _ = bars.step(1e-3).unwrap());
        bars.configuration().to_vec()
    };
    let first = on(&mut bars);
    bars.restore(&before).unwrap();
    on(&mut bars);
    bars.restore(&saved).unwrap();
    assert_eq!(first, on(&mut bars));
}

#[test]
fn impossible_connections_are_rejected() {
    let mut bars =
        ArticulatedSimulator::new(linkage(), World::default(), &[0.0; 3], Options::default()).unwrap();
    let words = bars.attach("coupler", "rockr").unwrap_err().to_string();
    assert_eq!(words, "there is no link or object \"rockr\" (did you mean \"rocker\"?)");
    assert!(matches!(bars.attach("base", "world"), Err(ConnectError::Rigid { .. })));
    let nowhere = Connection { point: [f64::NAN, 0.0, 0.0], ..pin() };
    assert!(matches!(bars.connect(&nowhere), Err(ConnectError::Point(_))));
    let mut other = RapierSimulator::new(linkage(), World::default(), &[0.0; 3], Options::default()).unwrap();
    assert_eq!(other.connect(&pin()), Err(ConnectError::Unable { engine: "rapier" }));
    if has_mujoco() {
        let mut other =
            MujocoSimulator::new(linkage(), World::default(), &[0.0; 3], Options::default()).unwrap();
        assert_eq!(other.connect(&pin()), Err(ConnectError::Unable { engine: "MuJoCo" }));
    }
}

#[test]
fn a_connection_to_a_fixed_object_keeps_other_contacts() {
    let cube = |name: &str, mass: Option<f64>, position: [f64; 3]| Object {
        name: name.to_owned(),
        shape: ObjectShape::Box { size: [0.1; 3] },
        mass,
        position,
        ..Object::default()
    };
    // It hangs by a corner on a post, above a shelf in the path of its swing.
    let objects = vec![
        cube("post", None, [0.0, 0.0, 1.0]),
        cube("shelf", None, [0.3, 0.0, 0.85]),
        cube("beam", None, [0.3, 0.0, 1.2]),
        cube("weight", Some(1.0), [0.3, 0.0, 1.0]),
    ];
    let pendulum = load("pendulum", std::path::Path::new(".")).unwrap().model;
    let pendulum = pendulum.placed(&Isometry3::translation(0.0, 0.0, 50.0));
    let world = World { objects, ..World::default() };
    let mut simulation = ArticulatedSimulator::new(pendulum, world, &[0.0], Options::default()).unwrap();
    let pin = |other: &str| Connection {
        parts: [other.to_owned(), "weight".to_owned()],
        kind: ConnectionKind::Ball,
        point: [0.0; 3],
    };
    simulation.connect(&pin("post")).unwrap();
    (0..1500).for_each(|_| _ = simulation.step(1e-3).unwrap());
    let height = |simulation: &ArticulatedSimulator| {
        simulation.object_pose(simulation.object("weight").unwrap()).translation.z
    };
    let low = height(&simulation);
    assert!(low > 0.93, "the shelf carries it, at {low} m");
    // Only the named one of two connections is removed.
    simulation.connect(&pin("beam")).unwrap();
    assert!(simulation.detach("beam", "weight"));
    assert!(!simulation.detach("beam", "weight"));
    assert!(simulation.detach("post", "weight"));
}

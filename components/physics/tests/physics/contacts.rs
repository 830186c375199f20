//! Contacts of objects, the ground, and the robot.

use motorium_physics::{
    ArticulatedSimulator, BuildError, Ground, JointSetpoint, Object, ObjectShape, Options, RapierSimulator,
    RobotSetup, Simulator, World, WorldError,
};
use motorium_robots::{MimicMode, Model, PackagePath, Srdf, parse_urdf};
use nalgebra::Isometry3;

use crate::engines::{Engine, engines};
use crate::panda;

const DT: f64 = 1e-3;

fn object(name: &str, shape: ObjectShape, mass: Option<f64>, position: [f64; 3]) -> Object {
    Object { name: name.to_owned(), shape, mass, position, ..Object::default() }
}

fn grounded(objects: Vec<Object>) -> World {
    World { ground: Some(Ground::default()), objects, ..World::default() }
}

fn run(simulation: &mut dyn Simulator, seconds: f64) -> usize {
    (0..(seconds / DT).round() as usize).map(|_| usize::from(simulation.step(DT).unwrap().near_contact)).sum()
}

/// A ball of 2 kg and 5 cm on a vertical rail, with its centre at height q.
fn ram() -> Model {
    let urdf = r#"<robot name="ram"><link name="rail"/><link name="head"><inertial><mass value="2"/>
        <inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
        <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
        <joint name="slide" type="prismatic"><parent link="rail"/><child link="head"/><axis xyz="0 0 1"/>
        <limit lower="-1" upper="1" velocity="5" effort="100"/></joint></robot>"#;
    parse_urdf(urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn a_box_falls_and_rests_on_the_ground_with_its_weight() {
    for engine in engines() {
        let cube = object("cube", ObjectShape::Box { size: [0.1; 3] }, Some(0.5), [1.0, 0.0, 0.3]);
        let mut simulation = panda::at_home(engine, grounded(vec![cube]), Options::default());
        let home = panda::home();
        panda::command_hold(&mut *simulation, &home);
        let cube = simulation.object("cube").unwrap();
        run(&mut *simulation, 0.1);
        // Free fall for 0.1 s, semi-implicit in integration steps of h: g t (t + h) / 2. Rapier uses two per
        // millisecond.
        let fallen = 0.3 - simulation.object_pose(cube).translation.z;
        let h = if engine == Engine::Rapier { 0.5 * DT } else { DT };
        assert!((fallen - 0.5 * 9.81 * 0.1 * (0.1 + h)).abs() < 1e-4, "{engine:?}: {fallen}");
        run(&mut *simulation, 2.0);
        let pose = simulation.object_pose(cube);
        assert!((pose.translation.z - 0.05).abs() < 1e-3, "rests at {}", pose.translation.z);
        assert!(pose.rotation.angle() < 1e-3 && simulation.object_velocity(cube).0.norm() < 1e-3);
        let mut force = 0.0;
        simulation.visit_contacts(&mut |contact| {
            assert!(
                ["cube", "ground"].contains(&contact.first) && ["cube", "ground"].contains(&contact.second)
            );
            let up = if contact.first == "ground" { 1.0 } else { -1.0 };
            assert!((contact.normal.z - up).abs() < 1e-6 && contact.point.z.abs() < 2e-3);
            force += contact.force;
        });
        assert!((force - 0.5 * 9.81).abs() < 0.05, "{force} N");
        assert!(simulation.touching("cube", "ground") && simulation.touching("ground", "cube"));
    }
}

#[test]
fn objects_rotate_by_the_inertia_of_their_shape() {
    for engine in engines() {
        // A rod spinning about two axes: its angular momentum is constant without torque.
        let rod =
            object("rod", ObjectShape::Cylinder { radius: 0.01, length: 0.2 }, Some(0.1), [1.0, 0.0, 1.0]);
        let world = World { gravity: [0.0; 3], objects: vec![rod], ..World::default() };
        let shape = world.objects[0].shape.clone();
        let moments = shape.principal_inertia(0.1);
        assert!(
            (moments.x - 0.1 * (3.0 * 1e-4 + 0.04) / 12.0).abs() < 1e-12 && (moments.z - 5e-6).abs() < 1e-15
        );
        // Dropped on its edge it must fall over about the right axis: a tilted disc ends up lying flat.
        let mut disc = object(
            "disc",
            ObjectShape::Cylinder { radius: 0.05, length: 0.004 },
            Some(0.02),
            [1.0, 0.0, 0.06],
        );
        disc.rpy = [0.9, 0.0, 0.0];
        let mut simulation = panda::at_home(engine, grounded(vec![disc]), Options::default());
        run(&mut *simulation, 3.0);
        let pose = simulation.object_pose(simulation.object("disc").unwrap());
        let up = pose.rotation * nalgebra::Vector3::z();
        assert!(up.z.abs() > 0.999, "{up}");
        assert!((pose.translation.z - 0.002).abs() < 5e-4, "{}", pose.translation.z);
    }
}

#[test]
fn ground_force_matches_the_commanded_press() {
    for engine in engines() {
        let world = grounded(vec![]);
        let mut simulation = engine.simulate(ram(), world, &[0.2], Options::default());
        // Down to 3 cm inside the ground with 1 kN/m: weight and spring press together.
        simulation.commands_mut()[0] = JointSetpoint::hold(0.02, 1_000.0, 60.0);
        let near = run(&mut *simulation, 2.0);
        assert!(near > 0 && (engine == Engine::Rapier || near < 2000));
        let q = simulation.positions()[0];
        assert!((q - 0.05).abs() < 2e-3, "{engine:?}: {q}");
        let effort = simulation.efforts()[0];
        assert!((effort - 1_000.0 * (0.02 - q)).abs() < 0.5, "{engine:?}: {effort} N at {q} m");
        let mut force = 0.0;
        simulation.visit_contacts(&mut |contact| force += contact.force);
        assert!((force - (2.0 * 9.81 - effort)).abs() < 0.5, "{engine:?}: {force} N against {effort} N");
        assert!(simulation.touching("head", "ground"));
        // Up again: the contact opens.
        simulation.commands_mut()[0] = JointSetpoint::hold(0.2, 1_000.0, 60.0);
        run(&mut *simulation, 1.0);
        assert!(!simulation.touching("head", "ground"));
        assert!((simulation.positions()[0] - (0.2 - 2.0 * 9.81 / 1_000.0)).abs() < 1e-3);
    }
}

#[test]
fn effort_limits_hold_while_pressing() {
    for engine in engines() {
        let mut simulation = engine.simulate(ram(), grounded(vec![]), &[0.07], Options::default());
        simulation.commands_mut()[0] = JointSetpoint::hold(-0.9, 10_000.0, 100.0);
        run(&mut *simulation, 1.0);
        for _ in 0..500 {
            let report = simulation.step(DT).unwrap();
            assert_eq!(report.saturated, 1);
            assert!(simulation.efforts()[0].abs() <= 100.0 + 1e-9, "{}", simulation.efforts()[0]);
        }
        let mut force = 0.0;
        simulation.visit_contacts(&mut |contact| force += contact.force);
        assert!((force - (100.0 + 2.0 * 9.81)).abs() < 1.0, "{force} N");
    }
}

#[test]
fn the_arm_pushes_an_object_and_is_pushed_back() {
    for engine in engines() {
        // The ram moves sideways here, on a rail along x.
        let urdf = r#"<robot name="pusher"><link name="rail"/><link name="head"><inertial><mass value="2"/>
            <inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
            <collision><geometry><sphere radius="0.05"/></geometry></collision></link>
            <joint name="slide" type="prismatic"><origin xyz="0 0 0.1"/><parent link="rail"/><child link="head"/>
            <axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="5" effort="100"/></joint></robot>"#;
        let model = parse_urdf(urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
        let mut cube = object("cube", ObjectShape::Box { size: [0.2; 3] }, Some(1.0), [0.2, 0.0, 0.1]);
        // The mean of 0 and 0.8 below, and of 0 and 0 between pusher and cube.
        (cube.friction, cube.friction_combine) = (0.0, Some(motorium_worlds::FrictionCombine::Mean));
        let world = grounded(vec![cube]);
        let mut simulation =
            engine.simulate(model, world, &[0.0], Options { friction: 0.0, ..Options::default() });
        simulation.commands_mut()[0] =
            JointSetpoint { velocity: 0.1, kd: 5_000.0, ..JointSetpoint::default() };
        run(&mut *simulation, 3.0);
        let cube = simulation.object("cube").unwrap();
        let moved = simulation.object_pose(cube).translation.x - 0.2;
        // 3 s at 0.1 m/s, minus the first 5 cm without contact.
        assert!((moved - 0.25).abs() < 0.01, "{engine:?}: {moved} m");
        // Sliding friction: mu m g. On MuJoCo's soft ground the cube rocks as it slides, so half a second is
        // averaged there.
        let samples = if engine == Engine::Mujoco { 500 } else { 1 };
        let mut effort = 0.0;
        for sample in 0..samples {
            effort += simulation.efforts()[0] / f64::from(samples);
            if sample + 1 < samples {
                run(&mut *simulation, DT);
            }
        }
        assert!((effort - 0.4 * 9.81).abs() < 0.2, "{engine:?}: {effort} N");
    }
}

#[test]
fn the_panda_closes_its_hand_on_a_cube_and_lifts_it() {
    for engine in engines() {
        let panda = panda::loaded();
        let profile = panda.profile.unwrap();
        let home = profile.home(&panda.model).unwrap();
        let tcp = panda.model.frame("panda_hand_tcp").unwrap();
        let mut kinematics = motorium_robots::Kinematics::new(&panda.model);
        kinematics.update(&panda.model, home.as_slice());
        let grasp = kinematics.pose(&panda.model, tcp).translation.vector;
        // A pillar under the cube keeps it between the fingers.
        let height = grasp.z - 0.02;
        let pillar = object(
            "pillar",
            ObjectShape::Box { size: [0.03, 0.03, height] },
            None,
            [grasp.x, grasp.y, 0.5 * height],
        );
        let mut cube =
            object("cube", ObjectShape::Box { size: [0.04; 3] }, Some(0.1), [grasp.x, grasp.y, grasp.z]);
        cube.friction = 1.0;
        let options = Options { friction: 1.0, ..Options::default() };
        let mut simulation =
            engine.simulate(panda.model, grounded(vec![pillar, cube]), home.as_slice(), options);
        let mut goal = home.as_slice().to_vec();
        panda::command_hold(&mut *simulation, &goal);
        run(&mut *simulation, 0.2);
        goal[7] = 0.0;
        let close = |simulation: &mut dyn Simulator, goal: &[f64]| {
            panda::command_hold(simulation, goal);
            simulation.commands_mut()[7] =
                JointSetpoint { effort: -20.0, kd: 10.0, ..JointSetpoint::default() };
        };
        close(&mut *simulation, &goal);
        run(&mut *simulation, 0.5);
        assert!((simulation.positions()[7] - 0.02).abs() < 2e-3, "fingers at {}", simulation.positions()[7]);
        assert!(
            simulation.touching("cube", "panda_leftfinger")
                && simulation.touching("cube", "panda_rightfinger")
        );
        let cube = simulation.object("cube").unwrap();
        let before = simulation.object_pose(cube).translation.z;
        // Lift by bending the elbow a little over a second.
        for i in 1..=1000 {
            let mut next = goal.clone();
            next[1] -= 0.2 * f64::from(i) / 1000.0;
            close(&mut *simulation, &next);
            simulation.step(DT).unwrap();
        }
        run(&mut *simulation, 0.5);
        let lifted = simulation.object_pose(cube).translation.z - before;
        assert!(lifted > 0.05, "lifted by {lifted} m");
        assert!(!simulation.touching("cube", "pillar") && simulation.touching("cube", "panda_leftfinger"));
    }
}

#[test]
fn contacts_are_searched_only_near_the_robot() {
    let mut simulation = panda::at_home(Engine::Articulated, grounded(vec![]), Options::default());
    assert!(
        simulation.warnings().iter().all(|w| !w.to_string().contains("ground")),
        "{:?}",
        simulation.warnings()
    );
    let home = panda::home();
    panda::command_hold(&mut *simulation, &home);
    assert_eq!(run(&mut *simulation, 0.5), 0, "nothing is near the arm at home");
    // A wall placed in front of the hand has an immediate effect.
    let wall = object("wall", ObjectShape::Box { size: [0.1, 1.0, 1.0] }, None, [3.0, 0.0, 0.5]);
    let mut simulation = panda::at_home(Engine::Articulated, grounded(vec![wall]), Options::default());
    panda::command_hold(&mut *simulation, &home);
    assert_eq!(run(&mut *simulation, 0.1), 0);
    let hand = simulation.frame_pose(simulation.model().frame("panda_hand").unwrap());
    let wall = simulation.object("wall").unwrap();
    simulation.set_object_pose(wall, Isometry3::translation(hand.translation.x + 0.08, 0.0, 0.5));
    assert_eq!(run(&mut *simulation, 0.01), 10);
}

#[test]
fn both_engines_move_the_arm_equally() {
    // The same second of motion, far from everything.
    let home = panda::home();
    let mut ends = Vec::new();
    for engine in engines() {
        let substeps = if engine == Engine::Articulated { 4 } else { 1 };
        let options = Options { substeps, contact_iterations: 4, ..Options::default() };
        let mut simulation = panda::at_home(engine, World::default(), options);
        for i in 0..1000 {
            let phase = f64::from(i) * DT * std::f64::consts::PI;
            let goal: Vec<f64> = home
                .iter()
                .enumerate()
                .map(|(j, q)| if j < 7 { q + 0.2 * (1.0 - phase.cos()) } else { 0.02 })
                .collect();
            panda::command_hold(&mut *simulation, &goal);
            simulation.step(DT).unwrap();
        }
        ends.push(simulation.positions().to_vec());
    }
    for (free, contact) in ends[0].iter().zip(&ends[1]) {
        assert!((free - contact).abs() < 2e-4, "{free} and {contact}");
    }
}

#[test]
fn a_reset_restores_robot_and_objects() {
    for engine in engines() {
        let ball = object("ball", ObjectShape::Sphere { radius: 0.05 }, Some(0.2), [1.0, 0.0, 0.5]);
        let mut simulation = panda::at_home(engine, grounded(vec![ball]), Options::default());
        let home = panda::home();
        run(&mut *simulation, 0.5);
        simulation.reset(&home, &vec![0.0; home.len()]).unwrap();
        assert_eq!(simulation.positions(), home);
        let ball = simulation.object("ball").unwrap();
        assert_eq!(simulation.object_pose(ball).translation.z, 0.5);
        assert!(simulation.reset(&home[1..], &[]).unwrap_err().to_string().contains("expected 8"));
        let mut bad = home.clone();
        bad[2] = f64::INFINITY;
        assert!(simulation.reset(&bad, &home).unwrap_err().to_string().contains("panda_joint3"));
    }
}

#[test]
fn invalid_worlds_are_reported() {
    let cube = |name: &str| object(name, ObjectShape::Box { size: [0.1; 3] }, None, [1.0, 0.0, 0.0]);
    let build = |world: World| {
        let error =
            ArticulatedSimulator::new(panda::loaded().model, world, &panda::home(), Options::default())
                .err()
                .unwrap();
        let BuildError::World(error) = error else { panic!("{error}") };
        error
    };
    let twice = build(grounded(vec![cube("a"), cube("a")]));
    assert!(matches!(twice, WorldError::NameTaken { .. }), "{twice}");
    assert!(build(grounded(vec![cube("panda_hand")])).to_string().contains("a link of the robot"));
    assert!(build(grounded(vec![cube("ground")])).to_string().contains("the ground plane"));
    let mut light = cube("a");
    light.mass = Some(0.0);
    assert!(build(grounded(vec![light])).to_string().contains("a: `mass` is 0, expected a positive number"));
    let options = Options { contact_iterations: 0, ..Options::default() };
    let error = ArticulatedSimulator::new(panda::loaded().model, World::default(), &panda::home(), options)
        .err()
        .unwrap();
    assert!(error.to_string().contains("`contact_iterations` is 0"), "{error}");
    // Rapier always runs the same number of integration steps.
    let options = Options { substeps: 4, ..Options::default() };
    let error = RapierSimulator::new(ram(), World::default(), &[0.2], options).err().unwrap();
    assert!(error.to_string().contains("`substeps` is 4, expected 1"), "{error}");
}

#[test]
fn links_disabled_by_a_collision_rule_pass_through_each_other() {
    // A ball that slides down a table which carries the ball's carrier.
    let urdf = r#"<robot name="gantry"><link name="table"><collision><geometry><box size="0.4 0.4 0.1"/></geometry>
        </collision></link>
        <link name="bridge"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
        </inertial><collision><origin xyz="0 0 1"/><geometry><sphere radius="0.02"/></geometry></collision></link>
        <link name="ball"><inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>
        </inertial><collision><geometry><sphere radius="0.05"/></geometry></collision></link>
        <joint name="x" type="prismatic"><parent link="table"/><child link="bridge"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" velocity="5" effort="100"/></joint>
        <joint name="z" type="prismatic"><parent link="bridge"/><child link="ball"/><axis xyz="0 0 1"/>
        <limit lower="-0.5" upper="0.5" velocity="5" effort="100"/></joint></robot>"#;
    let model = parse_urdf(urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model;
    let disabled = vec![("ball".to_owned(), "table".to_owned())];
    for (rules, rest) in [(Srdf::default(), 0.1), (Srdf { disabled, ..Srdf::default() }, -0.5)] {
        let setup = RobotSetup { collision_rules: rules, ..RobotSetup::from(model.clone()) };
        let (world, q, options) = (World::default(), [0.0, 0.3], Options::default());
        let articulated = ArticulatedSimulator::new(setup.clone(), world.clone(), &q, options).unwrap();
        let rapier = RapierSimulator::new(setup, world, &q, options).unwrap();
        let both: [Box<dyn Simulator>; 2] = [Box::new(articulated), Box::new(rapier)];
        for mut simulation in both {
            run(&mut *simulation, 1.5);
            let found = simulation.positions()[1];
            assert!((found - rest).abs() < 2e-3, "{found}, expected {rest}");
        }
    }
}

/// A block of 2 kg that slides along x and z only, or along x only.
fn block(planar: bool) -> Model {
    let inertia = r#"<inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>"#;
    let limit = r#"<limit lower="-9" upper="9" velocity="9" effort="100"/>"#;
    let z = format!(
        r#"<link name="lift">{}</link><joint name="z" type="prismatic"><parent link="world"/><child link="lift"/>
        <axis xyz="0 0 1"/>{limit}</joint>"#,
        inertia.replace("\"2\"", "\"1e-3\"")
    );
    let (z, carrier) = if planar { (z, "lift") } else { (String::new(), "world") };
    let urdf = format!(
        r#"<robot name="block"><link name="world"/>{z}<link name="block">{inertia}<collision><geometry>
        <box size="0.2 0.2 0.1"/></geometry></collision></link><joint name="x" type="prismatic"><parent link="{carrier}"/>
        <child link="block"/><axis xyz="1 0 0"/>{limit}</joint></robot>"#
    );
    parse_urdf(&urdf, None, MimicMode::Follow, &PackagePath::default()).unwrap().model
}

#[test]
fn friction_brakes_a_robot_blocked_along_one_tangent() {
    let world = World { ground: Some(Ground { friction: 0.5, ..Ground::default() }), ..World::default() };
    let options = Options { friction: 0.5, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(block(true), world, &[0.05, 0.0], options).unwrap();
    simulation.reset(&[0.05, 0.0], &[0.0, 1.0]).unwrap();
    run(&mut simulation, 0.1);
    // Deceleration mu g.
    let expected = 1.0 - 0.5 * 9.81 * 0.1;
    assert!((simulation.velocities()[1] - expected).abs() < 2e-3, "{:?}", simulation.velocities());
    run(&mut simulation, 0.4);
    assert!(simulation.velocities()[1].abs() < 1e-6 && simulation.positions()[0] > 0.0499);
}

#[test]
fn contact_blocked_by_joints_does_not_disturb_the_motion() {
    // The block starts 2 cm inside the ground and cannot leave it. Without friction it moves freely along its
    // rail.
    let world = World {
        ground: Some(Ground { friction: 0.0, height: -0.03, ..Ground::default() }),
        ..World::default()
    };
    let options = Options { friction: 0.0, ..Options::default() };
    let mut simulation = ArticulatedSimulator::new(block(false), world, &[0.0], options).unwrap();
    assert!(simulation.warnings().iter().any(|warning| warning.to_string().contains("starts inside")));
    simulation.reset(&[0.0], &[0.5]).unwrap();
    run(&mut simulation, 1.0);
    assert!((simulation.positions()[0] - 0.5).abs() < 1e-9, "{:?}", simulation.positions());
}

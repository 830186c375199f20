//! Objects with several shapes on every engine, and MJCF worlds with height fields and connected bodies.

use motorium_physics::{Ground, Object, ObjectShape, Simulator, World};
use motorium_worlds::{CompoundPart, parse_mjcf_world};
use nalgebra::{Point3, Vector3};

use crate::engines::{Engine, engines, has_mujoco};
use crate::meshes::{pose, run, simulate, with_triangles};

const DT: f64 = 1e-3;
const G: f64 = 9.81;

fn part(shape: ObjectShape, position: [f64; 3], mass: Option<f64>) -> CompoundPart {
    CompoundPart { shape, position, rpy: [0.0; 3], mass }
}

/// A block of 0.2 x 0.16 x 0.1 m made of two halves, one of them on its side.
fn halves() -> Object {
    let left = part(ObjectShape::Box { size: [0.1, 0.16, 0.1] }, [-0.05, 0.0, 0.0], None);
    let right = CompoundPart {
        rpy: [0.0, 0.0, core::f64::consts::FRAC_PI_2],
        ..part(ObjectShape::Box { size: [0.16, 0.1, 0.1] }, [0.05, 0.0, 0.0], None)
    };
    Object {
        name: "block".to_owned(),
        shape: ObjectShape::Compound(vec![left, right]),
        mass: Some(2.0),
        position: [0.0, 0.0, 0.05],
        friction: 0.4,
        ..Object::default()
    }
}

/// Two balls on a rod, one of them heavier.
fn dumbbell() -> Object {
    let ball = |x: f64, mass: f64| part(ObjectShape::Sphere { radius: 0.05 }, [x, 0.0, 0.0], Some(mass));
    let rod = CompoundPart {
        rpy: [0.0, core::f64::consts::FRAC_PI_2, 0.0],
        ..part(ObjectShape::Cylinder { radius: 0.01, length: 0.4 }, [0.0; 3], Some(0.2))
    };
    Object {
        name: "dumbbell".to_owned(),
        shape: ObjectShape::Compound(vec![ball(-0.2, 1.0), ball(0.2, 3.0), rod]),
        position: [0.0, 0.0, 0.3],
        ..Object::default()
    }
}

fn block() -> Object {
    Object { shape: ObjectShape::Box { size: [0.2, 0.16, 0.1] }, ..halves() }
}

#[test]
fn a_block_of_two_halves_moves_as_one_on_every_engine() {
    let slope = 0.75_f64;
    let gravity = [G * slope.sin() * 0.6, G * slope.sin() * 0.8, -G * slope.cos()];
    for engine in engines() {
        let ground = Some(Ground { friction: 0.6, ..Ground::default() });
        let ends = [block(), halves()].map(|object| {
            let world = World { gravity, objects: vec![object], ground, ..World::default() };
            let mut simulation = simulate(engine, world);
            run(&mut *simulation, 1.0);
            pose(&*simulation, "block")
        });
        let [one, two] = ends.map(|end| end.translation.vector);
        assert!(one.xy().norm() > 0.5, "{engine:?}: {one}");
        let (way, expected) = (two.xy().norm(), one.xy().norm());
        assert!((way - expected).abs() < 0.02 * expected, "{engine:?}: {way} m, one block {expected} m");
        let apart = one.xy().angle(&two.xy());
        println!("{engine:?}: ways {apart:.4} rad apart, straying {:.4} m", (one - two).norm());
        // With spring contacts, as in Rapier and MuJoCo, it deviates by some hundredths of a radian.
        let most = if engine == Engine::Articulated { 1e-3 } else { 0.08 };
        assert!(apart < most, "{engine:?}: it slides {apart} rad off the path of one block");
        // In MuJoCo, whose contacts are springs with regularised friction, it turns by 0.3 rad as it slides.
        let turned = ends[1].rotation.angle();
        let most = if engine == Engine::Mujoco { 0.4 } else { 1e-2 };
        assert!(turned < most, "{engine:?}: it turns by {turned}");
    }
}

#[test]
fn a_dumbbell_rests_on_both_balls_by_weight() {
    for engine in engines() {
        let world = World { ground: Some(Ground::default()), objects: vec![dumbbell()], ..World::default() };
        let mut simulation = simulate(engine, world);
        run(&mut *simulation, 1.5);
        let height = pose(&*simulation, "dumbbell").translation.z;
        assert!((height - 0.05).abs() < 1e-3, "{engine:?}: {height} m");
        let mut shares = [0.0; 2];
        let here = pose(&*simulation, "dumbbell").inverse();
        simulation.visit_contacts(&mut |contact| {
            shares[usize::from((here * contact.point).x > 0.0)] += contact.force
        });
        // Moments about either ball: each carries half of the rod's weight.
        for (found, expected) in shares.iter().zip([1.1 * G, 3.1 * G]) {
            assert!((found - expected).abs() < 0.02 * expected, "{engine:?}: {shares:?} N");
        }
    }
}

#[test]
fn a_compound_in_free_flight_turns_about_its_centre_of_mass() {
    for engine in engines() {
        let mut simulation = simulate(engine, World { objects: vec![dumbbell()], ..World::default() });
        run(&mut *simulation, 0.3);
        let centre = pose(&*simulation, "dumbbell") * Point3::new(0.4 / 4.2, 0.0, 0.0);
        assert!((centre.x - 0.4 / 4.2).abs() < 1e-9, "{engine:?}: {centre}");
        let fallen = 0.5 * G * 0.09;
        assert!((0.3 - centre.z - fallen).abs() < 0.01 * fallen, "{engine:?}: {centre}");
        assert!(pose(&*simulation, "dumbbell").rotation.angle() < 1e-9, "{engine:?}");
    }
}

#[test]
fn rays_hit_parts_of_a_compound_and_pass_its_gap() {
    for engine in engines() {
        let simulation = simulate(engine, World { objects: vec![dumbbell()], ..World::default() });
        let down = |x: f64, y: f64| simulation.cast_ray(Point3::new(x, y, 2.0), -Vector3::z(), 5.0);
        let hit = down(0.2, 0.0).unwrap();
        assert!(hit.name == "dumbbell" && (hit.distance - 1.65).abs() < 1e-9, "{engine:?}: {hit:?}");
        assert!((down(0.0, 0.0).unwrap().distance - 1.69).abs() < 1e-9, "{engine:?}");
        assert!(down(0.0, 0.03).is_none(), "{engine:?}");
    }
}

#[test]
fn compounds_do_not_allocate_and_restore_exactly() {
    let ground = Some(Ground::default());
    let tilted = Object { rpy: [0.4, 0.7, 0.1], ..dumbbell() };
    let above = Object { position: [0.05, 0.0, 0.8], rpy: [0.2, 0.3, 0.0], ..halves() };
    let objects = vec![tilted, above];
    let mut simulation = simulate(Engine::Articulated, World { objects, ground, ..World::default() });
    run(&mut *simulation, 0.2);
    let saved = simulation.save();
    let state = |simulation: &dyn Simulator| {
        let poses = ["dumbbell", "block"].map(|name| pose(simulation, name).to_homogeneous());
        poses.iter().flat_map(|pose| pose.iter().map(|x| x.to_bits()).collect::<Vec<_>>()).collect::<Vec<_>>()
    };
    let before = motorium::telemetry::allocations().own;
    (0..400).for_each(|_| _ = simulation.step(DT).unwrap());
    assert_eq!(motorium::telemetry::allocations().own - before, 0);
    let first = state(&*simulation);
    simulation.restore(&saved).unwrap();
    run(&mut *simulation, 0.4);
    assert_eq!(state(&*simulation), first);
}

#[test]
fn incompatible_parts_are_rejected_by_object_name() {
    let refuse =
        |object: Object| Engine::Articulated.refuse(World { objects: vec![object], ..World::default() });
    let sphere = || ObjectShape::Sphere { radius: 0.1 };
    let of = |parts: Vec<CompoundPart>| Object { shape: ObjectShape::Compound(parts), ..dumbbell() };
    let none = refuse(of(Vec::new()));
    assert!(none.contains("dumbbell: a compound must have from 1 to 64 parts"), "{none}");
    let some = refuse(of(vec![part(sphere(), [0.0; 3], Some(1.0)), part(sphere(), [0.1; 3], None)]));
    assert!(some.contains("some of its parts have a mass"), "{some}");
    let nothing = refuse(of(vec![part(sphere(), [0.0; 3], Some(0.0))]));
    assert!(nothing.contains("the masses of all its parts are zero"), "{nothing}");
    let both = refuse(Object { density: Some(1.0), ..dumbbell() });
    assert!(both.contains("`density`"), "{both}");
    let nested = refuse(of(vec![part(dumbbell().shape, [0.0; 3], None)]));
    assert!(nested.contains("a part of a compound is itself a compound"), "{nested}");
    let flat = refuse(of(vec![part(ObjectShape::Sphere { radius: -1.0 }, [0.0; 3], None)]));
    assert!(flat.contains("`radius` is -1"), "{flat}");
}

/// A valley between two slopes of a height field.
const VALLEY: &str = r#"<mujoco>
  <asset><hfield name="valley" nrow="2" ncol="3" size="1 1 0.5 0.1" elevation="1 0 1 1 0 1"/></asset>
  <worldbody>
    <geom type="hfield" hfield="valley"/>
    <body name="ball" pos="0.5 0 0.5"><freejoint/><geom size="0.05" mass="0.2"/></body>
  </worldbody>
</mujoco>"#;

#[test]
fn a_ball_rolls_down_an_mjcf_height_field() {
    let slope = 0.5_f64.atan();
    for engine in with_triangles() {
        let mut world = parse_mjcf_world(VALLEY, None).unwrap().world;
        // On the slope, in perpendicular contact.
        world.objects[1].position = [0.5 - 0.05 * slope.sin(), 0.1, 0.25 + 0.05 * slope.cos()];
        let start = Vector3::from(world.objects[1].position);
        let mut simulation = simulate(engine, world);
        run(&mut *simulation, 0.4);
        let way = (pose(&*simulation, "ball").translation.vector - start).norm();
        let expected = 0.5 * 5.0 / 7.0 * G * slope.sin() * 0.16;
        assert!((way - expected).abs() < 0.03 * expected, "{engine:?}: {way} m, expected {expected} m");
        run(&mut *simulation, 5.0);
        let end = pose(&*simulation, "ball").translation.vector;
        assert!(end.x.abs() < 0.5 && end.z < 0.3, "{engine:?}: it stays in the valley: {end}");
    }
}

/// A ball on a rod of 0.5 m below a post.
const PENDULUM: &str = r#"<mujoco>
  <worldbody>
    <geom name="post" type="box" size="0.05 0.05 0.05" pos="0 0 2"/>
    <body name="bob" pos="0.05 0 1.5025"><freejoint/><geom size="0.04" mass="0.7"/></body>
  </worldbody>
  <equality><connect body1="bob" anchor="-0.05 0 0.4975"/></equality>
</mujoco>"#;

#[test]
fn body_connected_in_an_mjcf_world_swings_as_a_pendulum() {
    let world = || parse_mjcf_world(PENDULUM, None).unwrap().world;
    let mut simulation = simulate(Engine::Articulated, world());
    let (length, radius) = ((0.05_f64 * 0.05 + 0.4975 * 0.4975).sqrt(), 0.04_f64);
    let mut crossings = Vec::new();
    let mut before = 0.05;
    for step in 0..6000 {
        simulation.step(DT).unwrap();
        let bob = pose(&*simulation, "bob").translation.vector;
        let apart = (bob - Vector3::new(0.0, 0.0, 2.0)).norm();
        assert!((apart - length).abs() < 1e-4, "{apart} m of {length} m");
        if before > 0.0 && bob.x <= 0.0 {
            crossings.push(f64::from(step) * DT);
        }
        before = bob.x;
    }
    let found = (crossings[3] - crossings[0]) / 3.0;
    let arm = length + 0.4 * radius * radius / length;
    // The second term of the series for an amplitude of 0.1 rad.
    let expected = core::f64::consts::TAU * (arm / G).sqrt() * (1.0 + 0.1_f64.powi(2) / 16.0);
    assert!((found - expected).abs() < 2e-3 * expected, "{found} s, expected {expected} s");
    for engine in [Engine::Rapier, Engine::Mujoco] {
        if engine == Engine::Mujoco && !has_mujoco() {
            continue;
        }
        let refused = engine.refuse(world());
        assert!(
            refused.contains("simulates no connection") && refused.contains("bob"),
            "{engine:?}: {refused}"
        );
    }
}

#[test]
fn connections_of_missing_or_fixed_bodies_are_rejected() {
    let refuse = |text: &str| Engine::Articulated.refuse(toml::from_str(text).unwrap());
    let cube = "objects = [{ name = \"cube\", shape = { box = { size = [1, 1, 1] } }, position = [0, 0, 9], mass = 1.0 }, { name = \"wall\", shape = { box = { size = [1, 1, 1] } }, position = [5, 0, 0] }]\n";
    let unknown = refuse(&format!("{cube}connections = [{{ parts = [\"cub\", \"world\"] }}]"));
    assert!(unknown.contains("the object \"cub\"") && unknown.contains("did you mean \"cube\""), "{unknown}");
    let rigid = refuse(&format!("{cube}connections = [{{ parts = [\"wall\", \"world\"] }}]"));
    assert!(rigid.contains("\"wall\" and \"world\" do not move"), "{rigid}");
}

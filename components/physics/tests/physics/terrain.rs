//! Contact with terrain: closed forms of rest, sliding and support, and the plane as the simplest terrain.

use motorium_physics::{
    ArticulatedSimulator, BuildError, Ground, Object, ObjectShape, Options, RapierSimulator, Simulator,
    Terrain, World,
};
use motorium_worlds::Ray;
use nalgebra::{Point3, Vector3};

use crate::legged::{body, held_in, run};
use crate::panda;

fn terrain(text: &str) -> World {
    let terrain: Terrain = toml::from_str(&format!("size = [8.0, 8.0]\n{text}")).unwrap();
    World { terrain: Some(terrain), ..World::default() }
}

fn ball(world: World, place: [f64; 3]) -> ArticulatedSimulator {
    let mut q = vec![0.0; 7];
    q[..3].copy_from_slice(&place);
    q[6] = 1.0;
    ArticulatedSimulator::new(body("<sphere radius=\"0.1\"/>"), world, &q, Options::default()).unwrap()
}

#[test]
fn a_ball_rests_in_a_valley_where_it_touches_both_sides() {
    // Sides of 30 degrees meet at y = 0: the centre is r / cos 30 above the bottom.
    let world = terrain("friction = 0.5\nlayers = [{ equation = { height = 'abs(y) / sqrt(3)' } }]");
    let mut simulation = ball(world, [0.013, 0.004, 0.2]);
    run(&mut simulation, 2.0);
    let centre = simulation.base_pose().translation.vector;
    assert!(
        (centre.z - 0.1 / (30.0_f64).to_radians().cos()).abs() < 1e-3 && centre.y.abs() < 1e-3,
        "{centre}"
    );
    let (mut sides, mut sum) = ([0, 0], Vector3::zeros());
    simulation.visit_forces(&mut |contact| {
        sum += contact.force;
        sides[usize::from(contact.force.y > 0.0)] += 1;
    });
    assert!(sides[0] > 0 && sides[1] > 0, "{sides:?}");
    assert!((sum - Vector3::new(0.0, 0.0, 2.0 * 9.81)).norm() < 0.05, "{sum}");
    assert!(simulation.touching("body", "terrain"));
}

#[test]
fn a_box_slides_down_a_slope_by_coulomb() {
    let side = 0.1;
    for (angle, friction) in [(0.4_f64, 0.2_f64), (0.2, 0.3)] {
        let layers = format!(
            "friction = {friction}\nlayers = [{{ equation = {{ height = 'x * {}' }} }}]",
            angle.tan()
        );
        let cube = Object {
            name: "cube".to_owned(),
            shape: ObjectShape::Box { size: [side; 3] },
            mass: Some(0.5),
            position: [1.0 - 0.5 * side * angle.sin(), 0.02, angle.tan() + 0.5 * side * angle.cos()],
            rpy: [0.0, -angle, 0.0],
            friction,
            ..Object::default()
        };
        let world = World { objects: vec![cube], ..terrain(&layers) };
        let mut simulation =
            ArticulatedSimulator::new(panda::loaded().model, world, &panda::home(), Options::default())
                .unwrap();
        panda::command_hold(&mut simulation, &panda::home());
        let cube = simulation.object("cube").unwrap();
        let start = simulation.object_pose(cube).translation.vector;
        run(&mut simulation, 0.6);
        let moved = simulation.object_pose(cube).translation.vector - start;
        let acceleration = 9.81 * (angle.sin() - friction * angle.cos()).max(0.0);
        let expected = 0.5 * acceleration * 0.6 * 0.6;
        let along = -moved.x * angle.cos() - moved.z * angle.sin();
        let out = moved.z * angle.cos() - moved.x * angle.sin();
        assert!((along - expected).abs() < 0.01 * expected + 1e-3, "{along} m down, expected {expected}");
        assert!(out.abs() < 1e-3 && moved.y.abs() < 1e-3, "{moved}");
    }
}

#[test]
fn ball_rolls_on_level_terrain_like_on_the_plane() {
    let plane = World { ground: Some(Ground::default()), ..World::default() };
    let mut runs = [plane, terrain("layers = []")].map(|world| {
        let mut simulation = ball(world, [0.0, 0.0, 0.15]);
        let mut q = simulation.configuration().to_vec();
        q[6] = 1.0;
        simulation.reset(&q, &[0.7, 0.3, 0.0, 0.0, 0.0, 1.0]).unwrap();
        simulation
    });
    for step in 0..1500 {
        let places = runs.each_mut().map(|simulation| {
            simulation.step(1e-3).unwrap();
            simulation.base_pose().translation.vector
        });
        // across 20 cell borders, none of which acts as an edge
        assert!((places[0] - places[1]).norm() < 1e-6, "step {step}: {} {}", places[0], places[1]);
    }
    assert!(runs[0].base_pose().translation.vector.x > 0.7);
}

#[test]
fn a_quadruped_stands_on_stones() {
    let world = terrain(
        "spacing = 0.02\nseed = 5\nlayers = [{ stones = { height = 0.03, size = 0.15, per_square_metre = 40.0 } }]",
    );
    let field = world.height_field().unwrap().unwrap();
    let mut simulation = held_in("quadruped", world);
    simulation.place_on_ground();
    run(&mut simulation, 1.5);
    let mut sum = Vector3::zeros();
    simulation.visit_contacts(&mut |contact| {
        assert!(contact.depth < 1e-3, "{} m in {}", contact.depth, contact.first);
        let point = contact.point;
        assert!((field.height(point.x, point.y) - point.z).abs() < 2e-3, "{point}");
    });
    simulation.visit_forces(&mut |contact| sum += contact.force);
    let weight = 9.81 * simulation.model().mass();
    assert!(
        (sum.z - weight).abs() < 0.02 * weight && sum.xy().norm() < 0.05 * weight,
        "{sum}, weight {weight}"
    );
    assert!(simulation.base_pose().translation.z > 0.2);
    // the same result from the same start, and from a saved state
    let state = simulation.save();
    run(&mut simulation, 0.3);
    let end = simulation.configuration().to_vec();
    simulation.restore(&state).unwrap();
    run(&mut simulation, 0.3);
    assert_eq!(simulation.configuration(), end);
}

#[test]
fn a_box_lies_on_the_peak_of_a_roof_under_its_middle() {
    // A ridge along y below a box, whose corners are in the air.
    let world = terrain("friction = 1.0\nlayers = [{ equation = { height = '0.2 - abs(x) * 0.5' } }]");
    let q = [0.0, 0.0, 0.35, 0.0, 0.0, 0.0, 1.0];
    let model = body("<box size=\"0.4 0.4 0.2\"/>");
    let mut simulation = ArticulatedSimulator::new(model, world, &q, Options::default()).unwrap();
    run(&mut simulation, 0.3);
    let pose = simulation.base_pose();
    assert!((pose.translation.z - 0.3).abs() < 2e-3, "{pose}");
}

#[test]
fn rays_hit_the_terrain_and_report_its_name() {
    let world = terrain("layers = [{ slope = { angle = 0.3 } }]");
    let simulation = ball(world, [-2.0, 0.0, 0.3]);
    let ray = Ray { origin: Point3::new(1.0, 0.0, 2.0), direction: -Vector3::z_axis() };
    let hit = simulation.cast_ray(ray.origin, *ray.direction, 5.0).unwrap();
    assert!(hit.name == "terrain" && (hit.distance - (2.0 - 0.3_f64.tan())).abs() < 1e-9, "{}", hit.distance);
    let hit = simulation.cast_ray(Point3::new(-2.0, 0.0, 2.0), -Vector3::z(), 5.0).unwrap();
    assert_eq!(hit.name, "body");
}

#[test]
fn rapier_rejects_a_terrain_and_names_the_supporting_kind() {
    let made = RapierSimulator::new(
        panda::loaded().model,
        terrain("layers = []"),
        &panda::home(),
        Options::default(),
    );
    let Err(error) = made else { panic!("it took the terrain") };
    assert!(matches!(error, BuildError::Terrain) && error.to_string().contains("physics.articulated"));
}

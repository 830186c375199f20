//! Terrain whose seed and scale change between resets.

use motorium_physics::{ArticulatedSimulator, Options, Properties, ResetError, Simulator, Terrain, World};
use nalgebra::{Point3, Vector3};

use crate::engines::{Engine, engines};
use crate::legged::body;

fn world(seed: u64, scale: f64) -> World {
    let text = format!(
        "size = [3.0, 3.0]\nspacing = 0.1\nseed = {seed}\nscale = {scale}\nlayers = [{{ equation = {{ height = '0.05 + 0.02 * x' }} }}, {{ diamond_square = {{ height = 0.03 }} }}]"
    );
    let terrain: Terrain = toml::from_str(&text).unwrap();
    World { terrain: Some(terrain), ..World::default() }
}

const START: [f64; 7] = [0.2, -0.3, 0.5, 0.0, 0.0, 0.0, 1.0];

fn ball(engine: Engine, world: World) -> Box<dyn Simulator> {
    engine.simulate(body("<sphere radius=\"0.1\"/>"), world, &START, Options::default())
}

/// All bits of the ball's motion down and along the terrain.
fn way(simulation: &mut dyn Simulator) -> Vec<u64> {
    let mut bits = Vec::new();
    for _ in 0..600 {
        simulation.step(1e-3).unwrap();
        bits.extend(simulation.configuration().iter().map(|x| x.to_bits()));
    }
    bits
}

#[test]
fn a_reset_with_another_terrain_equals_a_new_simulation() {
    let mut reset = ArticulatedSimulator::new(
        body("<sphere radius=\"0.1\"/>"),
        world(1, 1.0),
        &START,
        Options::default(),
    )
    .unwrap();
    let first = way(&mut reset);
    let before = reset.properties();
    for (seed, scale) in [(7, 1.0), (1, 2.5), (1, 1.0)] {
        let properties = Properties { world: world(seed, scale), ..before.clone() };
        reset.reset_with(&properties, &START, &[0.0; 6]).unwrap();
        let mut built = ball(Engine::Articulated, world(seed, scale));
        let found = way(&mut reset);
        assert_eq!(found, way(&mut *built), "seed {seed}, scale {scale}");
        assert_eq!(found == first, (seed, scale) == (1, 1.0));
        // rays hit it, too
        let hit = reset.cast_ray(Point3::new(0.4, 0.4, 2.0), -Vector3::z(), 5.0).unwrap();
        let field = world(seed, scale).height_field().unwrap().unwrap();
        assert!((hit.point.z - field.height(0.4, 0.4)).abs() < 1e-9, "{seed}, {scale}: {}", hit.point.z);
    }
}

#[test]
fn a_ball_rests_on_scaled_terrain_on_every_engine() {
    for engine in engines().filter(|engine| *engine != Engine::Rapier) {
        let mut simulation = ball(engine, world(3, 4.0));
        way(&mut *simulation);
        let centre = simulation.base_pose().translation.vector;
        let height = world(3, 4.0).height_field().unwrap().unwrap().height(centre.x, centre.y);
        assert!((centre.z - height - 0.1).abs() < 0.03 && centre.z > 0.2, "{engine:?}: {centre}, {height}");
    }
}

#[test]
fn terrain_of_another_size_or_other_layers_is_rejected() {
    let mut simulation = ArticulatedSimulator::new(
        body("<sphere radius=\"0.1\"/>"),
        world(1, 1.0),
        &START,
        Options::default(),
    )
    .unwrap();
    let before = simulation.properties();
    for change in [
        (|terrain: &mut Terrain| terrain.size = [4.0, 3.0]) as fn(&mut Terrain),
        |terrain| terrain.layers.truncate(1),
        |terrain| terrain.spacing = 0.2,
    ] {
        let mut properties = before.clone();
        change(properties.world.terrain.as_mut().unwrap());
        let refused = simulation.reset_with(&properties, &START, &[0.0; 6]);
        assert_eq!(refused, Err(ResetError::Properties));
    }
}

//! Ray-casting sensors over terrain sampled by the simulation.

use motorium::prelude::*;
use motorium::state::{Randomisation, Ranges};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_sensors::component::rays::{AlongRays, RaySensor};
use motorium_worlds::Terrain;

const TERRAIN: &str =
    "size = [8.0, 8.0], spacing = 0.1, seed = 3, layers = [{ diamond_square = { height = 0.2 } }]";

fn field(seed: u64, scale: f64) -> motorium_worlds::HeightField {
    let text: toml::Table = format!("terrain = {{ {TERRAIN} }}").parse().unwrap();
    let terrain: Terrain = text["terrain"].clone().try_into().unwrap();
    Terrain { seed, scale, ..terrain }.height_field().unwrap()
}

/// Returns the readings of a ray straight down from (1, 2, 2) m and the number of separately counted
/// allocations. The simulation publishes these draws at step 200 and repeats them `again` times.
fn readings(draws: &'static [(u32, f64)], again: u64) -> (Vec<f64>, u64) {
    let base = Source::new("truth", "base", |_| {
        let mut state = BaseState { position: [1.0, 2.0, 2.0], ..BaseState::default() };
        state.orientation[3] = 1.0;
        Some(state)
    });
    let drawn = Source::new("draws", "drawn", move |tick| {
        let mut message = Randomisation::default();
        message.set_count(draws.len());
        for (entry, (property, value)) in draws.iter().enumerate() {
            message.property_mut()[entry] = *property;
            message.value_mut()[entry] = *value;
        }
        let times = (200..=200 + 20 * again).step_by(20);
        times.into_iter().any(|index| index == tick.index).then_some(message)
    });
    let probe = Probe::<Ranges>::for_topic("range");
    let config = format!(
        "sees_robot = false\nmost = 9.0\nmount = {{ frame = \"base\", rpy = [0.0, 1.5707963267948966, 0.0] }}\nworld = {{ terrain = {{ {TERRAIN} }} }}"
    );
    let sensor = Instance::of::<AlongRays<RaySensor>>("sensor")
        .rate("1 kHz")
        .robot("dog")
        .subscribe("base_state", "base")
        .subscribe("randomisation", "drawn")
        .publish("range", "range")
        .set("config", toml::Value::Table(config.parse().unwrap()));
    let graph =
        Graph::new("terrain").robot("dog", "quadruped").with(base).with(drawn).with(sensor).with(&probe);
    let report = graph.run("400 ms").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    let set_apart = sensor.allocations_apart.unwrap();
    (probe.values().iter().map(|reading| f64::from(reading.range()[0])).collect(), set_apart)
}

#[test]
fn ray_hits_the_sampled_terrain_once_published() {
    let draws: [&[(u32, f64)]; 3] = [
        &[(Randomisation::TERRAIN_SCALE, 3.0)],
        &[(Randomisation::TERRAIN_SEED, 12.0)],
        &[
            (Randomisation::GRAVITY, 0.9),
            (Randomisation::TERRAIN_SEED, 12.0),
            (Randomisation::TERRAIN_SCALE, 0.5),
        ],
    ];
    for (draws, (seed, scale)) in draws.into_iter().zip([(3, 3.0), (12, 1.0), (12, 0.5)]) {
        let (found, _) = readings(draws, 0);
        let (before, after) =
            (2.0 - field(3, 1.0).height(1.0, 2.0), 2.0 - field(seed, scale).height(1.0, 2.0));
        assert!((before - after).abs() > 0.01, "another terrain: {before}, {after}");
        assert!((found[0] - before).abs() < 1e-6, "{found:?}, {before}");
        assert!((found.last().unwrap() - after).abs() < 1e-6, "{found:?}, {after}");
    }
}

#[test]
fn repeated_draw_does_not_regenerate_the_terrain() {
    let draws = &[(Randomisation::TERRAIN_SEED, 12.0), (Randomisation::TERRAIN_SCALE, 2.0)];
    let [(once, first), (again, all)] = [0, 8].map(|again| readings(draws, again));
    assert!(first > 0, "the terrain allocates memory");
    assert_eq!((again, all), (once, first));
}

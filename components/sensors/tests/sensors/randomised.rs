//! Parameters of sensors that are drawn anew for every episode.

use motorium::prelude::*;
use motorium::state::Randomisation;
use motorium::testing::{Graph, Instance, Probe, Sample, Source};
use motorium_sensors::channel::ErrorModel;
use motorium_sensors::component::imu::Imu;
use motorium_sensors::randomise::SensorRanges;

fn span(ms: u64) -> TimeSpan {
    TimeSpan { ns: ms * 1_000_000 }
}

const RANGES: SensorRanges = SensorRanges {
    noise: Some([0.5, 2.5]),
    bias: Some([0.0, 4.0]),
    latency: Some([TimeSpan { ns: 1_000_000 }, TimeSpan { ns: 5_000_000 }]),
};

#[test]
fn draws_lie_evenly_in_their_ranges_and_each_depends_on_its_own_range_alone() {
    let draws: Vec<_> = (0..4000).map(|seed| RANGES.draw(seed, span(9))).collect();
    let mean = |number: &dyn Fn(usize) -> f64| (0..4000).map(number).sum::<f64>() / 4000.0;
    assert!((mean(&|k| draws[k].noise) - 1.5).abs() < 0.04);
    assert!((mean(&|k| draws[k].bias) - 2.0).abs() < 0.08);
    assert!((mean(&|k| draws[k].latency.as_secs_f64()) - 3e-3).abs() < 8e-5);
    for draw in &draws {
        assert!((0.5..=2.5).contains(&draw.noise) && (0.0..=4.0).contains(&draw.bias));
        assert!((span(1)..=span(5)).contains(&draw.latency));
    }
    let fewer = SensorRanges { bias: None, latency: None, ..RANGES };
    let draw = fewer.draw(17, span(9));
    assert_eq!((draw.noise, draw.bias, draw.latency), (draws[17].noise, 1.0, span(9)));
}

#[test]
fn noise_and_bias_of_a_quantity_are_scaled_apart() {
    let errors =
        ErrorModel { noise: 2.0, bias: 3.0, bias_walk: 4.0, scale_error: 5.0, ..ErrorModel::default() };
    let scaled = SensorRanges { noise: Some([0.5; 2]), bias: Some([3.0; 2]), latency: None }.draw(0, span(0));
    let scaled = scaled.errors(&errors);
    assert_eq!([scaled.noise, scaled.bias, scaled.bias_walk, scaled.scale_error], [1.0, 9.0, 2.0, 15.0]);
}

#[test]
fn ranges_that_cannot_be_are_refused_by_name() {
    let words = |ranges: SensorRanges| ranges.check().unwrap_err().to_string();
    assert!(words(SensorRanges { noise: Some([-1.0, 1.0]), ..RANGES }).starts_with("randomise.noise = -1"));
    assert!(words(SensorRanges { bias: Some([2.0, 1.0]), ..RANGES }).contains("the lowest factor first"));
    assert!(
        words(SensorRanges { latency: Some([span(2), span(1)]), ..RANGES })
            .contains("the shortest time first")
    );
    assert!(
        words(SensorRanges { bias: Some([0.0, f64::NAN]), ..RANGES }).starts_with("randomise.bias = NaN")
    );
}

/// Readings of a unit that lies still, and what it drew, in an episode of this seed.
fn still(seed: u64) -> (Vec<Sample<ImuSample>>, Randomisation) {
    let (readings, drawn) = (Probe::<ImuSample>::of("imu"), Probe::<Randomisation>::of("drawn"));
    let joints = Source::new("truth", "state", |_| {
        let mut state = JointState::default();
        state.set_count(1);
        Some(state)
    });
    let config = format!(
        "seed = {seed}\ngyroscope = {{ noise = 0.1 }}\nmount = {{ frame = \"rod\" }}\nrandomise = {{ noise = [0.5, 4.0], latency = [\"1 ms\", \"9 ms\"] }}"
    );
    let sensor = Instance::of::<Imu>("sensor")
        .rate("1 kHz")
        .robot("rod")
        .subscribe("joint_state", "state")
        .publish("imu", "imu")
        .publish("drawn", "drawn")
        .set("config", toml::Value::Table(config.parse().unwrap()));
    let graph =
        Graph::new("still").robot("rod", "pendulum").with(joints).with(sensor).with(&readings).with(&drawn);
    let report = graph.run("2 s").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    let drawn = drawn.values();
    assert_eq!(drawn.len(), 1, "once an episode");
    (readings.samples(), drawn[0])
}

#[test]
fn the_noise_and_the_latency_of_an_episode_are_those_that_it_publishes() {
    let mut seen = Vec::new();
    for seed in 0..4 {
        let (readings, drawn) = still(seed);
        let factor = drawn.find(Randomisation::SENSOR_NOISE, 0).unwrap();
        let latency = drawn.find(Randomisation::SENSOR_LATENCY, 0).unwrap();
        assert_eq!(drawn.find(Randomisation::SENSOR_BIAS, 0), None);
        assert_eq!((drawn.episode, drawn.seed), (0, seed));
        let sum: f64 =
            readings.iter().flat_map(|reading| reading.value.angular_velocity).map(|w| w * w).sum();
        let deviation = (sum / (3.0 * readings.len() as f64)).sqrt();
        assert!((deviation / (0.1 * factor) - 1.0).abs() < 0.05, "{deviation}, factor {factor}");
        for reading in &readings[5..] {
            let age = (reading.stamp.publish_time - reading.stamp.source_time) as f64 * 1e-9;
            // it leaves at the first step at which the latency is over
            assert!(age >= latency - 1e-9 && age < latency + 1e-3 + 1e-9, "{age}, {latency}");
        }
        seen.push(factor);
    }
    assert!(seen.windows(2).all(|pair| pair[0] != pair[1]), "{seen:?}");
    assert_eq!(still(2).1.find(Randomisation::SENSOR_NOISE, 0), Some(seen[2]));
}

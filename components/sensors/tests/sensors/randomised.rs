//! Sensor parameters sampled for every episode.

use motorium::component::Component;
use motorium::prelude::*;
use motorium::state::{Altitude, FootContacts, Randomisation, Ranges};
use motorium::testing::{Graph, Instance, Probe, Sample, Source};
use motorium_sensors::JointEncoder;
use motorium_sensors::channel::ErrorModel;
use motorium_sensors::component::contact::FootContactSensor;
use motorium_sensors::component::imu::Imu;
use motorium_sensors::component::place::{Altimeter, AtPlace};
use motorium_sensors::component::rays::{AlongRays, RaySensor};
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
fn draws_are_uniform_and_independent() {
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
fn noise_and_bias_are_scaled_separately() {
    let errors =
        ErrorModel { noise: 2.0, bias: 3.0, bias_walk: 4.0, scale_error: 5.0, ..ErrorModel::default() };
    let scaled = SensorRanges { noise: Some([0.5; 2]), bias: Some([3.0; 2]), latency: None }.draw(0, span(0));
    let scaled = scaled.errors(&errors);
    assert_eq!([scaled.noise, scaled.bias, scaled.bias_walk, scaled.scale_error], [1.0, 9.0, 2.0, 15.0]);
}

#[test]
fn invalid_ranges_are_rejected_by_name() {
    let words = |ranges: SensorRanges| ranges.check().unwrap_err().to_string();
    assert!(words(SensorRanges { noise: Some([-1.0, 1.0]), ..RANGES }).starts_with("randomise.noise = -1"));
    assert!(words(SensorRanges { bias: Some([2.0, 1.0]), ..RANGES }).contains("the lower factor first"));
    assert!(
        words(SensorRanges { latency: Some([span(2), span(1)]), ..RANGES })
            .contains("the shorter time first")
    );
    assert!(
        words(SensorRanges { bias: Some([0.0, f64::NAN]), ..RANGES }).starts_with("randomise.bias = NaN")
    );
}

/// Readings of an IMU at rest and its sampled parameters, in an episode with this seed.
fn still(seed: u64) -> (Vec<Sample<ImuSample>>, Randomisation) {
    let (readings, drawn) =
        (Probe::<ImuSample>::for_topic("imu"), Probe::<Randomisation>::for_topic("drawn"));
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
    assert_eq!(drawn.len(), 1, "once per episode");
    (readings.samples(), drawn[0])
}

#[test]
fn episode_noise_and_latency_match_the_published_draws() {
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
            // published at the first step after the latency
            assert!(age >= latency - 1e-9 && age < latency + 1e-3 + 1e-9, "{age}, {latency}");
        }
        seen.push(factor);
    }
    assert!(seen.windows(2).all(|pair| pair[0] != pair[1]), "{seen:?}");
    assert_eq!(still(2).1.find(Randomisation::SENSOR_NOISE, 0), Some(seen[2]));
}

/// Returns the standard deviation of a quantity's readings by a sensor of noise 0.01 on a standing quadruped,
/// their minimum age, and the sampled parameters.
fn standing<C: Component, T: StateBuffer + Send>(
    port: &str,
    quantity: &str,
    config: &str,
    read: impl Fn(&T) -> f64,
) -> (f64, u64, Randomisation) {
    let base = Source::new("base", "base", |_| {
        Some(BaseState {
            position: [0.0, 0.0, 5.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..BaseState::default()
        })
    });
    let joints = Source::new("joints", "joints", |_| {
        let mut state = JointState::default();
        state.set_count(12);
        Some(state)
    });
    let contacts = Source::new("contacts", "contacts", |_| Some(motorium::state::Contacts::default()));
    let (readings, drawn) = (Probe::<T>::for_topic("reading"), Probe::<Randomisation>::for_topic("drawn"));
    let config = format!(
        "{quantity} = {{ noise = 0.01 }}\nseed = 3\nrandomise = {{ noise = [2.0, 9.0], latency = [\"3 ms\", \"9 ms\"] }}\n{config}"
    );
    let name = C::KIND;
    let mut sensor = Instance::of::<C>("sensor")
        .rate("1 kHz")
        .robot("dog")
        .publish(port, "reading")
        .publish("drawn", "drawn")
        .set("config", toml::Value::Table(config.parse().unwrap()));
    sensor = match name {
        "sensor.contact" => sensor.subscribe("contacts", "contacts"),
        "sensor.joint_encoder" => sensor.subscribe("joint_state", "joints"),
        _ => sensor.subscribe("base_state", "base"),
    };
    let graph = Graph::new("standing").robot("dog", "quadruped");
    let graph = match name {
        "sensor.contact" => graph.with(contacts),
        "sensor.joint_encoder" => graph.with(joints),
        _ => graph.with(base),
    };
    let report = graph.with(sensor).with(&readings).with(&drawn).run("1 s").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0), "{name}");
    let samples = readings.samples();
    assert!(samples.len() > 950, "{name}: {}", samples.len());
    let values: Vec<f64> = samples.iter().map(|sample| read(&sample.value)).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    let age =
        samples.iter().map(|sample| sample.stamp.publish_time - sample.stamp.source_time).min().unwrap();
    assert_eq!(
        report.results["sensor"]["drawn"]["noise"],
        drawn.values()[0].find(Randomisation::SENSOR_NOISE, 0).unwrap()
    );
    (variance.sqrt(), age, drawn.values()[0])
}

#[test]
fn all_sensor_kinds_sample_noise_and_latency() {
    let all = [
        standing::<JointEncoder, JointState>("measured", "position", "", |state| state.position()[2]),
        standing::<AtPlace<Altimeter>, Altitude>("altitude", "height", "", |altitude| altitude.height),
        standing::<AlongRays<RaySensor>, Ranges>(
            "range",
            "distance",
            "sees_robot = false\nmount = { rpy = [0.0, 1.5707963267948966, 0.0] }\nworld = { ground = {} }",
            |ranges| f64::from(ranges.range()[0]),
        ),
        standing::<FootContactSensor, FootContacts>("feet", "force", "", |feet| feet.force()[1]),
    ];
    for (deviation, age, drawn) in all {
        let factor = drawn.find(Randomisation::SENSOR_NOISE, 0).unwrap();
        assert!((deviation / (0.01 * factor) - 1.0).abs() < 0.12, "{deviation}, factor {factor}");
        let latency = drawn.find(Randomisation::SENSOR_LATENCY, 0).unwrap();
        let age = age as f64 * 1e-9;
        assert!(age >= latency - 1e-9 && age < latency + 1e-3 + 1e-9, "{age}, {latency}");
    }
}

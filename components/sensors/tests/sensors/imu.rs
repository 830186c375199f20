//! The inertial measurement unit: its model, and `sensor.imu` in a graph.

use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, Source, allocations};
use motorium_sensors::channel::ErrorModel;
use motorium_sensors::component::imu::Imu;
use motorium_sensors::imu::{ImuModel, ImuReading, SensorMotion};
use nalgebra::{UnitQuaternion, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn ideal() -> ImuModel {
    ImuModel::new(&ErrorModel::default(), &ErrorModel::default(), GRAVITY, 0).unwrap()
}

/// Returns readings at 1 kHz of a motion given as a function of time \[s\].
fn readings(imu: &mut ImuModel, motion: impl Fn(f64) -> SensorMotion, samples: u64) -> Vec<ImuReading> {
    (0..samples).filter_map(|k| imu.sample(k * 1_000_000, &motion(k as f64 * 1e-3))).collect()
}

#[test]
fn free_fall_reads_zero_force_at_any_attitude() {
    let rotation = UnitQuaternion::from_euler_angles(0.4, 1.0, -2.0);
    let falling = |t: f64| SensorMotion { rotation, velocity: Vector3::new(1.0, 2.0, 3.0) + GRAVITY * t };
    let found = readings(&mut ideal(), falling, 100);
    assert_eq!(found.len(), 99);
    assert!(found.iter().all(|reading| reading.specific_force.norm() < 1e-9));
    assert!(found.iter().all(|reading| reading.angular_velocity == Vector3::zeros()));
}

#[test]
fn turntable_reads_the_centripetal_force() {
    let (omega, radius) = (3.0, 0.5);
    // The x axis of the sensor points outwards.
    let motion = |t: f64| {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, omega * t);
        SensorMotion { rotation, velocity: rotation * Vector3::new(0.0, omega * radius, 0.0) }
    };
    for reading in readings(&mut ideal(), motion, 100) {
        let expected = Vector3::new(-omega * omega * radius, 0.0, 9.81);
        assert!((reading.specific_force - expected).norm() < 1e-5, "{}", reading.specific_force);
        assert!((reading.angular_velocity - Vector3::new(0.0, 0.0, omega)).norm() < 1e-9);
    }
}

#[test]
fn slow_sensor_reads_the_mean_of_its_interval() {
    let motion =
        |t: f64| SensorMotion { rotation: UnitQuaternion::identity(), velocity: Vector3::x() * t * t };
    let mut imu = ideal();
    imu.sample(0, &motion(0.0));
    let reading = imu.sample(100_000_000, &motion(0.1)).unwrap();
    assert!((reading.specific_force.x - 0.1).abs() < 1e-12, "half of 2 t at the end");
}

#[test]
fn clock_restart_gives_no_reading_across_the_gap() {
    let mut imu = ideal();
    let motion = SensorMotion { rotation: UnitQuaternion::identity(), velocity: Vector3::zeros() };
    imu.sample(5_000_000, &motion);
    assert!(imu.sample(5_000_000, &motion).is_none());
    assert!(imu.sample(1_000_000, &motion).is_none());
    assert!(imu.sample(2_000_000, &motion).is_some());
}

/// The quadruped's base at rest, tilted by 0.1 rad about y, for `end` ticks.
fn tilted(end: u64) -> Source {
    Source::new("truth", "base", move |tick| {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.1, 0.0);
        let mut state = BaseState::default();
        state.orientation.copy_from_slice(rotation.coords.as_slice());
        (tick.index < end).then_some(state)
    })
}

fn graph(config: &str) -> (Graph, Probe<ImuSample>) {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    let imu = Instance::of::<Imu>("imu")
        .rate("500 Hz")
        .robot("dog")
        .subscribe("base_state", "base")
        .publish("imu", "imu")
        .set("config", config["config"].clone());
    let probe = Probe::for_topic("imu");
    (Graph::new("imu").robot("dog", "quadruped").with(tilted(1000)).with(imu).with(&probe), probe)
}

#[test]
fn at_rest_reads_gravity_in_mount_axes_with_latency() {
    let (graph, probe) = graph(r#"mount = { rpy = [0.0, 0.0, 1.5707963267948966] }, latency = "10 ms""#);
    let report = graph.run("200 ms").unwrap();
    let samples = probe.samples();
    assert!((90..=95).contains(&samples.len()), "{} readings at 500 Hz", samples.len());
    for sample in samples {
        // x of the base points down by 0.1 rad; the sensor's -y is the base's x
        let [x, y, z] = sample.value.specific_force;
        assert!(x.abs() < 1e-12 && (y - 9.81 * 0.1_f64.sin()).abs() < 1e-12, "{x} {y}");
        assert!((z - 9.81 * 0.1_f64.cos()).abs() < 1e-12);
        assert_eq!(sample.stamp.publish_time - sample.stamp.source_time, 10_000_000);
    }
    let imu = report.components.iter().find(|component| component.name == "imu").unwrap();
    assert_eq!((imu.allocations, imu.errors), (Some(0), 0));
}

#[test]
fn ranges_of_data_sheets_in_other_units_are_doubted() {
    let doubts = |config: &str| {
        let warnings = graph(config).0.check().expect("warnings alone").warnings;
        let of_config = warnings.iter().filter(|warning| warning.message().starts_with("`imu.config"));
        let text =
            of_config.map(|warning| format!("{}; {}", warning.message(), warning.advice().unwrap_or("")));
        text.collect::<Vec<_>>()
    };
    let usual = "gyroscope = { noise = 3e-3, range = 35.0 }, accelerometer = { range = 19.62 }";
    assert_eq!(doubts(usual), Vec::<String>::new());
    assert_eq!(
        doubts("gyroscope = { bias = 5.0, range = 2000.0 }, accelerometer = { range = 16.0 }"),
        [
            "`imu.config.accelerometer.range`: 16 m/s2, expected at least 19 m/s2; if it is in multiples of gravity, write 157",
            "`imu.config.gyroscope.bias`: 5 rad/s, expected at most 1 rad/s; if it is in degrees/s, write 0.08727",
            "`imu.config.gyroscope.range`: 2000 rad/s, expected at most 100 rad/s; if it is in degrees/s, write 34.91"
        ]
    );
    let error = graph("gravity = [0.0, 0.0, -9810.0]").0.check().expect_err("it is refused").render(false);
    assert!(error.contains("`imu.config.gravity`: -9810, expected from -1000 to 1000 m/s2"), "{error}");
}

#[test]
fn probable_degrees_of_a_mount_are_doubted() {
    let doubts = |config: &str| {
        let warnings = graph(config).0.check().expect("warnings alone").warnings;
        let warnings = warnings.iter().map(|warning| warning.message().to_string());
        warnings.filter(|text| text.contains("degrees")).collect::<Vec<_>>()
    };
    assert_eq!(doubts("mount = { rpy = [0.0, 1.5708, 3.1416] }"), Vec::<String>::new());
    let rule = "angles are in radians: if these are degrees, write 1.5708";
    assert_eq!(
        doubts("mount = { rpy = [0.0, 90.0, 0.0] }"),
        [format!("`imu.config.mount.rpy`: an angle of 90 rad; {rule}")]
    );
}

#[test]
fn noise_and_drop_outs_are_reproducible() {
    let config = "gyroscope = { noise = 0.01 }, drop_out = 0.3, seed = 3";
    let run = || {
        let (graph, probe) = graph(config);
        let report = graph.run("1 s").unwrap();
        (report.state_hash, probe.values().len(), report.results["imu"]["dropped"].as_u64().unwrap())
    };
    let (hash, count, dropped) = run();
    assert_eq!((hash, count, dropped), run());
    assert_eq!(count as u64 + dropped, 499);
    assert!((dropped as f64 / 499.0 - 0.3).abs() < 5.0 * (0.21_f64 / 499.0).sqrt(), "{dropped}");
}

#[test]
fn sampling_does_not_allocate() {
    let errors = ErrorModel {
        noise: 0.1,
        bias_walk: 0.1,
        resolution: 0.01,
        range: Some(1.0),
        ..ErrorModel::default()
    };
    let mut imu = ImuModel::new(&errors, &errors, GRAVITY, 0).unwrap();
    let motion = SensorMotion { rotation: UnitQuaternion::identity(), velocity: Vector3::zeros() };
    let count = allocations(|| {
        for k in 0..1000 {
            std::hint::black_box(imu.sample(k * 1_000_000, &motion));
        }
    });
    assert_eq!(count, 0);
}

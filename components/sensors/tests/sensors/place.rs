//! Altimeter, magnetometer and satellite navigation in graphs.

use motorium::component::Component;
use motorium::prelude::*;
use motorium::state::{Altitude, GeoFix, MagneticField};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_sensors::component::place::{Altimeter, AtPlace, Gps, Magnetometer};
use motorium_sensors::geodesy::{Geodetic, TangentPlane};
use nalgebra::{UnitQuaternion, Vector3};

/// A base at (30, 40, 5) m, rotated by 90 degrees to the left, that moves forwards at 2 m/s and up at 1 m/s.
fn truth() -> Source {
    Source::new("truth", "base", |_| {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
        let mut state = BaseState { position: [30.0, 40.0, 5.0], ..BaseState::default() };
        state.orientation.copy_from_slice(rotation.coords.as_slice());
        state.linear_velocity = [2.0, 0.0, 1.0];
        Some(state)
    })
}

fn run<C: Component, T: StateBuffer + Send>(port: &str, config: &str, duration: &str) -> Vec<T> {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    let sensor = Instance::of::<C>("sensor")
        .rate("100 Hz")
        .robot("dog")
        .subscribe("base_state", "base")
        .publish(port, "reading")
        .set("config", config["config"].clone());
    let probe = Probe::<T>::for_topic("reading");
    let graph = Graph::new("place").robot("dog", "quadruped").with(truth()).with(sensor).with(&probe);
    let report = graph.run(duration).unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    let readings = probe.values();
    assert_eq!(report.results["sensor"]["readings"].as_u64(), Some(readings.len() as u64));
    readings
}

#[test]
fn altimeter_reads_height_and_rate_of_its_mount() {
    let config = "reference = 2.0, mount = { position = [0.0, 0.0, 0.5] }";
    let readings: Vec<Altitude> = run::<AtPlace<Altimeter>, _>("altitude", config, "200 ms");
    assert!(readings.len() >= 19, "{}", readings.len());
    assert!(readings.iter().all(|reading| (reading.height - 3.5).abs() < 1e-12));
    assert!(readings.iter().all(|reading| (reading.rate - 1.0).abs() < 1e-12));
}

#[test]
fn magnetometer_measures_north_in_base_axes() {
    let config = "field = [0.0, 2e-5, -4e-5], errors = { resolution = 1e-7 }";
    let readings: Vec<MagneticField> = run::<AtPlace<Magnetometer>, _>("magnetic_field", config, "100 ms");
    for reading in readings {
        // the base faces north
        let expected = [2e-5, 0.0, -4e-5];
        assert!(reading.field.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
    }
}

#[test]
fn fix_matches_the_tangent_plane_with_stated_errors() {
    let origin = Geodetic { latitude: 46.52, longitude: 6.57, altitude: 400.0 };
    let config = "origin = { latitude = 46.52, longitude = 6.57, altitude = 400.0 }, horizontal = { noise = 0.5 }, \
                  vertical = { noise = 2.0 }, velocity = { noise = 0.1 }";
    let fixes: Vec<GeoFix> = run::<AtPlace<Gps>, _>("fix", config, "20 s");
    let plane = TangentPlane::tangent_at(&origin);
    let n = fixes.len() as f64;
    let local = |fix: &GeoFix| {
        let place = Geodetic { latitude: fix.latitude, longitude: fix.longitude, altitude: fix.altitude };
        plane.local(&place)
    };
    let places: Vec<Vector3<f64>> = fixes.iter().map(local).collect();
    for (axis, (mean, deviation)) in [(30.0, 0.5), (40.0, 0.5), (5.0, 2.0)].into_iter().enumerate() {
        let found = places.iter().map(|place| place[axis]).sum::<f64>() / n;
        assert!((found - mean).abs() < 5.0 * deviation / n.sqrt(), "axis {axis}: {found}");
        let square = places.iter().map(|place| (place[axis] - mean).powi(2)).sum::<f64>() / n;
        let ratio = square / (deviation * deviation);
        assert!((ratio - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "axis {axis}: {ratio}");
        assert_eq!(fixes[0].position_deviation[axis], deviation);
    }
    // forwards is north
    for (axis, speed) in [0.0, 2.0, 1.0].into_iter().enumerate() {
        let found = fixes.iter().map(|fix| fix.velocity[axis]).sum::<f64>() / n;
        assert!((found - speed).abs() < 5.0 * 0.1 / n.sqrt(), "axis {axis}: {found}");
    }
}

/// Returns the warnings about a configuration, with their advice.
fn doubts<C: Component>(port: &str, config: &str) -> Vec<String> {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    let sensor = Instance::of::<C>("sensor")
        .rate("100 Hz")
        .robot("dog")
        .subscribe("base_state", "base")
        .publish(port, "reading")
        .set("config", config["config"].clone());
    let graph = Graph::new("place").robot("dog", "quadruped").with(truth()).with(sensor);
    let warnings = graph.check().expect("warnings alone").warnings;
    let text = |warning: &motorium::graph::Diagnostic| {
        format!("{}; {}", warning.message(), warning.advice().unwrap_or_default())
    };
    let of_config = warnings.iter().map(text).filter(|text| text.starts_with("`sensor.config."));
    of_config.map(|text| text.replacen("`sensor.config.", "`", 1)).collect()
}

#[test]
fn values_of_places_in_other_units_are_doubted() {
    let magnetic = |config: &str| doubts::<AtPlace<Magnetometer>>("magnetic_field", config);
    assert_eq!(magnetic("field = [0.0, 2.1e-5, -4.3e-5]"), [""; 0]);
    assert_eq!(magnetic("field = [0.0, 0.0, 9e-4]"), [""; 0]);
    for (field, found) in [
        (
            "[0.0, 21000.0, -43000.0]",
            "47850 T, expected at most 0.001 T; if it is in nT, write [0.0, 2.1e-5, -4.3e-5]",
        ),
        (
            "[0.0, 0.21, -0.43]",
            "0.4785 T, expected at most 0.001 T; if it is in gauss, write [0.0, 2.1e-5, -4.3e-5]",
        ),
        (
            "[0.0, 21.0, -43.0]",
            "47.85 T, expected at most 0.001 T; if it is in uT, write [0.0, 2.1e-5, -4.3e-5]",
        ),
        ("[0.0, 0.0, 5.0]", "5 T, expected at most 0.001 T; "),
    ] {
        assert_eq!(magnetic(&format!("field = {field}")), [format!("`field`: {found}")]);
    }
    assert_eq!(
        doubts::<AtPlace<Altimeter>>("altitude", "mount = { position = [50.0, 0.0, 0.0] }"),
        ["`mount.position`: 50 m, expected at most 20 m; if it is in mm, write 0.05"]
    );
    let origin = "origin = { latitude = 46.52, longitude = 6.57, altitude = 400000.0 }, heading = 90.0";
    let found = doubts::<AtPlace<Gps>>("fix", origin);
    assert!(found.len() == 2 && found[0].starts_with("`heading`: an angle of 90 rad"), "{found:?}");
    assert_eq!(found[1], "`origin.altitude`: 400000 m, expected at most 100000 m; if it is in mm, write 400");
}

#[test]
fn sensor_on_a_fixed_link_is_rejected() {
    let sensor =
        Instance::of::<AtPlace<Altimeter>>("sensor").rate("100 Hz").robot("arm").publish("altitude", "x");
    let error = Graph::new("place").robot("arm", "panda").with(sensor).check().unwrap_err();
    assert!(error.to_string().contains("the link does not move"), "{error}");
}

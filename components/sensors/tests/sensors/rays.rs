//! Ray, lidar and height scan in graphs.

use motorium::component::Component;
use motorium::prelude::*;
use motorium::state::ImageInfo;
use motorium::state::{CloudPoint, HeightScan, ObjectPoses, Ranges};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_sensors::component::rays::{AlongRays, DepthCamera, HeightScanSensor, Lidar, RaySensor};
use nalgebra::UnitQuaternion;

const YAW: f64 = 0.4;

/// A base at (1, 2, 0.5) m, yawed by 0.4 rad to the left.
fn truth() -> Source {
    Source::new("truth", "base", |_| {
        let mut state = BaseState { position: [1.0, 2.0, 0.5], ..BaseState::default() };
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, YAW);
        state.orientation.copy_from_slice(rotation.coords.as_slice());
        Some(state)
    })
}

/// An object that starts far away and then stays at a position in base axes.
fn objects(ahead: f64, left: f64, z: f64) -> Source {
    Source::new("objects", "objects", move |_| {
        let mut poses = ObjectPoses::default();
        poses.set_count(1);
        poses.position_x_mut()[0] = 1.0 + ahead * YAW.cos() - left * YAW.sin();
        poses.position_y_mut()[0] = 2.0 + ahead * YAW.sin() + left * YAW.cos();
        poses.position_z_mut()[0] = z;
        poses.orientation_w_mut()[0] = 1.0;
        Some(poses)
    })
}

fn sensor<C: Component>(port: &str, config: &str) -> Instance {
    let config: toml::Table = format!("config = {{ sees_robot = false, {config} }}").parse().unwrap();
    Instance::of::<C>("sensor")
        .rate("50 Hz")
        .robot("dog")
        .subscribe("base_state", "base")
        .publish(port, "reading")
        .set("config", config["config"].clone())
}

fn run<C: Component, T: StateBuffer + Send>(
    port: &str,
    config: &str,
    object: Option<Source>,
    duration: &str,
) -> Vec<T> {
    let mut instance = sensor::<C>(port, config);
    let probe = Probe::<T>::for_topic("reading");
    let mut graph = Graph::new("rays").robot("dog", "quadruped").with(truth()).with(&probe);
    if let Some(object) = object {
        instance = instance.subscribe("object_poses", "objects");
        graph = graph.with(object);
    }
    let report = graph.with(instance).run(duration).unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    let readings = probe.values();
    assert_eq!(report.results["sensor"]["readings"].as_u64(), Some(readings.len() as u64));
    assert!(readings.len() > 3, "{}", readings.len());
    readings
}

const BALL: &str = "objects = [{ name = \"ball\", shape = { sphere = { radius = 0.5 } }, mass = 1.0, position = [50.0, 0.0, 0.5] }]";

#[test]
fn distances_in_millimetres_are_doubted() {
    let doubts = |sensor: Instance| {
        let graph = Graph::new("rays").robot("dog", "quadruped").with(truth()).with(sensor);
        let warnings = graph.check().expect("warnings alone").warnings;
        let of_config = warnings.iter().filter(|warning| warning.message().starts_with("`sensor.config"));
        let text =
            of_config.map(|warning| format!("{}; {}", warning.message(), warning.advice().unwrap_or("")));
        text.collect::<Vec<_>>()
    };
    let lidar = |config: &str| doubts(sensor::<AlongRays<Lidar>>("ranges", config));
    assert_eq!(lidar("most = 300.0, distance = { noise = 0.03 }"), [""; 0]);
    assert_eq!(
        lidar("most = 30000.0, distance = { noise = 30.0 }"),
        [
            "`sensor.config.most`: 30000 m, expected at most 1000 m; if it is in mm, write 30",
            "`sensor.config.distance.noise`: 30 m, expected at most 1 m; if it is in mm, write 0.03"
        ]
    );
    let ray = doubts(sensor::<AlongRays<RaySensor>>("range", "most = 4000.0"));
    assert_eq!(ray, ["`sensor.config.most`: 4000 m, expected at most 1000 m; if it is in mm, write 4"]);
    let scan = "size = [1600.0, 1000.0], spacing = 100.0, least = -2000.0, most = 1000.0";
    let scan = doubts(sensor::<AlongRays<HeightScanSensor>>("heights", scan));
    assert_eq!(scan.len(), 3, "{scan:?}");
    let wide = sensor::<AlongRays<Lidar>>("ranges", "field_of_view = 360.0");
    let graph = Graph::new("rays").robot("dog", "quadruped").with(truth()).with(wide);
    let error = graph.check().expect_err("it is refused").render(false);
    assert!(error.contains("if it is in degrees, write 6.2832"), "{error}");
}

#[test]
fn inclined_ray_reads_height_over_its_sine() {
    let config = "mount = { rpy = [0.0, 0.5, 0.0] }, world = { ground = { height = 0.1 } }";
    for reading in run::<AlongRays<RaySensor>, Ranges>("range", config, None, "200 ms") {
        assert_eq!(reading.count(), 1);
        assert!((f64::from(reading.range()[0]) - 0.4 / 0.5_f64.sin()).abs() < 1e-6, "{}", reading.range()[0]);
    }
}

#[test]
fn lidar_sees_a_moving_ball_at_its_current_pose() {
    let config = format!("world = {{ {BALL} }}, rays = 360, most = 8.0, least = 0.2");
    let readings = run::<AlongRays<Lidar>, Ranges>("ranges", &config, Some(objects(3.0, 0.0, 0.5)), "200 ms");
    for reading in readings {
        assert_eq!((reading.count(), reading.least, reading.most), (360, 0.2, 8.0));
        for (index, range) in reading.range().iter().enumerate() {
            // ray 180 points ahead; the chord of a circle of 0.5 m at 3 m
            let azimuth = (index as f64 - 180.0).to_radians();
            let square = 0.25 - (3.0 * azimuth.sin()).powi(2);
            let expected =
                if azimuth.cos() > 0.0 && square > 0.0 { 3.0 * azimuth.cos() - square.sqrt() } else { 16.0 };
            assert!((f64::from(*range) - expected).abs() < 1e-6, "ray {index}: {range}, expected {expected}");
        }
    }
}

#[test]
fn lidar_points_are_on_surfaces_in_sensor_axes() {
    let probe = Probe::<Ranges>::for_topic("reading");
    let config = "world = { ground = {} }, rays = 8, elevations = [-0.5, 0.5], most = 5.0";
    let instance = sensor::<AlongRays<Lidar>>("ranges", config).publish("points", "points");
    let counter = Instance::of::<Counter>("counter").trigger("points").subscribe("points", "points");
    let graph = Graph::new("rays").robot("dog", "quadruped").with(truth()).with(instance).with(counter);
    let report = graph.with(&probe).run("300 ms").unwrap();
    let result = &report.results["counter"];
    let scans = probe.values().len() as u64;
    assert!(result["scans"].as_u64().unwrap() + 2 > scans && scans > 3, "{result}");
    // the lower ring hits the ground, the other nothing
    assert_eq!(result["points"].as_u64(), Some(8 * result["scans"].as_u64().unwrap()));
    assert!((result["height"].as_f64().unwrap() + 0.5).abs() < 1e-6, "{result}");
    assert!((result["intensity"].as_f64().unwrap() - 0.5_f64.sin()).abs() < 1e-6, "{result}");
}

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// Counts points, and keeps the height and intensity of the last point.
struct Counter {
    points: motorium::transport::SliceInput<CloudPoint>,
    count: [u64; 2],
    last: [f32; 2],
}

impl Component for Counter {
    const KIND: &'static str = "test.counter";
    const SUMMARY: &'static str = "counts points";
    type Config = Nothing;

    fn declare(_: &Self::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.slice_input::<CloudPoint>("points", 8, "points");
        Ok(())
    }

    fn configure(_: Self::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self { points: setup.slice_input("points")?, count: [0; 2], last: [0.0; 2] })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        while let Some((_, points)) = self.points.next_unread() {
            self.count[0] += 1;
            self.count[1] += points.len() as u64;
            if let Some(last) = points.last() {
                self.last = [last.z, last.intensity];
            }
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({
            "scans": self.count[0], "points": self.count[1], "height": self.last[0], "intensity": self.last[1],
        }))
    }
}

#[test]
fn lidar_noise_and_lost_returns_match_the_settings() {
    let config =
        "world = { ground = {} }, rays = 200, elevations = [-0.5], distance = { noise = 0.02 }, lost = 0.1";
    let readings = run::<AlongRays<Lidar>, Ranges>("ranges", config, None, "4 s");
    let truth = 0.5 / 0.5_f64.sin();
    let all: Vec<f64> =
        readings.iter().flat_map(|reading| reading.range()).map(|range| f64::from(*range)).collect();
    let seen: Vec<f64> = all.iter().copied().filter(|range| *range < 30.0).collect();
    let (n, total) = (seen.len() as f64, all.len() as f64);
    let lost = 1.0 - n / total;
    assert!((lost - 0.1).abs() < 5.0 * (0.09 / total).sqrt(), "{lost}");
    let mean = seen.iter().sum::<f64>() / n - truth;
    assert!(mean.abs() < 5.0 * 0.02 / n.sqrt(), "{mean}");
    let ratio = seen.iter().map(|range| (range - truth).powi(2)).sum::<f64>() / n / (0.02 * 0.02);
    assert!((ratio - 1.0).abs() < 5.0 * (2.0 / n).sqrt(), "{ratio}");
}

#[test]
fn height_scan_is_level_and_yaws_with_the_base() {
    let config = "size = [1.0, 0.6], spacing = 0.2, world = { ground = {}, objects = [{ name = \"step\", shape = { box = \
                  { size = [0.3, 0.3, 0.2] } }, mass = 1.0, position = [50.0, 0.0, 0.5] }] }";
    // the box is aligned with the world and reaches at least 0.15 m to each side: one point is on it
    let readings = run::<AlongRays<HeightScanSensor>, HeightScan>(
        "heights",
        config,
        Some(objects(0.3, 0.3, 0.1)),
        "200 ms",
    );
    for reading in readings {
        assert_eq!((reading.rows, reading.columns, reading.spacing), (6, 4, 0.2));
        for (index, height) in reading.height().iter().enumerate() {
            let (x, y) = ((index / 4) as f64 * 0.2 - 0.5, (index % 4) as f64 * 0.2 - 0.3);
            let (dx, dy) = (x - 0.3, y - 0.3);
            let in_world = (dx * YAW.cos() - dy * YAW.sin(), dx * YAW.sin() + dy * YAW.cos());
            let on = in_world.0.abs() < 0.15 && in_world.1.abs() < 0.15;
            let expected = if on { -0.3 } else { -0.5 };
            assert!((f64::from(*height) - expected).abs() < 1e-6, "point {index}: {height}");
        }
        assert!(reading.height().iter().any(|height| *height > -0.4));
    }
}

#[test]
fn latency_and_drop_outs_work_as_in_other_sensors() {
    let config = "world = { ground = {} }, rays = 4, latency = \"60 ms\", drop_out = 0.5, seed = 3";
    let readings = run::<AlongRays<Lidar>, Ranges>("ranges", config, None, "8 s");
    let share = readings.len() as f64 / 400.0;
    assert!((share - 0.5).abs() < 5.0 * (0.25 / 400.0_f64).sqrt(), "{share}");
}

#[test]
fn fixed_sensors_need_no_motion_and_see_the_arm() {
    let config: toml::Table =
        "config = { mount = { position = [1.0, 0.0, 0.07] }, rays = 360, sees_robot = true, most = 5.0 }"
            .parse()
            .unwrap();
    let lidar = Instance::of::<AlongRays<Lidar>>("sensor")
        .rate("50 Hz")
        .robot("arm")
        .subscribe("joint_state", "joints")
        .publish("ranges", "reading")
        .set("config", config["config"].clone());
    let joints = Source::new("joints", "joints", |_| {
        let mut state = JointState::default();
        state.set_count(8);
        Some(state)
    });
    let probe = Probe::<Ranges>::for_topic("reading");
    let report =
        Graph::new("rays").robot("arm", "panda").with(joints).with(lidar).with(&probe).run("200 ms").unwrap();
    assert_eq!(report.components.iter().find(|component| component.name == "sensor").unwrap().errors, 0);
    for reading in probe.values() {
        // ray 0 points backwards to the arm, whose base is at most 0.2 m wide
        assert!((0.8..1.0).contains(&reading.range()[0]), "{}", reading.range()[0]);
        assert!(reading.range()[90] > 5.0 && reading.range()[180] > 5.0);
    }
    let still =
        Instance::of::<AlongRays<RaySensor>>("sensor").rate("50 Hz").robot("arm").publish("range", "reading");
    let config: toml::Table =
        "config = { sees_robot = false, mount = { rpy = [0.0, 1.5707963, 0.0], position = [0.0, 0.0, 1.0] }, world = { ground = {} } }".parse().unwrap();
    let probe = Probe::<Ranges>::for_topic("reading");
    let still = still.set("config", config["config"].clone());
    Graph::new("rays").robot("arm", "panda").with(still).with(&probe).run("200 ms").unwrap();
    assert!(
        probe.values().len() > 8
            && probe.values().iter().all(|reading| (reading.range()[0] - 1.0).abs() < 1e-6)
    );
}

/// Keeps the images of a camera as numbers.
struct Pictures {
    depth: motorium::transport::SliceInput<u8>,
    grey: motorium::transport::SliceInput<u8>,
    count: u64,
    last: Vec<f32>,
    shade: Vec<u8>,
}

impl Component for Pictures {
    const KIND: &'static str = "test.pictures";
    const SUMMARY: &'static str = "keeps pictures";
    type Config = Nothing;

    fn declare(_: &Self::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.slice_input::<u8>("depth", 4, "depth");
        declare.slice_input::<u8>("grey", 4, "grey");
        Ok(())
    }

    fn configure(_: Self::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let (depth, grey) = (setup.slice_input("depth")?, setup.slice_input("grey")?);
        Ok(Self { depth, grey, count: 0, last: vec![0.0; 160 * 120], shade: vec![0; 160 * 120] })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        while let Some((_, bytes)) = self.depth.next_unread() {
            self.count += 1;
            for (value, bytes) in self.last.iter_mut().zip(bytes.chunks_exact(4)) {
                *value = f32::from_ne_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            }
        }
        while let Some((_, bytes)) = self.grey.next_unread() {
            self.shade.copy_from_slice(bytes);
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "pictures": self.count, "depth": self.last, "grey": self.shade }))
    }
}

#[test]
fn depth_camera_matches_pinhole_depths() {
    let config =
        format!("world = {{ ground = {{}}, {BALL} }}, mount = {{ rpy = [0.0, 0.3, 0.0] }}, most = 4.0");
    let camera = sensor::<AlongRays<DepthCamera>>("depth", &config)
        .subscribe("object_poses", "objects")
        .publish("grey", "grey")
        .publish("info", "info");
    let pictures = Instance::of::<Pictures>("pictures")
        .trigger("reading")
        .subscribe("depth", "reading")
        .subscribe("grey", "grey");
    let info = Probe::<ImageInfo>::for_topic("info");
    // the ball of 0.5 m is on the optical axis, 2 m ahead of the camera at 0.5 m
    let ball = objects(2.0 * 0.3_f64.cos(), 0.0, 0.5 - 2.0 * 0.3_f64.sin());
    let graph =
        Graph::new("rays").robot("dog", "quadruped").with(truth()).with(ball).with(camera).with(pictures);
    let report = graph.with(&info).run("300 ms").unwrap();
    let camera = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((camera.allocations, camera.errors), (Some(0), 0));
    let info = info.values()[0];
    assert_eq!((info.width, info.height, info.stride, info.encoding), (160, 120, 640, ImageInfo::DEPTH_32));
    let result = &report.results["pictures"];
    assert!(result["pictures"].as_u64().unwrap() > 3);
    let depth: Vec<f64> =
        result["depth"].as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect();
    let grey: Vec<u64> =
        result["grey"].as_array().unwrap().iter().map(|value| value.as_u64().unwrap()).collect();
    let (mut ball, mut ground, mut nothing) = (0, 0, 0);
    for (index, depth) in depth.iter().enumerate() {
        let right = ((index % 160) as f64 - info.principal_point[0]) / info.focal_length[0];
        let down = ((index / 160) as f64 - info.principal_point[1]) / info.focal_length[1];
        // a point at depth z is at (z, -right z, -down z) in camera axes; the camera is pitched down by 0.3
        // rad at 0.5 m
        let square = 1.0 + right * right + down * down;
        let root = 4.0 - square * (4.0 - 0.25);
        let falls = 0.3_f64.sin() + down * 0.3_f64.cos();
        let floor = if falls > 0.0 { 0.5 / falls } else { f64::INFINITY };
        let (expected, kind) = if root > 0.0 && (2.0 - root.sqrt()) / square < floor {
            ((2.0 - root.sqrt()) / square, &mut ball)
        } else if floor <= 4.0 {
            (floor, &mut ground)
        } else {
            (0.0, &mut nothing)
        };
        *kind += 1;
        assert!(
            (depth - expected).abs() < 1e-5 * (1.0 + expected),
            "pixel {index}: {depth}, expected {expected}"
        );
    }
    assert!(ball > 1000 && ground > 1000 && nothing > 100, "{ball} {ground} {nothing}");
    // a ball is brightest in its centre
    let middle = 60 * 160 + 80;
    assert!(grey[middle] > 250 && grey[middle + 20] < grey[middle], "{} {}", grey[middle], grey[middle + 20]);
}

#[test]
fn invalid_settings_are_rejected_with_the_key() {
    for (config, expected) in [
        ("rays = 3000", "rays"),
        ("elevations = [2.0]", "elevations"),
        ("field_of_view = -1.0", "field_of_view"),
        ("least = 40.0", "least"),
        ("lost = 1.5", "lost"),
        ("distance = { noise = -1.0 }", "distance.noise"),
        ("world = { ground = { friction = -1.0 } }", "ground: `friction` is -1"),
        (&format!("world = {{ {BALL} }}"), "object_poses"),
    ] {
        let instance = sensor::<AlongRays<Lidar>>("ranges", config);
        let graph = Graph::new("rays").robot("dog", "quadruped").with(truth()).with(instance);
        let error = graph.check().unwrap_err().to_string();
        assert!(error.contains(expected), "{config}: {error}");
    }
}

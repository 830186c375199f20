//! The colour camera and the blob estimator in graphs.

use motorium::component::Component;
use motorium::prelude::*;
use motorium::state::{ImageInfo, ObjectPoses};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_sensors::component::blob::BlobEstimator;
use motorium_sensors::component::rays::{AlongRays, Camera};

#[derive(serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
struct Nothing {}

/// Keeps the last image and the age of each image on arrival.
struct Keeper {
    image: motorium::transport::SliceInput<u8>,
    count: u64,
    last: Vec<u8>,
    oldest_ns: u64,
}

impl Component for Keeper {
    const KIND: &'static str = "test.keeper";
    const SUMMARY: &'static str = "keeps pictures";
    type Config = Nothing;

    fn declare(_: &Self::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        declare.slice_input::<u8>("image", 4, "picture");
        Ok(())
    }

    fn configure(_: Self::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let image = setup.slice_input("image")?;
        Ok(Self { image, count: 0, last: vec![0; 160 * 120 * 3], oldest_ns: 0 })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        while let Some((stamp, pixels)) = self.image.next_unread() {
            self.count += 1;
            self.last.copy_from_slice(pixels);
            self.oldest_ns = self.oldest_ns.max(stamp.publish_time - stamp.source_time);
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let Self { count, last, oldest_ns, .. } = self;
        Some(serde_json::json!({ "pictures": count, "last": last, "age_ns": oldest_ns }))
    }
}

fn config(text: &str) -> toml::Value {
    let table: toml::Table = format!("config = {{ {text} }}").parse().unwrap();
    table["config"].clone()
}

/// The arm at rest.
fn joints() -> Source {
    Source::new("joints", "joints", |_| {
        let mut state = JointState::default();
        state.set_count(8);
        Some(state)
    })
}

/// A red ball that starts far away and moves along y at 0.1 m/s.
fn ball() -> Source {
    Source::new("objects", "objects", |tick: &Tick| {
        let mut poses = ObjectPoses::default();
        poses.set_count(1);
        poses.position_x_mut()[0] = 1.0;
        poses.position_y_mut()[0] = 0.1 * tick.time_ns as f64 * 1e-9;
        poses.position_z_mut()[0] = 0.5;
        poses.orientation_w_mut()[0] = 1.0;
        Some(poses)
    })
}

const WORLD: &str = "world = { ground = {}, objects = [{ name = \"ball\", shape = { sphere = { radius = 0.1 } }, mass = \
                     1.0, position = [50.0, 0.0, 0.5] }], appearance = { colours = { ball = [0.9, 0.1, 0.1] } } }";

fn camera(text: &str) -> Instance {
    Instance::of::<AlongRays<Camera>>("camera")
        .rate("50 Hz")
        .robot("arm")
        .subscribe("joint_state", "joints")
        .subscribe("object_poses", "objects")
        .publish("image", "image")
        .publish("info", "info")
        .set("config", config(text))
}

fn graph(camera: Instance) -> Graph {
    let keeper = Instance::of::<Keeper>("keeper").trigger("image").subscribe("image", "image");
    Graph::new("camera").robot("arm", "panda").with(joints()).with(ball()).with(camera).with(keeper)
}

fn pixels(value: &serde_json::Value) -> Vec<[u64; 3]> {
    let bytes: Vec<u64> = value.as_array().unwrap().iter().map(|byte| byte.as_u64().unwrap()).collect();
    bytes.as_chunks::<3>().0.to_vec()
}

#[test]
fn world_camera_sees_colours_reproducibly() {
    // the camera looks along -x from 3 m ahead of the arm
    let text = format!(
        "mount = {{ frame = \"world\", position = [3.0, 0.0, 0.5], rpy = [0.0, 0.0, 3.14159265] }}, \
         noise = {{ full_well = 20000.0 }}, seed = 4, {WORLD}"
    );
    let run = || {
        let info = Probe::<ImageInfo>::for_topic("info");
        let report = graph(camera(&text)).with(&info).run("300 ms").unwrap();
        let camera = report.components.iter().find(|component| component.name == "camera").unwrap();
        assert_eq!((camera.allocations, camera.errors), (Some(0), 0));
        (report, info.values()[0])
    };
    let (report, info) = run();
    assert_eq!(report.state_hash, run().0.state_hash);
    assert_eq!((info.width, info.height, info.stride, info.encoding), (160, 120, 480, ImageInfo::RGB_8));
    let result = &report.results["keeper"];
    assert!(result["pictures"].as_u64().unwrap() > 10);
    let pixels = pixels(&result["last"]);
    let count = |is: &dyn Fn([u64; 3]) -> bool| pixels.iter().filter(|pixel| is(**pixel)).count();
    let red = count(&|[r, g, b]| r > 3 * g && r > 3 * b && r > 60);
    // a ball of 0.1 m at 2 m: a disc of 6.9 pixels
    let disc = std::f64::consts::PI * (info.focal_length[0] * (0.1_f64 / 2.0).asin().tan()).powi(2);
    assert!((red as f64 / disc - 1.0).abs() < 0.1, "{red}, expected {disc}");
    let sky = count(&|[r, g, b]| b > r && b > g && b > 200 && r < 190);
    assert!(sky > 2000, "{sky}");
    // above the horizon, the white and black arm is in front of the sky
    let above = &pixels[..55 * 160];
    let arm = above.iter().filter(|[r, g, b]| r.abs_diff(*b) < 12 && r.abs_diff(*g) < 12).count();
    assert!((60..2000).contains(&arm), "{arm}");
    assert!(
        pixels[0][2] > pixels[0][0] && pixels[119 * 160].iter().all(|level| *level > 60),
        "top and bottom"
    );
}

#[test]
fn image_arrives_after_its_latency_with_exposure_time() {
    let mount = "mount = { frame = \"world\", position = [3.0, 0.0, 0.5] }";
    let text = format!("{mount}, latency = \"60 ms\", {WORLD}");
    let report = graph(camera(&text)).run("400 ms").unwrap();
    assert_eq!(report.results["keeper"]["age_ns"], 60_000_000);
}

fn estimator(text: &str) -> Instance {
    Instance::of::<BlobEstimator>("blob")
        .rate("200 Hz")
        .robot("arm")
        .subscribe("image", "image")
        .subscribe("info", "info")
        .publish("target", "target")
        .set("config", config(text))
}

#[test]
fn moving_ball_is_predicted_to_the_present() {
    let place = "{ frame = \"world\", position = [1.8, 0.0, 0.5], rpy = [0.0, 0.0, 3.14159265] }";
    let text = format!("mount = {place}, latency = \"40 ms\", {WORLD}");
    let blob = estimator(&format!("camera = {place}, colour = [0.9, 0.1, 0.1], radius = 0.1"));
    let probe = Probe::<PoseTarget>::for_topic("target").triggered();
    let report = graph(camera(&text)).with(blob).with(&probe).run("2 s").unwrap();
    let blob = report.components.iter().find(|component| component.name == "blob").unwrap();
    assert_eq!((blob.allocations, blob.errors), (Some(0), 0));
    let result = &report.results["blob"];
    assert_eq!((&result["unplaced"], &result["seen"]), (&0.into(), &result["pictures"]));
    let samples = probe.samples();
    let late: Vec<_> = samples.iter().filter(|sample| sample.tick.time_ns > 1_000_000_000).collect();
    assert!(late.len() > 150, "{}", late.len());
    for sample in late {
        let PoseTarget { position: [x, y, z], linear_velocity: [_, speed, _], .. } = sample.value;
        let expected = 0.1 * sample.tick.time_ns as f64 * 1e-9;
        assert!((x - 1.0).abs() < 0.01 && (z - 0.5).abs() < 0.005, "{x} {z}");
        assert!((y - expected).abs() < 0.005, "{y}, expected {expected}");
        assert!((speed - 0.1).abs() < 0.03, "{speed}");
    }
}

#[test]
fn camera_sees_mjcf_objects_in_their_colours() {
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("camera-yard.xml");
    let text = r#"<mujoco><asset><material name="red" rgba="0.9 0.05 0.05 1"/></asset><worldbody>
      <geom type="plane" size="0 0 1" rgba="0.05 0.8 0.05 1"/>
      <geom name="post" type="box" size="0.1 0.1 0.1" pos="0.6 0 0.5" material="red"/>
    </worldbody></mujoco>"#;
    std::fs::write(&file, text).unwrap();
    let text = format!(
        "mount = {{ frame = \"world\", position = [3.0, 0.0, 0.5], rpy = [0.0, 0.0, 3.14159265] }}, \
         sees_robot = false, world = {{ file = \"{}\" }}",
        file.display()
    );
    let camera = Instance::of::<AlongRays<Camera>>("camera")
        .rate("50 Hz")
        .robot("arm")
        .publish("image", "image")
        .publish("info", "info")
        .set("config", config(&text));
    let keeper = Instance::of::<Keeper>("keeper").trigger("image").subscribe("image", "image");
    let report = Graph::new("camera").robot("arm", "panda").with(camera).with(keeper).run("100 ms").unwrap();
    let pixels = pixels(&report.results["keeper"]["last"]);
    let count = |is: &dyn Fn([u64; 3]) -> bool| pixels.iter().filter(|pixel| is(**pixel)).count();
    let (red, green) =
        (count(&|[r, g, b]| r > 3 * g && r > 3 * b), count(&|[r, g, b]| g > 3 * r && g > 3 * b));
    assert!(red > 50 && green > 1000, "{red} red and {green} green of {} pixels", pixels.len());
}

#[test]
fn object_at_rest_is_steady_for_a_moving_camera() {
    let swing = Source::new("joints", "joints", |tick: &Tick| {
        let mut state = JointState::default();
        state.set_count(8);
        let angle = 0.3 * (3.0 * tick.time_ns as f64 * 1e-9).sin();
        state.position_mut().copy_from_slice(&[angle, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.035]);
        Some(state)
    });
    let place = "{ frame = \"panda_hand\", position = [0.0, 0.0, 0.115], rpy = [0.0, -1.5707963, 0.0] }";
    let world = "world = { ground = {}, objects = [{ name = \"ball\", shape = { sphere = { radius = 0.05 } }, \
                 position = [0.35, 0.0, 0.05] }], appearance = { colours = { ball = [0.1, 0.8, 0.1] } } }";
    let text = format!("mount = {place}, latency = \"60 ms\", sees_robot = false, {world}");
    let camera = Instance::of::<AlongRays<Camera>>("camera")
        .rate("50 Hz")
        .robot("arm")
        .subscribe("joint_state", "joints")
        .publish("image", "image")
        .publish("info", "info")
        .set("config", config(&text));
    let blob = estimator(&format!("camera = {place}, colour = [0.1, 0.8, 0.1], radius = 0.05"))
        .subscribe("joint_state", "joints");
    let probe = Probe::<PoseTarget>::for_topic("target").triggered();
    let graph = Graph::new("swing").robot("arm", "panda").with(swing).with(camera).with(blob).with(&probe);
    let report = graph.run("2 s").unwrap();
    assert_eq!(report.results["blob"]["unplaced"], 0);
    let values = probe.values();
    assert!(values.len() > 300, "{}", values.len());
    for PoseTarget { position: [x, y, z], .. } in &values[20..] {
        // the hand is 3 cm farther after 60 ms
        let apart = (x - 0.35).hypot(*y).hypot(z - 0.05);
        assert!(apart < 0.005, "({x}, {y}, {z})");
    }
}

#[test]
fn invalid_camera_and_object_settings_are_rejected() {
    let mount = "mount = { frame = \"world\" }";
    for (text, expected) in [
        (format!("{mount}, width = 0, {WORLD}"), "width"),
        (format!("{mount}, field_of_view = 3.5, {WORLD}"), "field_of_view"),
        (format!("{mount}, field_of_view = 1.0, vertical_field_of_view = 1.0, {WORLD}"), "more than one"),
        (
            format!("{mount}, intrinsics = {{ fx = 0.0, fy = 1.0, cx = 0.0, cy = 0.0 }}, {WORLD}"),
            "intrinsics.fx",
        ),
        (format!("{mount}, noise = {{ full_well = -1.0 }}, {WORLD}"), "noise.full_well"),
        (format!("{mount}, most = 0.0, {WORLD}"), "most"),
        (format!("mount = {{ frame = \"wrold\" }}, {WORLD}"), "mount.frame"),
        (
            format!("{mount}, {}", WORLD.replace("colours = { ball", "colours = { bal")),
            "did you mean \"ball\"",
        ),
        (format!("{mount}, {}", WORLD.replace("[0.9, 0.1", "[1.9, 0.1")), "colours"),
    ] {
        let error = graph(camera(&text)).check().unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
    for (text, expected) in [
        ("colour = [0.0, 0.0, 0.0]", "colour"),
        ("colour = [1.0, 0.0, 0.0], smoothing = 1.0", "smoothing"),
        ("colour = [1.0, 0.0, 0.0], radius = 0.0", "radius"),
    ] {
        let blob = estimator(&format!("camera = {{ frame = \"world\" }}, {text}"));
        let camera = camera(&format!("{mount}, {WORLD}"));
        let error = graph(camera).with(blob).check().unwrap_err().to_string();
        assert!(error.contains(expected), "{text}: {error}");
    }
}

/// A square ring about the x axis, 0.4 m wide with a hole of 0.2 m, 0.02 m thick, as OBJ.
fn ring() -> String {
    let corners = |half: f64, x: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| (x, y * half, z * half))
    };
    let points = [corners(0.2, -0.01), corners(0.1, -0.01), corners(0.2, 0.01), corners(0.1, 0.01)].concat();
    let mut text: String = points.iter().map(|(x, y, z)| format!("v {x} {y} {z}\n")).collect();
    for side in 0..4 {
        let next = (side + 1) % 4;
        let [a, b, c, d] = [side, next, 4 + next, 4 + side];
        for face in [[d, c, b, a], [a + 8, b + 8, c + 8, d + 8], [a, b, b + 8, a + 8], [c, d, d + 8, c + 8]] {
            let [p, q, r, s] = face.map(|corner| corner + 1);
            text += &format!("f {p} {q} {r} {s}\n");
        }
    }
    text
}

#[test]
fn mesh_is_rendered_with_its_colour_and_hole() {
    let file = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("camera-ring.obj");
    std::fs::write(&file, ring()).unwrap();
    let world = format!(
        "world = {{ ground = {{}}, objects = [{{ name = \"ring\", shape = {{ mesh = {{ file = {:?} }} }}, mass = 1.0, \
         position = [50.0, 0.0, 0.5] }}], appearance = {{ colours = {{ ring = [0.9, 0.1, 0.1] }} }} }}",
        file.display().to_string()
    );
    let mount = "mount = { frame = \"world\", position = [3.0, 0.0, 0.4], rpy = [0.0, 0.0, 3.14159265] }";
    let text = format!("{mount}, sees_robot = false, {world}");
    let info = Probe::<ImageInfo>::for_topic("info");
    let camera = Instance::of::<AlongRays<Camera>>("camera")
        .rate("50 Hz")
        .robot("arm")
        .subscribe("object_poses", "objects")
        .publish("image", "image")
        .publish("info", "info")
        .set("config", config(&text));
    let report = graph(camera).with(&info).run("200 ms").unwrap();
    let pixels = pixels(&report.results["keeper"]["last"]);
    let focal = info.values()[0].focal_length[0];
    let red = pixels.iter().filter(|[r, g, b]| *r > 3 * g && *r > 3 * b && *r > 60).count() as f64;
    // The front is 1.99 m away, and the sides of the hole are seen at an angle.
    let expected = (focal / 1.99).powi(2) * (0.4 * 0.4 - 0.2 * 0.2);
    assert!((red / expected - 1.0).abs() < 0.1, "{red} pixels, expected {expected}");
    // The middle of the hole, 0.1 m above the camera.
    let row = (60.0 - focal * 0.1 / 2.0) as usize;
    let [r, g, b] = pixels[row * 160 + 80];
    assert!(b > r && b > g && b > 200, "the sky through the hole: {:?}", [r, g, b]);
}

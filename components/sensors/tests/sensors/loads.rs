//! `sensor.force_torque` and `sensor.joint_torque`: the library compared with Newton-Euler, and graphs with
//! closed forms.

use std::path::Path;

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, Source, allocations};
use motorium_physics::ArticulatedPhysics;
use motorium_robots::{Dynamics, JointKind, Kinematics, Model, load};
use motorium_sensors::component::force_torque::ForceTorque;
use motorium_sensors::component::joint_torque::JointTorque;
use motorium_sensors::loads::{Loads, OutsideForce};
use nalgebra::{Point3, UnitQuaternion, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// Position and velocity at a time, for a constant acceleration `a` from `q` and `v`.
fn state_at(time: f64, q: &[f64], v: &[f64], a: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let positions = q.iter().zip(v).zip(a).map(|((q, v), a)| q + v * time + 0.5 * a * time * time);
    (positions.collect(), v.iter().zip(a).map(|(v, a)| v + a * time).collect())
}

fn sampled(model: &Model, loads: &mut Loads, (q, v, a): (&[f64], &[f64], &[f64]), outside: &[OutsideForce]) {
    let mut kinematics = Kinematics::new(model);
    let h = 1e-4;
    for (time_ns, time) in [(0, -0.5 * h), (100_000, 0.5 * h)] {
        let (q, v) = state_at(time, q, v, a);
        kinematics.update_with_velocity(model, &q, &v);
        loads.sample(time_ns, model, &kinematics, outside.iter().copied());
    }
}

#[test]
fn joint_torques_match_newton_euler() {
    for robot in ["panda", "iiwa14", "ur5e", "planar-3r"] {
        let model = load(robot, Path::new(".")).unwrap().model;
        let number = |k: usize, scale: f64| scale * (1.3 + 2.7 * k as f64).sin();
        let q: Vec<f64> = (0..model.nv()).map(|k| number(k, 0.8)).collect();
        let v: Vec<f64> = (0..model.nv()).map(|k| number(k + 20, 1.0)).collect();
        let a: Vec<f64> = (0..model.nv()).map(|k| number(k + 40, 5.0)).collect();
        let mut expected = vec![0.0; model.nv()];
        Dynamics::new(&model).rnea(&model, &q, &v, &a, GRAVITY, &mut expected);
        let mut loads = Loads::new(&model, GRAVITY);
        sampled(&model, &mut loads, (&q, &v, &a), &[]);
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, &q);
        let largest = expected.iter().fold(0.0_f64, |most, tau| most.max(tau.abs()));
        for (joint, expected) in expected.iter().enumerate() {
            if model.joint(joint).kind == JointKind::Prismatic {
                // a mimicked finger: the drive bears both
                continue;
            }
            let body = model.joint_body(joint);
            let link = model.frame(&model.bodies()[body].name).unwrap();
            let (_, torque) = loads.through(link).seen_from(&kinematics.body_pose(body));
            let found = model.joint(joint).axis.dot(&torque);
            assert!((found - expected).abs() < 1e-5 * largest, "{robot}, joint {joint}: {found}, {expected}");
        }
    }
}

#[test]
fn external_force_reduces_only_the_loads_above_it() {
    let model = load("planar-3r", Path::new(".")).unwrap().model;
    let still = vec![0.0; 3];
    let (first, second) = (model.frame("link1").unwrap(), model.frame("link2").unwrap());
    let outside = [OutsideForce {
        link: first.index(),
        point: Point3::new(0.4, 0.0, 0.0),
        force: Vector3::new(0.0, 5.0, 0.0),
    }];
    let mut loads = Loads::new(&model, Vector3::zeros());
    sampled(&model, &mut loads, (&still, &still, &still), &outside);
    assert_eq!(loads.through(second).force, Vector3::zeros());
    assert_eq!(loads.through(first).force, Vector3::new(0.0, -5.0, 0.0));
    assert_eq!(loads.through(first).torque, Vector3::new(0.0, 0.0, -2.0));
}

#[test]
fn sampling_does_not_allocate() {
    let model = load("panda", Path::new(".")).unwrap().model;
    let mut loads = Loads::new(&model, GRAVITY);
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, &model.neutral());
    let count = allocations(|| {
        for k in 0..100 {
            std::hint::black_box(loads.sample(k * 1_000_000, &model, &kinematics, []));
        }
    });
    assert_eq!(count, 0);
}

fn table(config: &str) -> toml::Value {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    config["config"].clone()
}

/// The pendulum at rest at an angle.
fn still(angle: f64) -> Source {
    Source::new("truth", "rod/state", move |_| {
        let mut state = JointState::default();
        state.set_count(1);
        state.position_mut()[0] = angle;
        Some(state)
    })
}

fn force_torque(config: &str) -> Instance {
    Instance::of::<ForceTorque>("sensor")
        .rate("1 kHz")
        .publish("wrench", "wrench")
        .set("config", table(config))
}

fn held(angle: f64, config: &str) -> (Report, Vec<Wrench>) {
    let probe = Probe::<Wrench>::for_topic("wrench");
    let sensor = force_torque(config).robot("rod").subscribe("joint_state", "rod/state");
    let graph = Graph::new("loads").robot("rod", "pendulum").with(still(angle)).with(sensor).with(&probe);
    let report = graph.run("100 ms").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    (report, probe.values())
}

fn near(found: [f64; 3], expected: [f64; 3], error: f64) -> bool {
    found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < error)
}

/// A rod of 1 kg and 1 m that hangs at 0; its frame turns with it about y.
#[test]
fn at_rest_reads_weight_and_lever_in_sensor_axes() {
    for angle in [0.0_f64, 0.5, std::f64::consts::FRAC_PI_2, -2.0] {
        let (report, readings) = held(angle, "link = \"rod\"");
        assert!(readings.len() > 90);
        let weight = 9.81;
        for Wrench { force, torque } in readings {
            // upwards, in the axes of the rod
            assert!(
                near(force, [-weight * angle.sin(), 0.0, weight * angle.cos()], 1e-9),
                "{angle}: {force:?}"
            );
            assert!(near(torque, [0.0, 0.5 * weight * angle.sin(), 0.0], 1e-9), "{angle}: {torque:?}");
        }
        assert_eq!(report.results["sensor"]["carried_mass_kg"], 1.0);
    }
}

#[test]
fn sensor_pose_changes_reference_point_and_axes() {
    let config = "link = \"rod\", position = [0.0, 0.0, -1.0], rpy = [0.0, 0.0, 1.5707963267948966]";
    let (_, readings) = held(std::f64::consts::FRAC_PI_2, config);
    for Wrench { force, torque } in readings {
        // the lever of the rod's end has the opposite sign; the sensor's y axis is the rod's -x
        assert!(near(force, [0.0, 9.81, 0.0], 1e-9), "{force:?}");
        assert!(near(torque, [-0.5 * 9.81, 0.0, 0.0], 1e-9), "{torque:?}");
    }
}

#[test]
fn errors_latency_and_range_match_the_configuration() {
    let config = "link = \"rod\", force = { noise = 0.2, resolution = 0.5, range = 9.0 }, torque = { noise = 0.01 }, latency = \"10 ms\", seed = 7";
    let ((one, readings), (two, _)) = (held(0.0, config), held(0.0, config));
    assert_eq!(one.state_hash, two.state_hash);
    assert!((80..=90).contains(&readings.len()), "{}", readings.len());
    assert!(readings.iter().all(|reading| reading.force[2] == 9.0), "readings saturate at the range");
    assert!(readings.iter().all(|reading| (reading.force[0] * 2.0).fract() == 0.0));
    let count = readings.len() as f64;
    let deviation = (readings.iter().map(|reading| reading.torque[1].powi(2)).sum::<f64>() / count).sqrt();
    assert!((0.007..0.013).contains(&deviation), "{deviation}");
    assert_ne!(held(0.0, &config.replace("seed = 7", "seed = 8")).0.state_hash, one.state_hash);
}

#[test]
fn leg_in_free_fall_reads_zero_at_any_attitude() {
    let rotation = UnitQuaternion::from_euler_angles(0.3, -0.8, 2.0);
    let base = Source::new("base", "dog/base", move |tick| {
        let mut state = BaseState::default();
        state.orientation.copy_from_slice(rotation.coords.as_slice());
        let velocity = rotation.inverse() * (Vector3::new(0.4, 0.0, 0.1) + GRAVITY * tick.time());
        state.linear_velocity.copy_from_slice(velocity.as_slice());
        let fallen = Vector3::new(0.4, 0.0, 0.1) * tick.time() + GRAVITY * (0.5 * tick.time().powi(2));
        state.position.copy_from_slice(fallen.as_slice());
        Some(state)
    });
    let joints = Source::new("joints", "dog/joints", |_| {
        let mut state = JointState::default();
        state.set_count(12);
        state.position_mut().fill(0.4);
        Some(state)
    });
    let probe = Probe::<Wrench>::for_topic("wrench");
    let sensor = force_torque("link = \"hind_left_thigh\"")
        .robot("dog")
        .subscribe("base_state", "dog/base")
        .subscribe("joint_state", "dog/joints");
    let graph =
        Graph::new("loads").robot("dog", "quadruped").with(base).with(joints).with(sensor).with(&probe);
    graph.run("100 ms").unwrap();
    let readings = probe.values();
    assert!(readings.len() > 90);
    for Wrench { force, torque } in readings {
        assert!(near(force, [0.0; 3], 1e-8) && near(torque, [0.0; 3], 1e-8), "{force:?} {torque:?}");
    }
}

/// The simulated pendulum, driven by a changing torque.
fn swing(config: &str, subscribe_randomisation: bool) -> Vec<(f64, f64)> {
    let drive = Source::new("drive", "rod/command", |tick| {
        let mut command = JointCommand::default();
        command.set_count(1);
        command.effort_mut()[0] = 4.0 * (20.0 * tick.time()).sin();
        Some(command)
    });
    let physics = Instance::of::<ArticulatedPhysics>("physics")
        .rate("1 kHz")
        .robot("rod")
        .subscribe("joint_command", "rod/command")
        .publish("joint_state", "rod/state")
        .set("config", table(config));
    let (truth, measured) =
        (Probe::<JointState>::for_topic("rod/state"), Probe::<JointState>::for_topic("rod/torque"));
    let mut sensor = Instance::of::<JointTorque>("sensor")
        .trigger("rod/state")
        .robot("rod")
        .subscribe("joint_state", "rod/state")
        .subscribe("contacts", "rod/contacts")
        .publish("measured", "rod/torque");
    let mut physics = physics.publish("contacts", "rod/contacts");
    if config.contains("randomise") {
        physics = physics.publish("randomisation", "rod/drawn");
    }
    if subscribe_randomisation {
        sensor = sensor.subscribe("randomisation", "rod/drawn");
    }
    let graph = Graph::new("swing").robot("rod", "pendulum").with(drive).with(physics).with(sensor);
    let report = graph.with(&truth).with(&measured).run("500 ms").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    let (truth, measured) = (truth.samples(), measured.samples());
    assert!(measured.len() > 450, "{}", measured.len());
    let pair = |reading: &motorium::testing::Sample<JointState>| {
        let state = truth.iter().find(|state| state.stamp.source_time == reading.stamp.source_time).unwrap();
        assert_eq!(reading.value.position(), state.value.position());
        (reading.value.effort()[0], state.value.effort()[0])
    };
    measured.iter().map(pair).collect()
}

/// Without friction, damping and drive inertia, both sides of the sensor carry the same torque.
#[test]
fn transmitted_torque_equals_the_drive_torque() {
    for (measured, applied) in swing("", false) {
        assert!((measured - applied).abs() < 0.02, "{measured}, {applied} Nm");
    }
}

/// An external push bears a share of the load: the joint transmits no more than its drive provides.
#[test]
fn pushes_of_the_graph_are_included() {
    let push = "pushes = [{ at = \"100 ms\", duration = \"200 ms\", link = \"tip\", force = [3.0, 0.0, 1.0], torque = [0.0, 0.7, 0.2] }]";
    for (measured, applied) in swing(push, false) {
        assert!((measured - applied).abs() < 0.03, "{measured}, {applied} Nm");
    }
}

#[test]
fn sensor_uses_sampled_masses_and_gravity() {
    let config = "randomise = { mass = [2.0, 2.0], gravity = [0.5, 0.5] }";
    for (measured, applied) in swing(config, true) {
        assert!((measured - applied).abs() < 0.02, "{measured}, {applied} Nm");
    }
    let nominal = swing(config, false);
    assert!(nominal.iter().any(|(measured, applied)| (measured - applied).abs() > 0.5));
}

/// Sensors in the four hips of a standing robot: together they carry the weight of the base.
#[test]
fn quadruped_hips_carry_the_base_weight() {
    let text = r#"
name = "standing"
clock = "lockstep"
[safety]
safe_state = "hold"
[world]
ground = {}
"#;
    let idle = Source::new("idle", "dog/command", |_| None::<JointCommand>);
    let physics = Instance::of::<ArticulatedPhysics>("physics")
        .rate("1 kHz")
        .robot("dog")
        .subscribe("joint_command", "dog/command")
        .publish("joint_state", "dog/joints")
        .publish("base_state", "dog/base")
        .publish("contacts", "dog/contacts");
    let mut graph = Graph::from_toml(text).robot("dog", "quadruped").with(idle).with(physics);
    let legs = ["front_left", "front_right", "hind_left", "hind_right"];
    let probes: Vec<Probe<Wrench>> =
        legs.iter().map(|leg| Probe::for_topic(&format!("{leg}/wrench"))).collect();
    for (leg, probe) in legs.iter().zip(&probes) {
        let sensor = Instance::of::<ForceTorque>(leg)
            .trigger("dog/joints")
            .robot("dog")
            .subscribe("joint_state", "dog/joints")
            .subscribe("base_state", "dog/base")
            .subscribe("contacts", "dog/contacts")
            .publish("wrench", &format!("{leg}/wrench"))
            .set("config", table(&format!("link = \"{leg}_hip\"")));
        graph = graph.with(sensor).with(probe);
    }
    let report = graph.run("2 s").unwrap();
    // the hips rotate slightly about x: z of their frames points up
    let sum: f64 = probes.iter().map(|probe| probe.values().last().unwrap().force[2]).sum();
    let base = 1.161 * 9.81;
    assert!((sum + base).abs() < 0.02 * base, "{sum} N, {base} N: {:?}", report.results["physics"]);
}

#[test]
fn root_and_unknown_links_are_rejected() {
    for (config, expected) in [
        ("link = \"base\"", "`base` is the root"),
        ("link = \"rodd\"", "did you mean \"rod\"?"),
        ("link = \"rod\", force = { noise = -1.0 }", "force.noise`: -1, expected"),
        ("", "missing"),
    ] {
        let sensor = force_torque(config).robot("rod").subscribe("joint_state", "rod/state");
        let graph = Graph::new("loads").robot("rod", "pendulum").with(still(0.0)).with(sensor);
        let error = graph.check().unwrap_err().to_string();
        assert!(error.contains(expected), "{config}: {error}");
    }
}

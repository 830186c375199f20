//! Wrench sensors with payloads held by connections, and readings of slow sensors, against closed forms.

use std::path::Path;

use motorium::prelude::*;
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_physics::ArticulatedPhysics;
use motorium_robots::{Dynamics, load};
use motorium_sensors::component::force_torque::ForceTorque;
use motorium_sensors::component::joint_torque::JointTorque;
use nalgebra::Vector3;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn table(config: &str) -> toml::Value {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    config["config"].clone()
}

/// Returns the force read by a sensor at `link` of a robot at rest and the mass it carries, with 1.5 kg fixed
/// to `holder`.
fn held(robot: &str, link: &str, holder: &str) -> (f64, f64) {
    let home = Source::new("home", "r/command", {
        let loaded = load(robot, Path::new(".")).unwrap();
        let profile = loaded.profile.unwrap();
        let (pose, gains) = (profile.home(&loaded.model).unwrap(), profile.gains(&loaded.model).unwrap());
        move |_| {
            let mut command = JointCommand::default();
            command.set_count(pose.len());
            command.position_mut().copy_from_slice(pose.as_slice());
            command.kp_mut().copy_from_slice(gains.kp.as_slice());
            command.kd_mut().copy_from_slice(gains.kd.as_slice());
            Some(command)
        }
    });
    let config = format!(
        "connections = [{{ parts = [\"{holder}\", \"block\"], kind = \"fixed\" }}], world = {{ objects = [{{ name = \"block\", \
         shape = {{ box = {{ size = [0.05, 0.05, 0.05] }} }}, mass = 1.5, position = [0.3, 0.0, 1.5] }}] }}"
    );
    let physics = Instance::of::<ArticulatedPhysics>("physics")
        .rate("1 kHz")
        .robot("r")
        .subscribe("joint_command", "r/command")
        .publish("joint_state", "r/state")
        .publish("contact_impulses", "r/impulses")
        .set("config", table(&config));
    let sensor = Instance::of::<ForceTorque>("sensor")
        .trigger("r/state")
        .robot("r")
        .subscribe("joint_state", "r/state")
        .subscribe("contact_impulses", "r/impulses")
        .publish("wrench", "r/wrench")
        .set("config", table(&format!("link = \"{link}\"")));
    let probe = Probe::<Wrench>::for_topic("r/wrench");
    let graph = Graph::new("payload").robot("r", robot).with(home).with(physics).with(sensor).with(&probe);
    let report = graph.run("2 s").unwrap();
    let force = Vector3::from(probe.values().last().unwrap().force).norm();
    (force, report.results["sensor"]["carried_mass_kg"].as_f64().unwrap())
}

#[test]
fn payload_of_a_connection_is_weighed_by_the_wrist() {
    for (robot, link) in [("panda", "panda_hand"), ("ur5e", "tool0"), ("iiwa14", "iiwa_link_ee")] {
        let (force, own) = held(robot, link, link);
        let expected = (own + 1.5) * 9.81;
        assert!((force - expected).abs() < 0.05, "{robot}: {force} N, expected {expected}");
    }
}

#[test]
fn payload_above_the_sensor_is_not_weighed() {
    let (force, own) = held("panda", "panda_hand", "panda_link7");
    assert!((force - own * 9.81).abs() < 0.05, "{force} N, expected {}", own * 9.81);
}

/// Position, velocity and acceleration of a swinging joint.
fn swing(joint: usize, time: f64) -> [f64; 3] {
    let (rate, size) = (2.0 + 0.7 * joint as f64, 0.8 - 0.1 * joint as f64);
    let phase = rate * time + joint as f64;
    [size * phase.sin(), size * rate * phase.cos(), -size * rate * rate * phase.sin()]
}

/// Largest difference between readings and mean torques over each interval, for a sensor at `hertz`.
fn error(hertz: f64) -> f64 {
    let joints = Source::new("joints", "r/state", |tick| {
        let mut state = JointState::default();
        state.set_count(6);
        for joint in 0..6 {
            let [q, v, _] = swing(joint, tick.time());
            (state.position_mut()[joint], state.velocity_mut()[joint]) = (q, v);
        }
        Some(state)
    });
    let sensor = Instance::of::<JointTorque>("sensor")
        .rate(&format!("{hertz} Hz"))
        .robot("r")
        .subscribe("joint_state", "r/state")
        .publish("measured", "r/torque");
    let probe = Probe::<JointState>::for_topic("r/torque");
    let graph = Graph::new("torque").robot("r", "ur5e").with(joints).with(sensor).with(&probe);
    graph.run("1 s").unwrap();
    let model = load("ur5e", Path::new(".")).unwrap().model;
    let mut dynamics = Dynamics::new(&model);
    let mut torque = |time: f64| {
        let motion: Vec<_> = (0..6).map(|joint| swing(joint, time)).collect();
        let [q, v, a] = [0, 1, 2].map(|part| motion.iter().map(|m| m[part]).collect::<Vec<_>>());
        let mut tau = vec![0.0; 6];
        dynamics.rnea(&model, &q, &v, &a, GRAVITY, &mut tau);
        tau
    };
    let mut worst = 0.0_f64;
    // The first reading completes no interval.
    for sample in probe.samples().iter().skip(1) {
        let end = sample.stamp.source_time as f64 * 1e-9;
        let mut mean = [0.0; 6];
        for (share, weight) in [(0.0, 1.0), (0.25, 4.0), (0.5, 2.0), (0.75, 4.0), (1.0, 1.0)] {
            let tau = torque(end - share / hertz);
            mean.iter_mut().zip(&tau).for_each(|(mean, tau)| *mean += weight / 12.0 * tau);
        }
        for (found, mean) in sample.value.effort().iter().zip(mean) {
            worst = worst.max((found - mean).abs());
        }
    }
    worst
}

#[test]
fn joint_torque_is_second_order_in_its_sample_time() {
    let (slow, fast) = (error(50.0), error(100.0));
    assert!(fast < 0.03 && (3.5..4.5).contains(&(slow / fast)), "{slow} N m at 50 Hz, {fast} at 100 Hz");
}

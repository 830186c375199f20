//! Wrench sensors slower than the simulation, checked against the momentum of a ball that bounces on the
//! carried plate.

use motorium::prelude::*;
use motorium::state::ObjectPoses;
use motorium::testing::{Graph, Instance, Probe};
use motorium_physics::ArticulatedPhysics;
use motorium_sensors::component::force_torque::ForceTorque;

/// A fixed plate of 2 kg, 0.3 m from the origin, and a pointer that rotates next to it.
const PLATE: &str = r#"<robot name="plate">
  <link name="stand"/>
  <joint name="mounting" type="fixed"><parent link="stand"/><child link="plate"/><origin xyz="0.3 0 0.1"/></joint>
  <link name="plate">
    <inertial><mass value="2"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.05"/><geometry><box size="0.6 0.6 0.1"/></geometry></collision>
  </link>
  <joint name="turn" type="revolute">
    <parent link="stand"/><child link="pointer"/><origin xyz="2 0 0.5"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="10" velocity="10"/>
  </joint>
  <link name="pointer">
    <inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>"#;

/// The ball bounces several times within this time.
const WORLD: &str = r#"
name = "impacts"
clock = "lockstep"
[safety]
safe_state = "hold"
[world]
objects = [{ name = "ball", shape = { sphere = { radius = 0.05 } }, mass = 0.2, position = [0.4, 0.0, 0.45], restitution = 1.0 }]
"#;

/// Contact impulse upwards on the plate and its moment about y at the plate, from the sensor and from the
/// ball's momentum.
struct Sums {
    read: [f64; 2],
    ball: f64,
}

/// Runs a sensor at 50 Hz that reads contacts from this port of the 1 kHz physics.
fn sums(port: &str) -> Sums {
    let folder = std::env::temp_dir().join(format!("motorium-impacts-{port}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("plate.urdf"), PLATE).unwrap();
    let (readings, poses) =
        (Probe::<Wrench>::for_topic("wrench"), Probe::<ObjectPoses>::for_topic("objects"));
    let idle = motorium::testing::Source::new("idle", "command", |_| None::<JointCommand>);
    let physics = Instance::of::<ArticulatedPhysics>("physics")
        .rate("1 kHz")
        .robot("plate")
        .subscribe("joint_command", "command")
        .publish("joint_state", "state")
        .publish("object_poses", "objects")
        .publish(port, "touches");
    let sensor = Instance::of::<ForceTorque>("sensor")
        .rate("50 Hz")
        .robot("plate")
        .subscribe("joint_state", "state")
        .subscribe(port, "touches")
        .publish("wrench", "wrench")
        .set("config", toml::Value::Table("link = \"plate\"".parse().unwrap()));
    let graph = Graph::from_toml(WORLD.to_owned())
        .at_path(&folder.join("graph.toml"))
        .robot("plate", "plate.urdf")
        .with(idle)
        .with(physics)
        .with(sensor)
        .with(&readings)
        .with(&poses);
    let report = graph.run("1500 ms").unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let of_sensor = report.components.iter().find(|component| component.name == "sensor").unwrap();
    assert_eq!((of_sensor.allocations, of_sensor.errors), (Some(0), 0));
    let of_physics = report.components.iter().find(|component| component.name == "physics").unwrap();
    assert_eq!(of_physics.allocations, Some(0));

    let (readings, poses) = (readings.samples(), poses.samples());
    assert!(readings.len() > 60, "{}", readings.len());
    // Every impact is between two readings; the first reading completes the previous interval.
    let (first, last) = (&readings[0], &readings[readings.len() - 1]);
    let mut read = [0.0; 2];
    for pair in readings.windows(2) {
        let dt = (pair[1].stamp.source_time - pair[0].stamp.source_time) as f64 * 1e-9;
        assert!((dt - 0.02).abs() < 1e-9, "{dt}");
        let Wrench { force, torque } = pair[1].value;
        read[0] += dt * (force[2] - 2.0 * 9.81);
        read[1] += dt * torque[1];
    }
    // Ball velocity from its previous position, minus the fall in between.
    let velocity = |time: u64| {
        let at = poses.iter().position(|pose| pose.stamp.source_time == time).expect("a pose of that time");
        let height = |index: usize| poses[index].value.position_z()[0];
        (height(at) - height(at - 1)) / 1e-3
    };
    let (from, to) = (first.stamp.source_time, last.stamp.source_time);
    let time = (to - from) as f64 * 1e-9;
    Sums { read, ball: 0.2 * (velocity(to) - velocity(from) + 9.81 * time) }
}

#[test]
fn slow_sensor_readings_sum_to_the_impact_impulses() {
    let Sums { read: [impulse, moment], ball } = sums("contact_impulses");
    assert!(ball > 1.0, "the ball bounces: {ball} N s");
    assert!((impulse - ball).abs() < 2e-3, "{impulse}, {ball} N s");
    // the ball falls 0.1 m from the origin of the plate; the sensor supports the plate against the moment
    assert!((moment + 0.1 * ball).abs() < 1e-3, "{moment}, {ball}");
}

#[test]
fn instantaneous_contacts_miss_impact_impulses() {
    let Sums { read: [impulse, _], ball } = sums("contacts");
    assert!((impulse - ball).abs() > 0.1, "{impulse}, {ball} N s");
}

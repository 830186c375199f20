//! `sensor.contact` in a graph.

use motorium::state::{Contacts, FootContacts};
use motorium::testing::{Graph, Instance, Probe, Source};
use motorium_robots::load;
use motorium_sensors::component::contact::FootContactSensor;

fn link(name: &str) -> u32 {
    let model = load("quadruped", std::path::Path::new(".")).unwrap().model;
    model.frame(name).unwrap().index() as u32
}

fn run(config: &str, truth: impl Fn(u64, &mut Contacts) + Send + Sync + 'static) -> Vec<FootContacts> {
    let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
    let truth = Source::new("truth", "contacts", move |tick| {
        let mut contacts = Contacts::default();
        truth(tick.index, &mut contacts);
        Some(contacts)
    });
    let sensor = Instance::of::<FootContactSensor>("contact")
        .trigger("contacts")
        .robot("dog")
        .subscribe("contacts", "contacts")
        .publish("feet", "feet")
        .set("config", config["config"].clone());
    let probe = Probe::for_topic("feet");
    let graph = Graph::new("feet").robot("dog", "quadruped").with(truth).with(sensor).with(&probe);
    let report = graph.run("100 ms").unwrap();
    let sensor = report.components.iter().find(|component| component.name == "contact").unwrap();
    assert_eq!((sensor.allocations, sensor.errors), (Some(0), 0));
    probe.values()
}

#[test]
fn foot_force_sums_its_links_without_self_contact() {
    let (shank, thigh) = (link("front_left_shank"), link("front_left_thigh"));
    let readings = run("", move |_, contacts| {
        contacts.set_count(4);
        contacts.link_mut().copy_from_slice(&[shank, shank, shank, thigh]);
        // the ground, an object, another link of the robot, the ground
        contacts.other_mut().copy_from_slice(&[u32::MAX, 0, 65_536 + 3, u32::MAX]);
        contacts.force_x_mut().copy_from_slice(&[3.0, 0.0, 50.0, 50.0]);
        contacts.force_y_mut().fill(0.0);
        contacts.force_z_mut().copy_from_slice(&[1.0, 3.0, 50.0, 50.0]);
        contacts.position_x_mut().fill(0.0);
        contacts.position_y_mut().fill(0.0);
        contacts.position_z_mut().fill(0.0);
        contacts.depth_mut().fill(0.0);
    });
    assert!(readings.len() > 90);
    for feet in readings {
        assert_eq!(feet.count(), 4);
        // in alphabetical order: front_left, front_right, hind_left, hind_right
        assert_eq!((feet.contact(), feet.force()), (&[1, 0, 0, 0][..], &[5.0, 0.0, 0.0, 0.0][..]));
    }
}

#[test]
fn contact_ends_below_the_lower_threshold() {
    let shank = link("hind_right_shank");
    let readings = run("on = 10.0, off = 4.0", move |tick, contacts| {
        contacts.set_count(1);
        contacts.link_mut()[0] = shank;
        contacts.other_mut()[0] = u32::MAX;
        contacts.force_z_mut()[0] = tick.min(60_u64.saturating_sub(tick)) as f64;
    });
    let states: Vec<(f64, u32)> = readings.iter().map(|feet| (feet.force()[3], feet.contact()[3])).collect();
    for (tick, (force, contact)) in states.iter().enumerate() {
        let expected = if tick <= 30 { *force >= 10.0 } else { *force >= 4.0 };
        assert_eq!(*contact == 1, expected, "tick {tick}: {force} N");
    }
}

#[test]
fn robot_without_feet_is_rejected() {
    let sensor = Instance::of::<FootContactSensor>("contact")
        .rate("1 kHz")
        .robot("arm")
        .subscribe("contacts", "contacts")
        .publish("feet", "feet");
    let truth = Source::new("truth", "contacts", |_| Some(Contacts::default()));
    let error = Graph::new("feet").robot("arm", "panda").with(truth).with(sensor).check().unwrap_err();
    let message = error.to_string();
    assert!(message.contains("the robot has 0 feet, expected 1 to 16"), "{message}");
}

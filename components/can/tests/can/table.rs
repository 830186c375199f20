//! Drive table: accepted tables, and error messages.

use motorium_can::{Budget, Table};

const BUS: &str = "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n";

fn drive(joint: &str, node: u8, more: &str) -> String {
    let ranges = "{ position = 12.5, velocity = 30.0, torque = 10.0 }";
    format!(
        "[[drive]]\njoint = \"{joint}\"\nbus = \"can0\"\nprotocol = \"damiao\"\nnode = {node}\nwatchdog = \"20 ms\"\n\
         ranges = {ranges}\n{more}\n"
    )
}

fn refused(text: &str) -> (Option<usize>, String) {
    let error = Table::parse(text).unwrap_err();
    (error.line, error.message)
}

#[test]
fn positions_convert_through_the_transmission() {
    let table = format!("{BUS}{}", drive("a", 1, "ratio = 4.0\nreversed = true\noffset = 0.5"));
    let gear = Table::parse(&table).unwrap().transmission(0);
    assert_eq!((gear.to_drive(1.5), gear.to_joint(-4.0)), (-4.0, 1.5));
}

#[test]
fn mistakes_are_reported_with_their_line() {
    let missing = "[[drive]]\njoint = \"a\"\n";
    assert_eq!(refused(&format!("{BUS}{missing}")).0, Some(4));
    let twice = format!("{BUS}{}{}", drive("a", 1, ""), drive("b", 1, ""));
    assert_eq!(refused(&twice), (Some(12), "drive of `b`: node 1 is used twice on the bus".into()));
    let nowhere = format!("{BUS}{}", drive("a", 1, "").replace("can0", "can7"));
    assert_eq!(refused(&nowhere).1, "drive of `a`: no bus is named `can7`");
    let named = format!("{}{}", BUS.replace("can0", "can 0"), drive("a", 1, ""));
    assert_eq!(refused(&named), (Some(1), "the bus name \"can 0\" is invalid".into()));
    let gains = format!("{BUS}{}", drive("a", 1, "").replace("torque = 10.0", "torque = 10.0, kp = 900.0"));
    assert_eq!(refused(&gains).1, "drive of `a`: the gains of a Damiao drive are limited to 500 and 5");
    let key = format!("{BUS}{}", drive("a", 1, "torqe = 2"));
    assert!(refused(&key).1.contains("torqe"));
}

#[test]
fn joints_and_drives_must_match_one_to_one() {
    let table = Table::parse(&format!("{BUS}{}", drive("a", 1, ""))).unwrap();
    assert_eq!(table.of_joints(&["a".into()]), Ok(vec![0]));
    let missing = table.of_joints(&["a".into(), "b".into()]).unwrap_err();
    assert_eq!(missing.message, "joint `b` has no drive");
    assert!(table.of_joints(&["b".into()]).unwrap_err().message.contains("no joint `a`"));
}

#[test]
fn an_unknown_joint_is_reported_with_its_position() {
    let text = format!("{BUS}{}{}", drive("a", 1, ""), drive("ä", 2, "").replace("joint =", "  joint  ="));
    let error = Table::parse(&text).unwrap().of_joints(&["a".into()]).unwrap_err();
    assert_eq!((error.line, error.column, error.entry), (Some(13), Some(12), Some(("drive", 1))));
    assert_eq!(error.to_string(), "line 13, column 12: the robot has no joint `ä`; its joints are a");
}

#[test]
fn the_budget_matches_the_published_table() {
    for (rate, joints) in [(1000, 2), (500, 5), (250, 11), (100, 29)] {
        let drives: String = (1..=joints.min(15)).map(|node| drive(&format!("j{node}"), node, "")).collect();
        let budget = Table::parse(&format!("{BUS}{drives}")).unwrap().budget(0, 1_000_000_000 / rate);
        let exchange = budget.exchanges[0];
        let share = |count: usize| Budget { exchanges: vec![exchange; count], ..budget.clone() }.share();
        assert!(
            share(joints.into()) <= Budget::COMFORTABLE
                && share(usize::from(joints) + 1) > Budget::COMFORTABLE
        );
    }
}

#[test]
fn the_budget_displays_its_arithmetic() {
    let text: String = (1..=4).map(|node| drive(&format!("j{node}"), node, "")).collect();
    let budget = Table::parse(&format!("{BUS}{text}")).unwrap().budget(0, 1_000_000);
    assert!(!budget.fits());
    assert_eq!(
        budget.to_string(),
        "4 x (135 + 135 bits) with maximum stuffing = 1080 us at 1000 kbit/s, + 100 us turnaround = 1180 us of 1000 us \
         (108 % load)"
    );
    assert_eq!(budget.most(), 3);
}

#[test]
fn the_budget_counts_additional_frames_of_a_drive() {
    let others = |protocol: &str, more: &str| {
        let drive = drive("a", 1, more).replace("damiao", protocol);
        Table::parse(&format!("{BUS}{drive}")).unwrap().budget(0, 1_000_000).others.len()
    };
    // torques, heartbeat, temperatures
    assert_eq!(others("odrive", ""), 3);
    let cia402 = "increments = 65536.0\nrated_torque = 5.0\ncurrent_limit = 2.0\nrated_current = 4.0";
    let homing =
        "homing = { by = \"drive\", method = 17, velocity = 0.6, creep_velocity = 0.1, acceleration = 2.0 }";
    // second process data, synchronisation, and the adapter's heartbeat; also service data while the drive
    // homes itself
    assert_eq!(others("cia402", cia402), 3);
    assert_eq!(others("cia402", &format!("{cia402}\n{homing}")), 5);
    let at_stop =
        "mode = \"torque\"\nhoming = { by = \"stop\", velocity = 0.5, effort = 1.0, position = 1.0 }";
    assert_eq!(others("cia402", &format!("{cia402}\n{at_stop}")), 3);
}

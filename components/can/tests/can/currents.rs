//! The largest current of a drive: set in it before it is enabled, checked by its own unit, and a bound of every torque.

use motorium_can::Table;
use motorium_can::adapter::{Setpoint, WrongSetting};

use super::drives::{Case, Rig, follow};

const ODRIVE: &str = "report_every = \"2 ms\"";
const CIA402: &str = "increments = 65536.0\nrated_torque = 5.0";

/// The torque with which a drive moves towards a goal far away, whose keys are these.
fn torque(protocol: &'static str, more: String) -> f64 {
    let more: &'static str = more.leak();
    let mut rig = Rig::healthy(&Case { protocol, bus: "", more, cycle_ns: 2_000_000 });
    rig.adapter.set(0, Setpoint { position: 2.0, kp: 4.0, kd: 0.1, ..Setpoint::default() });
    rig.run(20);
    rig.torques[0]
}

#[test]
fn a_drive_gives_no_more_torque_than_its_limit_of_current_whatever_its_loop_wants() {
    // without a limit its loop has all 10 N m; 20 A of 0.1 N m/A, and 1.6 A of 4 A for 5 N m, are 2 N m
    assert_eq!(torque("odrive", ODRIVE.into()), 10.0);
    let limited = torque("odrive", format!("{ODRIVE}\ncurrent_limit = 20.0\ntorque_constant = 0.1"));
    assert!((limited - 2.0).abs() < 1e-6, "{limited}");
    assert_eq!(torque("cia402", CIA402.into()), 10.0);
    let limited = torque("cia402", format!("{CIA402}\ncurrent_limit = 1.6\nrated_current = 4.0"));
    assert!((limited - 2.0).abs() < 1e-6, "{limited}");
}

fn table(protocol: &str, more: &str) -> Result<Table, String> {
    let text = format!(
        "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"{protocol}\"\nnode = 5\n\
         watchdog = \"20 ms\"\nranges = {{ position = 3.0, velocity = 30.0, torque = 10.0 }}\n{more}\n"
    );
    Table::parse(&text).map_err(|error| error.to_string())
}

#[test]
fn the_torque_of_a_limited_current_is_the_end_of_the_range_of_efforts() {
    let torque = |more: &str| table("odrive", more).unwrap().ranges(0).torque.max;
    assert_eq!(torque(""), 10.0);
    assert!((torque("current_limit = 20.0\ntorque_constant = 0.1") - 2.0).abs() < 1e-12);
    assert_eq!(torque("current_limit = 200.0\ntorque_constant = 0.1"), 10.0, "no more than it reaches");
}

#[test]
fn a_drive_of_another_rated_current_is_not_enabled() {
    let rated = |current: f64| {
        let keys = format!("{CIA402}\ncurrent_limit = 1.6\nrated_current = {current:?}");
        table("cia402", &keys).unwrap()
    };
    assert_eq!(follow(&rated(4.0), None), (true, None));
    let wrong = WrongSetting::RatedCurrent { found: 5.0, expected: 4.0 };
    assert_eq!(follow(&rated(4.0), Some(&rated(5.0))), (false, Some(wrong)));
    assert_eq!(wrong.to_string(), "its rated current is 5 A, the table says 4");
}

#[test]
fn a_limit_of_current_that_cannot_be_is_refused_with_what_is_missing() {
    for (protocol, more, words) in [
        ("odrive", "current_limit = 20.0", "`current_limit` without `torque_constant`"),
        ("odrive", "current_limit = -1.0\ntorque_constant = 0.1", "`current_limit` is -1"),
        ("odrive", "rated_current = 3.0", "`rated_current`, which is a key of CiA 402"),
        ("damiao", "current_limit = 20.0", "`current_limit`, which is a key of ODrive and CiA 402"),
        (
            "cia402",
            "increments = 4096.0\nrated_torque = 5.0\ncurrent_limit = 2.0",
            "`current_limit` without `rated_current`",
        ),
        (
            "cia402",
            "increments = 4096.0\nrated_torque = 5.0\ncurrent_limit = 2000.0\nrated_current = 3.0",
            "a current of 2000 A, which is more than 65 times the rated 3 A",
        ),
    ] {
        let found = table(protocol, more).unwrap_err();
        assert!(found.contains(words), "{more}: {found}");
    }
}

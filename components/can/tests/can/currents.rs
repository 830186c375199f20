//! Current limit of a drive: it is set before the drive is enabled, converted to the drive's unit, and bounds
//! every torque.

use motorium_can::Table;
use motorium_can::adapter::WrongSetting;
use motorium_can::drive::Fault;
use motorium_drive::JointSetpoint;

use super::drives::{Case, Rig, follow};

const ODRIVE: &str = "report_every = \"2 ms\"";
const CIA402: &str = "increments = 65536.0\nrated_torque = 5.0";

const DAMIAO: &str = "current_limit = 6.0\nfull_current = 30.0\ntorque_constant = 0.5";
const FEETECH: &str = "current_limit = 0.6\nfull_current = 2.4";
const DYNAMIXEL: &str = "current_limit = 1.0\ncurrent_unit = 0.00269\ntorque_constant = 2.0";

/// Torque with which a drive with these keys moves towards a distant goal.
fn torque(protocol: &'static str, more: String) -> f64 {
    let more: &'static str = more.leak();
    let is_servo = matches!(protocol, "feetech" | "dynamixel");
    let (bus, cycle_ns) = if is_servo { ("kind = \"serial\"", 5_000_000) } else { ("", 2_000_000) };
    let mut rig = Rig::healthy(&Case { protocol, bus, more, cycle_ns });
    rig.adapter.set(0, JointSetpoint { position: 2.0, kp: 4.0, kd: 0.1, ..JointSetpoint::default() });
    rig.run(20);
    rig.torques[0]
}

#[test]
fn a_drive_keeps_its_current_limit() {
    // without a limit, the loop applies the full 10 N m; 20 A at 0.1 N m/A, and 1.6 A of 4 A for 5 N m, are 2
    // N m
    assert_eq!(torque("odrive", ODRIVE.into()), 10.0);
    let limited = torque("odrive", format!("{ODRIVE}\ncurrent_limit = 20.0\ntorque_constant = 0.1"));
    assert!((limited - 2.0).abs() < 1e-6, "{limited}");
    assert_eq!(torque("cia402", CIA402.into()), 10.0);
    let limited = torque("cia402", format!("{CIA402}\ncurrent_limit = 1.6\nrated_current = 4.0"));
    assert!((limited - 2.0).abs() < 1e-6, "{limited}");
    // a quarter of the stall current is a quarter of 10 N m; 371 units of 2.69 mA and 2 N m/A are 1.996 N m
    assert_eq!(torque("feetech", String::new()), 10.0);
    let limited = torque("feetech", FEETECH.into());
    assert!((limited - 2.5).abs() < 1e-6, "{limited}");
    assert_eq!(torque("dynamixel", String::new()), 10.0);
    let limited = torque("dynamixel", DYNAMIXEL.into());
    assert!((limited - 371.0 * 0.00269 * 2.0).abs() < 1e-6, "{limited}");
}

#[test]
fn a_damiao_drive_disables_itself_at_its_current_limit() {
    let follow = |position: f64| {
        let mut rig = Rig::healthy(&Case { protocol: "damiao", bus: "", more: DAMIAO, cycle_ns: 1_000_000 });
        rig.adapter.set(0, JointSetpoint { position, kp: 20.0, kd: 0.1, ..JointSetpoint::default() });
        rig.run(20);
        (rig.torques[0], rig.adapter.links()[0].fault(), rig.adapter.has_tripped())
    };
    // 6 A at 0.5 N m/A are 3 N m; the loop applies 2 N m at 0.1 rad, and 4 N m at 0.2 rad
    let (torque, fault, tripped) = follow(0.6);
    assert!((torque - 2.0).abs() < 0.05 && fault.is_none() && !tripped, "{torque} {fault:?}");
    assert_eq!(follow(0.7), (0.0, Some(Fault::OverCurrent), true));
}

#[test]
fn a_servo_reports_effort_by_current_or_load() {
    for (protocol, more) in [("feetech", FEETECH), ("dynamixel", DYNAMIXEL)] {
        let case = Case { protocol, bus: "kind = \"serial\"", more, cycle_ns: 5_000_000 };
        let mut rig = Rig::healthy(&case);
        rig.adapter.set(0, JointSetpoint { position: 2.0, kp: 4.0, ..JointSetpoint::default() });
        rig.run(20);
        let (effort, torque) = (rig.adapter.links()[0].state().2, rig.torques[0]);
        assert!((effort - torque).abs() < 0.011, "{protocol}: {effort} {torque}");
    }
}

#[test]
fn a_servo_that_does_not_limit_its_current_is_not_enabled() {
    let table = |unit: &str| {
        let text = format!(
            "[[bus]]\nname = \"line\"\nkind = \"serial\"\nbitrate = 1_000_000\n\n[[drive]]\njoint = \"a\"\nbus = \"line\"\n\
             protocol = \"dynamixel\"\nnode = 5\nwatchdog = \"20 ms\"\nranges = {{ position = 3.0, velocity = 30.0, torque = 10.0 }}\n\
             {unit}\n"
        );
        Table::parse(&text).unwrap()
    };
    let limited = "current_limit = 1.0\ncurrent_unit = 0.001\ntorque_constant = 1.0";
    assert_eq!(follow(&table(limited), None), (true, None));
    // a servo in the position mode has no current limit
    let wrong = WrongSetting::OperatingMode { found: 3, expected: 5 };
    assert_eq!(follow(&table(limited), Some(&table(""))), (false, Some(wrong)));
}

#[test]
fn damiao_ranges_do_not_depend_on_the_current_limit() {
    let limited = table("damiao", DAMIAO).unwrap();
    assert_eq!(limited.ranges(0).torque.max, 3.0);
    assert_eq!(limited.drive(0).unwrap().ranges().torque.max, 10.0);
    assert_eq!(follow(&limited, None), (true, None));
}

fn table(protocol: &str, more: &str) -> Result<Table, String> {
    let text = format!(
        "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n\n[[drive]]\njoint = \"a\"\nbus = \"can0\"\nprotocol = \"{protocol}\"\nnode = 5\n\
         watchdog = \"20 ms\"\nranges = {{ position = 3.0, velocity = 30.0, torque = 10.0 }}\n{more}\n"
    );
    Table::parse(&text).map_err(|error| error.to_string())
}

#[test]
fn a_current_limit_bounds_the_effort_range() {
    let torque = |more: &str| table("odrive", more).unwrap().ranges(0).torque.max;
    assert_eq!(torque(""), 10.0);
    assert!((torque("current_limit = 20.0\ntorque_constant = 0.1") - 2.0).abs() < 1e-12);
    assert_eq!(
        torque("current_limit = 200.0\ntorque_constant = 0.1"),
        10.0,
        "no more than the drive reaches"
    );
}

#[test]
fn a_drive_with_another_rated_current_is_not_enabled() {
    let rated = |current: f64| {
        let keys = format!("{CIA402}\ncurrent_limit = 1.6\nrated_current = {current:?}");
        table("cia402", &keys).unwrap()
    };
    assert_eq!(follow(&rated(4.0), None), (true, None));
    let wrong = WrongSetting::RatedCurrent { found: 5.0, expected: 4.0 };
    assert_eq!(follow(&rated(4.0), Some(&rated(5.0))), (false, Some(wrong)));
    assert_eq!(wrong.to_string(), "the rated current is 5 A, but the drive table has 4 A");
}

#[test]
fn an_impossible_current_limit_is_refused() {
    for (protocol, more, words) in [
        ("odrive", "current_limit = 20.0", "`current_limit` requires `torque_constant`"),
        ("odrive", "current_limit = -1.0\ntorque_constant = 0.1", "`current_limit` is -1"),
        ("odrive", "rated_current = 3.0", "`rated_current` is only a key of CiA 402"),
        ("damiao", "current_limit = 20.0", "`current_limit` requires `torque_constant`"),
        ("damiao", "current_limit = 20.0\ntorque_constant = 1.0", "`current_limit` requires `full_current`"),
        (
            "damiao",
            "current_limit = 20.0\ntorque_constant = 1.0\nfull_current = 20.0",
            "the current limit of 20 A is not below `full_current`",
        ),
        ("odrive", "full_current = 20.0", "`full_current` is only a key of Damiao and Feetech"),
        ("odrive", "current_unit = 0.001", "`current_unit` is only a key of Dynamixel"),
        ("mini_cheetah", "current_limit = 20.0", "`current_limit` is not supported by MiniCheetah"),
        ("cubemars", "current_limit = 20.0", "`current_limit` is not supported by Cubemars"),
        ("robstride", "current_limit = 20.0", "`current_limit` is not supported by Robstride"),
        (
            "cia402",
            "increments = 4096.0\nrated_torque = 5.0\ncurrent_limit = 2.0",
            "`current_limit` requires `rated_current`",
        ),
        (
            "cia402",
            "increments = 4096.0\nrated_torque = 5.0\ncurrent_limit = 2000.0\nrated_current = 3.0",
            "the current limit is 2000 A, more than 65 times the rated current of 3 A",
        ),
    ] {
        let found = table(protocol, more).unwrap_err();
        assert!(found.contains(words), "{more}: {found}");
    }
}

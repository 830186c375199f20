//! Homing in drive tables and in servos: invalid entries are refused with an explanation.

use motorium_can::Table;
use motorium_can::adapter::WrongSetting;

use super::drives::follow;
use super::homing::CIA402;

fn refused(drive: &str, homing: &str) -> String {
    let (kind, data) = if drive.contains("feetech") || drive.contains("dynamixel") {
        ("kind = \"serial\"", "")
    } else {
        ("", "data_bitrate = 5_000_000")
    };
    let watchdog = if drive.contains("feetech") { "0 s" } else { "40 ms" };
    let text = format!(
        "[[bus]]\nname = \"bus\"\nbitrate = 1_000_000\n{kind}\n{data}\n[[drive]]\njoint = \"a\"\nbus = \"bus\"\nnode = 1\n\
         watchdog = \"{watchdog}\"\nranges = {{ position = 3.14, velocity = 30.0, torque = 8.0 }}\n{drive}\nhoming = {{ {homing} }}\n"
    );
    Table::parse(&text).expect_err(&format!("{drive} {homing}")).to_string()
}

#[test]
fn an_impossible_homing_is_refused() {
    let own = "by = \"drive\", method = 17, velocity = 0.6, creep_velocity = 0.1, acceleration = 2.0";
    let stop = "by = \"stop\", velocity = -0.5, effort = 1.2, position = -0.8";
    for (drive, homing, words) in [
        ("protocol = \"damiao\"", "by = \"drive\"", "a homing by the drive is not supported by Damiao"),
        ("protocol = \"moteus\"", "by = \"drive\"", "a homing by the drive is not supported by moteus"),
        ("protocol = \"odrive\"", "by = \"drive\"", "a homing by the drive requires `current_limit`"),
        (
            "protocol = \"cia402\"\nincrements = 65536.0\nrated_torque = 8.0",
            own,
            "a homing by the drive requires `current_limit`",
        ),
        (
            "protocol = \"odrive\"",
            stop,
            "a drive that follows positions or velocities cannot be homed at the stop",
        ),
        (CIA402, stop, "a drive that follows positions or velocities cannot be homed at the stop"),
        (
            CIA402,
            "by = \"drive\", velocity = 0.6, creep_velocity = 0.1, acceleration = 2.0",
            "requires `method`",
        ),
        (CIA402, &own.replace("17", "31"), "`homing.method` is 31, which CiA 402 does not define"),
        (
            CIA402,
            &own.replace("0.1", "0.00001"),
            "`homing.creep_velocity` is 0.00001, 0.104 increments of the drive",
        ),
        (CIA402, &own.replace("2.0", "-2.0"), "`homing.acceleration` is -2"),
        (
            CIA402,
            &format!("{own}, steps = 4"),
            "`homing.steps` is not a key of `by = \"drive\"` for Cia402 drives",
        ),
        (
            "protocol = \"feetech\"",
            "by = \"drive\", steps = 2048",
            "`homing.steps` is 2048, expected -2047 to 2047",
        ),
        ("protocol = \"feetech\"", "by = \"drive\", steps = 4, order = 1", "`homing.order` is not a key"),
        ("protocol = \"dynamixel\"", "by = \"drive\"", "a homing by the drive requires `steps`"),
        (
            "protocol = \"damiao\"",
            "by = \"stop\", velocity = 0.0, effort = 1.0, position = 1.0",
            "`velocity` 0",
        ),
        (
            "protocol = \"damiao\"",
            &stop.replace("-0.8", "nan"),
            "invalid homing: `velocity` -0.5, `effort` 1.2, `position` NaN",
        ),
        (
            "protocol = \"damiao\"",
            "by = \"stop\", velocity = 0.1, effort = 1.0",
            "a homing by the stop requires `position`",
        ),
        (
            "protocol = \"damiao\"",
            &stop.replace("1.2", "9.0"),
            "9.000 N m at the output shaft, beyond the range",
        ),
        (
            "protocol = \"damiao\"",
            &stop.replace("-0.5", "-0.1"),
            "a velocity gain of 12.000 N m s/rad, but the drive is limited to 5",
        ),
        ("protocol = \"damiao\"", &format!("{stop}, timeout = \"0 s\""), "`homing.timeout` is 0"),
    ] {
        let found = refused(drive, homing);
        assert!(found.contains(words), "{drive} {homing}: {found}");
    }
}

#[test]
fn a_servo_with_another_homing_offset_is_not_enabled() {
    let table = |protocol: &str, steps: i32| {
        let watchdog = if protocol == "feetech" { "0 s" } else { "40 ms" };
        let text = format!(
            "[[bus]]\nname = \"line\"\nkind = \"serial\"\nbitrate = 1_000_000\n[[drive]]\njoint = \"a\"\nbus = \"line\"\nnode = 1\n\
             watchdog = \"{watchdog}\"\nranges = {{ position = 3.0, velocity = 5.0, torque = 2.0 }}\nprotocol = \"{protocol}\"\n\
             homing = {{ by = \"drive\", steps = {steps} }}\n"
        );
        Table::parse(&text).unwrap()
    };
    for protocol in ["feetech", "dynamixel"] {
        assert_eq!(follow(&table(protocol, -1234), None), (true, None), "{protocol}");
        let wrong = WrongSetting::HomingOffset { found: -1234, expected: 56 };
        assert_eq!(
            follow(&table(protocol, 56), Some(&table(protocol, -1234))),
            (false, Some(wrong)),
            "{protocol}"
        );
    }
}

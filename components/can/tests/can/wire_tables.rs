//! Drive tables that do not work on the wire: frames that a drive does not support, identifiers shared by two
//! drives, numbers beyond their fields.

use motorium_can::adapter::{Adapter, OnTrip};
use motorium_can::cia402::{Mapping, Mode, NetworkCommand, Node, Service};
use motorium_can::{AnySimulatedDrive, Form, Frame, Overrides, Table};

const FD: &str = "data_bitrate = 5_000_000";
const CIA402: &str = "increments = 65536.0\nrated_torque = 5.0";

/// Table of drives on one bus, each with its protocol, number and additional keys.
fn table(bus: &str, drives: &[(&str, u8, &str)]) -> Result<Table, String> {
    let mut text = format!("[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\n{bus}\n");
    for (protocol, node, more) in drives {
        text += &format!(
            "[[drive]]\njoint = \"{protocol}{node}\"\nbus = \"can0\"\nprotocol = \"{protocol}\"\nnode = {node}\n{more}\n"
        );
        for (key, value) in
            [("watchdog", "\"20 ms\""), ("ranges", "{ position = 12.5, velocity = 30.0, torque = 10.0 }")]
        {
            if !more.contains(key) {
                text += &format!("{key} = {value}\n");
            }
        }
    }
    Table::parse(&text).map_err(|error| error.message)
}

fn refused(bus: &str, drives: &[(&str, u8, &str)]) -> String {
    table(bus, drives).map(|_| ()).unwrap_err()
}

#[test]
fn classic_drives_get_classic_frames_on_a_can_fd_bus() {
    for protocol in ["mini_cheetah", "mini_cheetah_voltage", "cubemars", "robstride"] {
        let form = |bus| table(bus, &[(protocol, 1, "")]).unwrap().drive(0).unwrap().form;
        assert_eq!([form(""), form(FD)], [Form::Classic; 2], "{protocol}");
    }
    let form = |bus| table(bus, &[("damiao", 1, "")]).unwrap().drive(0).unwrap().form;
    assert_eq!([form(""), form(FD)], [Form::Classic, Form::FdFast]);
}

#[test]
fn a_classic_only_drive_is_refused_next_to_can_fd() {
    for (fast, name) in [("damiao", "Damiao"), ("moteus", "Moteus")] {
        let text = refused(FD, &[(fast, 1, ""), ("mini_cheetah", 2, "")]);
        let words =
            format!("drives of {name} receive CAN FD frames, but a drive of MiniCheetah does not support");
        assert!(text.contains(&words), "{text}");
    }
    assert!(table("", &[("damiao", 1, ""), ("mini_cheetah", 2, "")]).is_ok());
    assert!(table(FD, &[("damiao", 1, ""), ("moteus", 2, "")]).is_ok());
}

#[test]
fn answers_that_collide_with_commands_are_refused() {
    let text = refused("", &[("damiao", 1, "master = 2"), ("damiao", 2, "")]);
    assert_eq!(text, "drive of `damiao1`: the answers have the identifier 0x002, like commands to `damiao2`");
    // the default of a Damiao drive
    let text = refused("", &[("mini_cheetah", 17, ""), ("damiao", 1, "")]);
    assert_eq!(
        text,
        "drive of `damiao1`: the answers have the identifier 0x011, like commands to `mini_cheetah17`"
    );
    assert!(
        refused("", &[("damiao", 1, "master = 1")])
            .contains("the identifier of the answers is already in use")
    );
    assert!(refused("", &[("damiao", 1, "master = 0x7ff")]).contains("the answers have the identifier"));
}

#[test]
fn colliding_answers_are_refused_or_name_their_drive() {
    let text = refused("", &[("damiao", 1, "master = 0"), ("mini_cheetah", 2, "")]);
    assert!(
        text.contains(
            "the answers have the identifier 0x000, like the answers of `mini_cheetah2`, a drive of MiniCheetah"
        ),
        "{text}"
    );
    let text = refused(FD, &[("damiao", 1, "master = 0x200"), ("moteus", 2, "")]);
    assert!(text.contains("0x200, like the answers of `moteus2`"), "{text}");
    assert!(table("", &[("damiao", 1, "master = 0"), ("damiao", 2, "master = 0")]).is_ok());
    assert!(table("", &[("mini_cheetah", 1, ""), ("mini_cheetah", 2, "")]).is_ok());
}

#[test]
fn ranges_beyond_the_protocol_are_refused() {
    let ranges = |position: f64, velocity: f64, torque: f64| {
        format!("ranges = {{ position = {position:?}, velocity = {velocity:?}, torque = {torque:?} }}")
    };
    let cia402 = |more: &str, ranges: String| format!("{CIA402}\n{more}\n{ranges}");
    let rows = [
        (
            "odrive",
            ranges(12.5, 206.0, 10.0),
            "the velocity is 206 rad/s, but the field of its feed-forward is limited to 205.88",
        ),
        (
            "odrive",
            ranges(12.5, 30.0, 33.0),
            "the torque is 33 N m, but the field of its feed-forward is limited to 32.77",
        ),
        (
            "cia402",
            cia402("", ranges(206_000.0, 30.0, 10.0)),
            "the position is 206000 rad, but its field of 32 bits is limited to 205887",
        ),
        ("cia402", cia402("", ranges(12.5, 206_000.0, 10.0)), "the velocity is 206000 rad/s"),
        (
            "cia402",
            cia402("mode = \"torque\"", ranges(12.5, 30.0, 164.0)),
            "the torque is 164 N m, but object 0x6071",
        ),
    ];
    for (protocol, more, words) in rows {
        let text = refused("", &[(protocol, 1, &more)]);
        assert!(text.contains(words), "{text}");
    }
    let within = [
        ("odrive", ranges(12.5, 205.8, 32.7)),
        ("odrive", format!("mode = \"torque\"\n{}", ranges(12.5, 300.0, 40.0))),
        ("cia402", cia402("", ranges(12.5, 30.0, 200.0))),
        ("cia402", cia402("mode = \"torque\"", ranges(12.5, 30.0, 163.0))),
    ];
    for (protocol, more) in within {
        assert_eq!(table("", &[(protocol, 1, &more)]).map(|_| ()), Ok(()), "{protocol} {more}");
    }
}

#[test]
fn an_unreachable_watchdog_is_refused_in_the_table() {
    let watchdog = |time: &str| format!("watchdog = \"{time}\"");
    for (protocol, more, bad, good) in [
        ("damiao", "", ["20.01 ms", "30 us"], ["20.05 ms", "0 s"]),
        ("moteus", "", ["20.4 ms", "33 s"], ["32 s", "0 s"]),
        ("cia402", CIA402, ["20.5 ms", "66 s"], ["65 s", "0 s"]),
    ] {
        for time in bad {
            let text = refused(FD, &[(protocol, 1, &format!("{more}\n{}", watchdog(time)))]);
            assert!(text.contains("the watchdog is "), "{protocol} {time}: {text}");
        }
        for time in good {
            let read = table(FD, &[(protocol, 1, &format!("{more}\n{}", watchdog(time)))]);
            assert_eq!(read.map(|_| ()), Ok(()), "{protocol} {time}");
        }
    }
}

#[test]
fn moteus_command_gains_are_limited_to_stored_gains() {
    let gains = |more: &str| {
        let ranges = table(FD, &[("moteus", 1, more)]).unwrap().ranges(0);
        [ranges.kp.max, ranges.kd.max]
    };
    assert_eq!(gains("position_loop = { kp = 40.0, kd = 0.5 }"), [40.0, 0.5]);
    assert_eq!(gains("position_loop = { kp = 40.0, kd = 0.0 }"), [40.0, 0.0]);
    // full torque at 0.05 rad
    assert_eq!(gains(""), [200.0, 5.0]);
}

#[test]
fn process_data_are_stopped_before_mapping() {
    let table = table("", &[("cia402", 5, CIA402)]).unwrap();
    let (node, mut frames) = (Node::new(5).unwrap(), Vec::new());
    Adapter::new(&table, &[0], &[0.3], OnTrip::Damp).write(0, &mut frames);
    let steps: Vec<Service> =
        (0..Mapping::STEPS).map(|step| Mapping::Setpoint.step(node, Mode::Position, step)).collect();
    assert_eq!(frames, [node.network(NetworkCommand::PreOperational), node.service(&steps[0])]);

    let mut drive = AnySimulatedDrive::new(&table, 0, Overrides::default());
    let mut answers = |frame: &Frame| {
        let mut answers = Vec::new();
        drive.receive(frame, 0, &mut |answer| answers.push(answer));
        answers
    };
    // state left behind by a previous adapter
    answers(&node.network(NetworkCommand::Start));
    let refused = node.service_answer(&steps[2], Err(0x0800_0022));
    assert_eq!(answers(&node.service(&steps[2])), [refused]);
    answers(&frames[0]);
    assert_eq!(
        answers(&node.service(&steps[2])),
        [node.service_answer(&steps[2], Ok(motorium_can::cia402::Value::byte(0)))]
    );
}

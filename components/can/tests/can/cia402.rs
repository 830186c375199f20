//! CANopen and CiA 402, compared with the published frame formats.

use motorium_can::cia402::{
    DriveState, Mode, NetworkCommand, NetworkState, Node, Object, Process, Service, Setpoint, Value, sync,
};
use motorium_can::{DecodeError, Frame, Id};
use proptest::prelude::*;

fn node() -> Node {
    Node::new(5).unwrap()
}

fn hex(frame: Frame) -> String {
    format!("{frame:?}")
}

#[test]
fn canopen_management_frames_match_the_standard() {
    assert_eq!(hex(node().network(NetworkCommand::Start)), "0x000#0105");
    assert_eq!(hex(node().network(NetworkCommand::PreOperational)), "0x000#8005");
    assert_eq!(hex(sync()), "0x080#");
    let beat = Frame::classic(Id::Standard(0x705), &[5]);
    assert_eq!(node().heartbeat(&beat), Ok(NetworkState::Operational));
    // 0 addresses all nodes
    let all = Frame::classic(Id::Standard(0), &[2, 0]);
    assert_eq!(node().network_command(&all), Ok(NetworkCommand::Stop));
}

#[test]
fn an_expedited_service_encodes_its_length() {
    let write = |value| hex(node().service(&Service::Write(Object::HEARTBEAT_PRODUCER, value)));
    assert_eq!(write(Value::byte(1)), "0x605#2F17100001000000");
    assert_eq!(write(Value::word(100)), "0x605#2B17100064000000");
    assert_eq!(write(Value::long(7)), "0x605#2317100007000000");
    assert_eq!(hex(node().service(&Service::Read(Object::STATUSWORD))), "0x605#4041600000000000");
}

#[test]
fn a_service_is_answered_with_a_value_or_an_abort_code() {
    let read = Service::Read(Object::MODE);
    let answer = Frame::classic(Id::Standard(0x585), &[0x4f, 0x60, 0x60, 0, 8, 0, 0, 0]);
    assert_eq!(node().service_result(&read, &answer), Ok(Some(Value::byte(8))));
    let refused = Frame::classic(Id::Standard(0x585), &[0x80, 0x60, 0x60, 0, 0, 0, 2, 6]);
    let expected = Err(DecodeError::Refused { code: 0x0602_0000 });
    assert_eq!(node().service_result(&read, &refused), expected);
    let elsewhere = node().service_result(&Service::Read(Object::STATUSWORD), &answer);
    assert_eq!(elsewhere, Err(DecodeError::Answer { found: 0x60_6000, expected: 0x60_4100 }));
}

#[test]
fn the_statusword_encodes_the_drive_state() {
    for (word, state) in [
        (0x0000, DriveState::NotReady),
        (0x0250, DriveState::SwitchOnDisabled),
        (0x0231, DriveState::ReadyToSwitchOn),
        (0x0233, DriveState::SwitchedOn),
        (0x1237, DriveState::Enabled),
        (0x0217, DriveState::QuickStop),
        (0x021f, DriveState::FaultReaction),
        (0x0218, DriveState::Fault),
    ] {
        assert_eq!(DriveState::from_statusword(word), Ok(state), "0x{word:04X}");
    }
    assert!(DriveState::from_statusword(0x0001).is_err());
}

#[test]
fn a_fault_is_never_reset_on_the_way_to_enabled() {
    assert_eq!(DriveState::Fault.towards_enabled(), None);
    assert_eq!(DriveState::FaultReaction.towards_enabled(), None);
}

#[test]
fn setpoints_have_six_bytes_or_four_in_torque_mode() {
    let setpoint = Setpoint { controlword: 0x0f, target: -2 };
    assert_eq!(hex(node().setpoint(Mode::Position, &setpoint)), "0x205#0F00FEFFFFFF");
    assert_eq!(hex(node().setpoint(Mode::Torque, &setpoint)), "0x205#0F00FEFF");
    let beyond = Setpoint { controlword: 0x0f, target: 40_000 };
    assert_eq!(hex(node().setpoint(Mode::Torque, &beyond)), "0x205#0F00FF7F");
}

#[test]
fn unused_bytes_of_a_service_must_be_zero() {
    let dirty = Frame::classic(Id::Standard(0x605), &[0x2f, 0x60, 0x60, 0, 8, 1, 0, 0]);
    assert!(matches!(node().service_request(&dirty), Err(DecodeError::Field { .. })));
}

proptest! {
    #[test]
    fn process_data_and_setpoints_round_trip(a in any::<i32>(), b in any::<i16>(), word in any::<u16>()) {
        let motion = Process::Motion { velocity: a, torque: b };
        prop_assert_eq!(node().process(&node().process_frame(&motion)), Ok(motion));
        let position = Process::Position { statusword: 0x0227, position: a };
        prop_assert_eq!(node().process(&node().process_frame(&position)), Ok(position));
        for mode in [Mode::Position, Mode::Velocity] {
            let setpoint = Setpoint { controlword: word, target: a };
            prop_assert_eq!(node().setpoint_of(mode, &node().setpoint(mode, &setpoint)), Ok(setpoint));
        }
        let torque = Setpoint { controlword: word, target: b.into() };
        prop_assert_eq!(node().setpoint_of(Mode::Torque, &node().setpoint(Mode::Torque, &torque)), Ok(torque));
    }

    #[test]
    fn services_round_trip(index in any::<u16>(), subindex in any::<u8>(), x in any::<u32>()) {
        let object = Object { index, subindex };
        for value in [Value::byte(x as u8), Value::word(x as u16), Value::long(x)] {
            let (read, write) = (Service::Read(object), Service::Write(object, value));
            prop_assert_eq!(node().service_request(&node().service(&write)), Ok(write));
            prop_assert_eq!(node().service_request(&node().service(&read)), Ok(read));
            let answer = node().service_answer(&read, Ok(value));
            prop_assert_eq!(node().service_result(&read, &answer), Ok(Some(value)));
            let done = node().service_answer(&write, Ok(value));
            prop_assert_eq!(node().service_result(&write, &done), Ok(None));
        }
    }
}

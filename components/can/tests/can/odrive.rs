//! CANSimple, compared with bytes derived by hand from the published database.

use core::f64::consts::TAU;

use motorium_can::odrive::{AxisState, ControlMode, InputMode, Instruction, Node, Report};
use motorium_can::{DecodeError, Frame, Id};
use proptest::prelude::*;

fn node() -> Node {
    Node::new(3).unwrap()
}

#[test]
fn identifiers_and_fields_match_the_database() {
    let text = |instruction| format!("{:?}", node().frame(&instruction));
    assert_eq!(text(Instruction::EmergencyStop), "0x062#");
    assert_eq!(text(Instruction::SetState(AxisState::ClosedLoop)), "0x067#08000000");
    assert_eq!(
        text(Instruction::SetModes(ControlMode::Position, InputMode::Passthrough)),
        "0x06B#0300000001000000"
    );
    // 1 turn is 0x3F800000; 2 turns per second are 2000 thousandths, 0x07D0; 0.5 N m are 500, 0x01F4
    let position = Instruction::Position { position: TAU, velocity: 2.0 * TAU, torque: 0.5 };
    assert_eq!(text(position), "0x06C#0000803FD007F401");
    // -0.5 turns per second are 0xBF000000, 0.25 N m 0x3E800000
    let velocity = Instruction::Velocity { velocity: -0.5 * TAU, torque: 0.25 };
    assert_eq!(text(velocity), "0x06D#000000BF0000803E");
    assert_eq!(text(Instruction::Torque(1.5)), "0x06E#0000C03F");
    // 2 turns per second are 0x40000000, 10 A 0x41200000
    let limits = Instruction::Limits { velocity: 2.0 * TAU, current: 10.0 };
    assert_eq!(text(limits), "0x06F#0000004000002041");
    assert_eq!(node().instruction(&node().frame(&limits)), Ok(limits));
    assert_eq!(text(Instruction::ClearErrors), "0x078#");
}

#[test]
fn a_heartbeat_and_estimates_are_decoded() {
    let heartbeat = Frame::classic(Id::Standard(0x061), &[0x40, 0, 0, 0, 8, 1, 0, 1]);
    assert_eq!(
        node().report(&heartbeat),
        Ok(Report::Heartbeat { error: 0x40, state: AxisState::ClosedLoop, result: 1 })
    );
    // 30 and 45 degrees are 0x41F00000 and 0x42340000; 1 and -0.5 A 0x3F800000 and 0xBF000000
    let temperature = Frame::classic(Id::Standard(0x075), &[0, 0, 0xf0, 0x41, 0, 0, 0x34, 0x42]);
    assert_eq!(node().report(&temperature), Ok(Report::Temperature { transistors: 30.0, motor: 45.0 }));
    let currents = Frame::classic(Id::Standard(0x074), &[0, 0, 0x80, 0x3f, 0, 0, 0, 0xbf]);
    assert_eq!(node().report(&currents), Ok(Report::Currents { target: 1.0, measured: -0.5 }));
    let estimates = Frame::classic(Id::Standard(0x069), &[0, 0, 0x80, 0x3f, 0, 0, 0, 0xbf]);
    assert_eq!(node().report(&estimates), Ok(Report::Encoder { position: TAU, velocity: -0.5 * TAU }));
}

#[test]
fn invalid_messages_are_refused() {
    let report = |id, bytes: &[u8]| node().report(&Frame::classic(Id::Standard(id), bytes));
    assert_eq!(report(0x069, &[0; 6]), Err(DecodeError::Length { found: 6, expected: 8 }));
    let endless = report(0x069, &[0, 0, 0xc0, 0x7f, 0, 0, 0, 0]);
    assert_eq!(endless, Err(DecodeError::NotFinite { field: "the position" }));
    let state = report(0x061, &[0, 0, 0, 0, 5, 0, 0, 0]);
    assert_eq!(state, Err(DecodeError::Field { field: "the axis state", found: 5 }));
    assert!(matches!(report(0x089, &[0; 8]), Err(DecodeError::Id { .. })));
}

proptest! {
    #[test]
    fn setpoints_arrive_within_the_steps_of_their_fields(
        position in -1e3..1e3_f64, velocity in -200.0..200.0_f64, torque in -32.0..32.0_f64,
    ) {
        let sent = Instruction::Position { position, velocity, torque };
        let Ok(Instruction::Position { position: p, velocity: v, torque: t }) =
            node().instruction(&node().frame(&sent)) else { panic!() };
        prop_assert!((p - position).abs() <= 1e-7 * position.abs());
        prop_assert!((v - velocity).abs() <= 0.5e-3 * TAU * (1.0 + 1e-9));
        prop_assert!((t - torque).abs() <= 0.5e-3 * (1.0 + 1e-9));
    }

    #[test]
    fn reports_arrive_as_numbers_of_32_bits(position in -1e4..1e4_f64, velocity in -1e3..1e3_f64) {
        let sent = Report::Encoder { position, velocity };
        let Ok(Report::Encoder { position: p, velocity: v }) =
            node().report(&node().report_frame(&sent)) else { panic!() };
        prop_assert!((p - position).abs() <= 1e-7 * position.abs() && (v - velocity).abs() <= 1e-7 * velocity.abs());
    }
}

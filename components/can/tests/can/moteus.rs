//! moteus, compared with the frames in the manufacturer's protocol tests.

use core::f64::consts::TAU;

use motorium_can::adapter::{Adapter, OnTrip, Phase, WrongSetting};
use motorium_can::drive::Fault;
use motorium_can::moteus::{Command, Home, Instruction, Mode, Node, Resolution, State};
use motorium_can::{AnySimulatedDrive, DecodeError, Form, Frame, Id, Overrides, Received, Table};
use proptest::prelude::*;

fn node() -> Node {
    Node::new(1).unwrap()
}

fn data(frame: &Frame) -> String {
    frame.data().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn frame(id: Id, hex: &str) -> Frame {
    let mut bytes: Vec<u8> =
        (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect();
    while Frame::new(id, Form::FdFast, &bytes).is_none() {
        bytes.push(0x50);
    }
    Frame::new(id, Form::FdFast, &bytes).unwrap()
}

#[test]
fn frames_match_the_manufacturers_tests() {
    // mode and three numbers, as queried by default, then six registers from the motor temperature to the
    // fault
    assert_eq!(data(&node().frame(&Instruction::Query, Resolution::Float)), "11001f0110060a");
    assert!(data(&node().frame(&Instruction::Stop, Resolution::Float)).starts_with("010000"));
    assert!(data(&node().frame(&Instruction::Brake, Resolution::Float)).starts_with("01000f"));
    let command = Command {
        position: 0.25 * TAU,
        velocity: 0.5 * TAU,
        torque: 1.0,
        kp_scale: 0.25,
        kd_scale: 0.125,
        max_torque: 8.0,
        watchdog: 0.2,
    };
    // like the manufacturer's frame, but with eight registers instead of eleven, and without a stop position
    assert!(
        data(&node().frame(&Instruction::Position(command), Resolution::Int16))
            .starts_with("01000a040820c409d0076400ff1fff0f20030080c800"),
    );
    let defaults = frame(node().id(), "01000a0e200000000000000000");
    let expected = Command { position: 0.0, ..Command::default() };
    let Ok(Instruction::Position(found)) = node().instruction(&defaults) else { panic!() };
    assert_eq!((found.position, found.velocity, found.kp_scale), (expected.position, 0.0, 1.0));
    assert!(found.watchdog == 0.0 && found.max_torque.is_nan(), "the drive's own values");
}

#[test]
fn answers_of_the_manufacturers_tests_are_decoded() {
    let minimal = frame(node().reply_id(), "2404000a00100200fe2000230d203040");
    let state = node().reply(&minimal).unwrap();
    assert_eq!((state.mode, state.fault), (Mode::Position, 64));
    assert_eq!((state.voltage, state.temperature), (16.0, 48.0));
    assert_eq!((state.motor_temperature, state.home), (None, None), "neither is reported");
    let near = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}");
    near(state.position, 0.0528 * TAU);
    near(state.velocity, -0.128 * TAU);
    near(state.torque, 0.320);
    // contains registers that are never queried here
    let maximal = frame(
        node().reply_id(),
        "2407000a00100200fe200010004000700020060a100102203040240250200030 00".replace(' ', "").as_str(),
    );
    // plus two more that are queried here
    let expected = State { motor_temperature: Some(16.0), home: Some(Home::Output), ..state };
    assert_eq!(node().reply(&maximal), Ok(expected));
}

#[test]
fn a_drive_above_id_7_answers_with_29_bits() {
    assert_eq!(Node::new(7).unwrap().reply_id(), Id::Standard(0x700));
    assert_eq!(Node::new(8).unwrap().reply_id(), Id::Extended(0x800));
    assert_eq!(Node::new(8).unwrap().id(), Id::Extended(0x8008));
    assert_eq!((Node::new(0), Node::new(127)), (None, None));
}

#[test]
fn truncated_refused_or_incomplete_states_are_errors() {
    let reply = |hex| node().reply(&frame(node().reply_id(), hex));
    let whole = "2404000a00100200fe2000230d203040";
    assert!(reply(whole).is_ok());
    let lacking = reply("2404000a00100200fe2000");
    assert_eq!(lacking, Err(DecodeError::Answer { found: 0, expected: 0x0f }));
    assert_eq!(reply("310107"), Err(DecodeError::Refused { code: 0x107 }));
    assert_eq!(
        reply("2404001000100200fe2000230d203040"),
        Err(DecodeError::Field { field: "the mode", found: 16 })
    );
    assert_eq!(
        reply("2404000a00008000fe2000230d203040"),
        Err(DecodeError::NotFinite { field: "the position" })
    );
    assert!(matches!(reply("24040000"), Err(DecodeError::Length { .. })));
    assert!(matches!(reply("70"), Err(DecodeError::Field { .. })));
    assert!(matches!(reply("01000a"), Err(DecodeError::Field { .. })), "a write is not an answer");
    let stranger = frame(Id::Standard(0x200), whole);
    assert!(matches!(node().reply(&stranger), Err(DecodeError::Id { .. })));
}

/// Drive table of one moteus, with these keys.
fn table(more: &str) -> String {
    format!(
        "[[bus]]\nname = \"can0\"\nbitrate = 1_000_000\ndata_bitrate = 5_000_000\n[[drive]]\njoint = \"hip\"\nbus = \"can0\"\n\
         protocol = \"moteus\"\nnode = 1\nwatchdog = \"20 ms\"\nranges = {{ position = 12.5, velocity = 30.0, torque = 8.0 }}\n{more}\n"
    )
}

/// Adapter of such a drive.
fn adapter(more: &str) -> Adapter {
    Adapter::new(&Table::parse(&table(more)).unwrap(), &[0], &[0.3], OnTrip::Damp)
}

/// Runs ten cycles in which the drive answers with this state.
fn answered(mut adapter: Adapter, state: &State) -> Adapter {
    let mut frames = Vec::new();
    for cycle in 0..10_u64 {
        frames.clear();
        adapter.write(0, &mut frames);
        adapter.sent(0, frames.len(), cycle * 1_000_000);
        let frame = node().reply_frame(state, Resolution::Int16);
        adapter.take(0, &Received { frame, time_ns: cycle * 1_000_000 + 400_000 });
        adapter.end_cycle(true);
    }
    adapter
}

fn well(home: Home) -> State {
    let (mode, voltage, temperature) = (Mode::Stopped, 24.0, 30.0);
    let (position, velocity, torque) = (0.5, 0.0, 0.0);
    State {
        mode,
        position,
        velocity,
        torque,
        voltage,
        temperature,
        motor_temperature: None,
        home: Some(home),
        fault: 0,
    }
}

#[test]
fn a_relative_encoder_is_enabled_only_after_homing() {
    for (more, home, is_right) in [
        ("", Home::Output, true),
        ("", Home::Rotor, false),
        ("", Home::Relative, false),
        ("reference = \"output\"", Home::Rotor, false),
        ("reference = \"rotor\"", Home::Rotor, true),
        ("reference = \"rotor\"", Home::Relative, false),
    ] {
        let adapter = answered(adapter(more), &well(home));
        match adapter.wrong_setting() {
            None => assert!(is_right && adapter.links()[0].phase() == Phase::Enabling, "{more}: {home:?}"),
            Some((_, WrongSetting::Reference { found, .. })) => assert!(!is_right && found == home, "{more}"),
            Some((_, other)) => panic!("{more}: {other}"),
        }
    }
    let homed = "homing = { by = \"stop\", velocity = -0.5, effort = 1.0, position = -0.8 }\nposition_loop = { kp = 20.0, kd = 2.0 }";
    let adapter = answered(adapter(homed), &well(Home::Relative));
    assert_eq!((adapter.wrong_setting(), adapter.links()[0].phase()), (None, Phase::Homing));
    let both = Table::parse(&table(&format!("{homed}\nreference = \"rotor\""))).unwrap_err().to_string();
    assert!(both.contains("`reference` is only a key of moteus without `homing`"), "{both}");
}

#[test]
fn the_simulated_encoder_counts_from_power_on_if_homed() {
    for (more, expected) in [
        ("", Home::Output),
        (
            "homing = { by = \"stop\", velocity = -0.5, effort = 1.0, position = -0.8 }\nposition_loop = { kp = 20.0, kd = 2.0 }",
            Home::Relative,
        ),
    ] {
        let mut drive = AnySimulatedDrive::new(&Table::parse(&table(more)).unwrap(), 0, Overrides::default());
        let mut home = None;
        let query = node().frame(&Instruction::Query, Resolution::Int16);
        drive.receive(&query, 0, &mut |answer| home = node().reply(&answer).unwrap().home);
        assert_eq!(home, Some(expected));
    }
}

#[test]
fn faults_have_names_and_limits() {
    for (code, fault) in [
        (34, Fault::OverVoltage),
        (35, Fault::Encoder),
        (38, Fault::HotTransistors),
        (40, Fault::UnderVoltage),
        (33, Fault::Other(33)),
    ] {
        let state = State { mode: Mode::Fault, fault: code, ..well(Home::Output) };
        assert_eq!(answered(adapter(""), &state).links()[0].fault(), Some(fault));
    }
    // 102: the largest torque of the command
    let limited = State { mode: Mode::Position, fault: 102, ..well(Home::Output) };
    let adapter = answered(adapter(""), &limited);
    assert_eq!((adapter.links()[0].fault(), adapter.has_tripped()), (None, false));
}

#[test]
fn the_higher_temperature_is_reported() {
    for (motor, expected) in [(None, 30.0), (Some(12.0), 30.0), (Some(71.0), 71.0)] {
        let state = State { motor_temperature: motor, ..well(Home::Output) };
        assert_eq!(answered(adapter(""), &state).links()[0].temperature(), Some(expected));
    }
}

#[test]
fn ranges_beyond_the_registers_of_16_bits_are_refused() {
    for (from, to, words) in [
        (
            "position = 12.5",
            "position = 25.0",
            "the position is 25 rad, but the registers of a moteus are limited to 20.59",
        ),
        (
            "velocity = 30.0",
            "velocity = 60.0",
            "the velocity is 60 rad/s, but the registers of a moteus are limited to 51.47",
        ),
    ] {
        let error = Table::parse(&table("").replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}

fn resolution() -> impl Strategy<Value = Resolution> {
    prop_oneof![Just(Resolution::Int16), Just(Resolution::Int32), Just(Resolution::Float)]
}

proptest! {
    #[test]
    fn commands_arrive_within_the_steps_of_their_resolution(
        resolution in resolution(), position in -18.0..18.0_f64, velocity in -40.0..40.0_f64, torque in -30.0..30.0_f64,
        kp in 0.0..1.0_f64, watchdog in 0.01..2.0_f64,
    ) {
        let sent = Command { position, velocity, torque, kp_scale: kp, kd_scale: kp, max_torque: 3.0, watchdog };
        let frame = node().frame(&Instruction::Position(sent), resolution);
        let Ok(Instruction::Position(found)) = node().instruction(&frame) else { panic!() };
        for (found, sent, step) in [
            (found.position, position, 1.01e-4 * TAU), (found.velocity, velocity, 2.51e-4 * TAU),
            (found.torque, torque, 0.0101), (found.kp_scale, kp, 1.0 / 32767.0),
            (found.max_torque, 3.0, 0.0101), (found.watchdog, watchdog, 0.00101),
        ] {
            prop_assert!((found - sent).abs() <= step, "{} {}", found, sent);
        }
    }

    #[test]
    fn states_arrive_within_the_steps_of_their_resolution(
        resolution in resolution(), position in -18.0..18.0_f64, velocity in -40.0..40.0_f64, torque in -30.0..30.0_f64,
    ) {
        let sent = State {
            mode: Mode::Timeout, position, velocity, torque, voltage: 24.5, temperature: 31.0,
            motor_temperature: Some(44.0), home: Some(Home::Output), fault: 0,
        };
        let found = node().reply(&node().reply_frame(&sent, resolution)).unwrap();
        prop_assert!((found.position - position).abs() <= 1.01e-4 * TAU);
        prop_assert!((found.velocity - velocity).abs() <= 2.51e-4 * TAU);
        prop_assert!((found.torque - torque).abs() <= 0.0101);
        prop_assert_eq!((found.mode, found.voltage, found.temperature), (Mode::Timeout, 24.5, 31.0));
        prop_assert_eq!((found.motor_temperature, found.home), (Some(44.0), Some(Home::Output)));
    }

    #[test]
    fn a_missing_position_round_trips_in_every_resolution(resolution in resolution()) {
        let frame = node().frame(&Instruction::Position(Command::default()), resolution);
        let Ok(Instruction::Position(found)) = node().instruction(&frame) else { panic!() };
        prop_assert!(found.position.is_nan() && found.max_torque.is_nan());
    }
}

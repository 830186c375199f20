//! Message databases, compared with cantools (`databases/golden.py`) and the ODrive codec.

use core::f64::consts::TAU;

use motorium_can::odrive::{AxisState, ControlMode, InputMode, Instruction, Node, Report};
use motorium_can::{Database, DatabaseError, Form, Frame, Id, Record};
use proptest::prelude::*;

const ODRIVE: &str = include_str!("databases/odrive.dbc");
const KINDS: &str = include_str!("databases/kinds.dbc");
const GOLDEN: &str = include_str!("databases/golden.txt");

fn frame(id: &str, data: &str) -> Frame {
    let number = u32::from_str_radix(&id[1..], 16).unwrap();
    let id = if id.starts_with('x') { Id::Extended(number) } else { Id::Standard(number as u16) };
    let bytes: Vec<u8> =
        (0..data.len() / 2).map(|i| u8::from_str_radix(&data[2 * i..2 * i + 2], 16).unwrap()).collect();
    let form = if bytes.len() > 8 { Form::FdFast } else { Form::Classic };
    Frame::new(id, form, &bytes).unwrap()
}

#[test]
fn decoded_values_match_cantools() {
    let (odrive, kinds) = (Database::parse(ODRIVE).unwrap(), Database::parse(KINDS).unwrap());
    let mut compared = 0;
    for line in GOLDEN.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let database = if words[0] == "odrive" { &odrive } else { &kinds };
        let frame = frame(words[1], words[2]);
        let decoded = database.decode(&frame).unwrap();
        assert_eq!(decoded.name, words[3], "{line}");
        assert_eq!(decoded.signals.len(), words.len() - 4, "{line}: {decoded:?}");
        for word in &words[4..] {
            let (name, value) = word.split_once('=').unwrap();
            let expected: f64 = value.parse().unwrap();
            let found = decoded.signals.iter().find(|signal| signal.name == name).unwrap().value;
            let same = found == expected
                || (found.is_nan() && expected.is_nan())
                || (found - expected).abs() <= 1e-12 * expected.abs();
            assert!(same, "{line}: {found}");
            compared += 1;
        }
    }
    assert!(compared > 250, "{compared}");
}

#[test]
fn signals_of_an_absent_multiplexer_are_absent() {
    let text = "VERSION \"\"\nNS_ :\nBS_:\nBU_:\nBO_ 2024 Diagnosis: 8 Vector__XXX\n \
                SG_ Service M : 0|8@1+ (1,0) [0|255] \"\" Vector__XXX\n \
                SG_ Pid m1M : 8|8@1+ (1,0) [0|255] \"\" Vector__XXX\n \
                SG_ Speed m13 : 16|8@1+ (1,0) [0|255] \"km/h\" Vector__XXX\n \
                SG_ Code m2 : 8|16@1+ (1,0) [0|65535] \"\" Vector__XXX\n\
                SG_MUL_VAL_ 2024 Pid Service 1-1;\nSG_MUL_VAL_ 2024 Speed Pid 13-13;\n\
                SG_MUL_VAL_ 2024 Code Service 2-2;\n";
    let database = Database::parse(text).unwrap();
    let decoded =
        |data: &[u8]| database.decode(&Frame::classic(Id::Standard(2024), data)).unwrap().to_string();
    assert_eq!(decoded(&[1, 13, 80]), "Diagnosis(Service: 1, Pid: 13, Speed: 80 km/h)");
    // The byte at the position of `Pid` is 13.
    assert_eq!(decoded(&[2, 13, 80]), "Diagnosis(Service: 2, Code: 20493)");
    assert_eq!(decoded(&[1, 12, 80]), "Diagnosis(Service: 1, Pid: 12)");
    // Two multiplexers that depend on each other are never present.
    let circle = text.replace("Pid Service 1-1", "Pid Speed 1-1");
    let database = Database::parse(&circle).unwrap();
    let found = database.decode(&Frame::classic(Id::Standard(2024), &[1, 13, 1])).unwrap().to_string();
    assert_eq!(found, "Diagnosis(Service: 1)");
}

#[test]
fn nested_multiplexer_pages_depend_on_the_main_one() {
    let text = "VERSION \"\"\nNS_ :\nBS_:\nBU_:\nBO_ 7 Pages: 8 Vector__XXX\n \
                SG_ Sub m1M : 8|8@1+ (1,0) [0|255] \"\" Vector__XXX\n \
                SG_ Speed m2 : 16|8@1+ (1,0) [0|255] \"\" Vector__XXX\n \
                SG_ Page M : 0|8@1+ (1,0) [0|255] \"\" Vector__XXX\n";
    let database = Database::parse(text).unwrap();
    let decoded = |data: &[u8]| database.decode(&Frame::classic(Id::Standard(7), data)).unwrap().to_string();
    assert_eq!(decoded(&[1, 2, 80]), "Pages(Sub: 2, Page: 1)");
    assert_eq!(decoded(&[2, 1, 80]), "Pages(Speed: 80, Page: 2)");
}

#[test]
fn scaled_values_of_64_bits_keep_all_digits() {
    let text = "VERSION \"\"\nNS_ :\nBS_:\nBU_:\nBO_ 1 Time: 8 Vector__XXX\n \
                SG_ Since : 0|64@1+ (1E-006,0) [0|0] \"s\" Vector__XXX\n\
                BO_ 2 Count: 4 Vector__XXX\n SG_ Ticks : 0|32@1- (1,0) [0|0] \"\" Vector__XXX\n\n\
                SIG_VALTYPE_ 2 Ticks : 1;\n";
    let database = Database::parse(text).unwrap();
    let decoded =
        |id, data: &[u8]| database.decode(&Frame::classic(Id::Standard(id), data)).unwrap().to_string();
    let time = decoded(1, &1_735_270_496_916_858_u64.to_le_bytes());
    assert_eq!(time, "Time(Since: 1735270496.916858 s)");
    assert_eq!(decoded(2, &123_456_792_f32.to_le_bytes()), "Count(Ticks: 123456792)");
}

fn odrive() -> Database {
    Database::parse(ODRIVE).unwrap().with_mask(0x1f).unwrap()
}

fn values(frame: &Frame) -> Vec<(String, f64)> {
    let database = odrive();
    let decoded = database.decode(frame).unwrap();
    decoded.signals.iter().map(|signal| (signal.name.to_string(), signal.value)).collect()
}

fn named(names: [&str; 2], numbers: [f64; 2]) -> Vec<(String, f64)> {
    names.iter().zip(numbers).map(|(name, value)| (name.to_string(), value)).collect()
}

proptest! {
    #[test]
    fn the_database_decodes_frames_of_the_odrive_codec(
        node in 0_u8..64, a in -1000.0..1000.0_f64, b in -30.0..30.0_f64, c in -30.0..30.0_f64,
    ) {
        let node = Node::new(node).unwrap();
        let single = |x: f64| f64::from(x as f32);
        let estimates = node.report_frame(&Report::Encoder { position: a, velocity: b });
        let expected = named(["Pos_Estimate", "Vel_Estimate"], [single(a / TAU), single(b / TAU)]);
        prop_assert_eq!(values(&estimates), expected);
        let velocity = node.frame(&Instruction::Velocity { velocity: a, torque: b });
        prop_assert_eq!(values(&velocity), named(["Input_Vel", "Input_Torque_FF"], [single(a / TAU), single(b)]));
        let position = node.frame(&Instruction::Position { position: a, velocity: b, torque: c });
        let found = values(&position);
        prop_assert_eq!(found[0].1, single(a / TAU));
        prop_assert!((found[1].1 - b / TAU).abs() <= 0.5001e-3 && (found[2].1 - c).abs() <= 0.5001e-3);
        let torque = node.frame(&Instruction::Torque(c));
        prop_assert_eq!(values(&torque), vec![("Input_Torque".to_string(), single(c))]);
    }
}

#[test]
fn whole_numbers_keep_all_digits() {
    let text = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: ECU\n\nBO_ 1 Big: 8 ECU\n SG_ Count : 0|64@1+ (1,0) [0|0] \"\" Vector__XXX\n\n\
                BO_ 2 Small: 8 ECU\n SG_ Tenths : 0|32@1+ (0.1,0) [0|0] \"V\" Vector__XXX\n SG_ Below : 32|32@1- (2,-1) [0|0] \"\" Vector__XXX\n";
    let database = Database::parse(text).unwrap();
    for count in [305_419_896_u64, u64::MAX, 1 << 53 | 1, 0] {
        let frame = Frame::new(Id::Standard(1), Form::Classic, &count.to_le_bytes()).unwrap();
        assert_eq!(database.decode(&frame).unwrap().to_string(), format!("Big(Count: {count})"));
    }
    let mut data = 305_419_896_u32.to_le_bytes().to_vec();
    data.extend((-2_000_000_001_i32).to_le_bytes());
    let frame = Frame::new(Id::Standard(2), Form::Classic, &data).unwrap();
    let found = database.decode(&frame).unwrap().to_string();
    assert_eq!(found, "Small(Tenths: 30541989.6 V, Below: -4000000003)");
}

#[test]
fn logs_of_screens_and_asc_files_are_read() {
    let read = |line: &str| Record::of_log(line).unwrap().map(|record| record.to_string());
    for (line, expected) in [
        ("  can0  123   [3]  11 22 33", "(0.000000) can0 123#112233"),
        (" (1735270496.916858)  can0  00000123   [1]  FF", "(1735270496.916858) can0 00000123#FF"),
        ("(12.5) can0 123#0102", "(12.500000) can0 123#0102"),
        ("   0.012345 2  7FF             Rx   d 2 01 02  Length = 0", "(0.012345) can2 7FF#0102"),
        ("  can0  123   [4]  remote request", "(0.000000) can0 123#R4"),
        ("  1.5 1 1A0 Tx r 4", "(1.500000) can1 1A0#R4"),
        ("  1.5 1 1A0 Tx r", "(1.500000) can1 1A0#R"),
        ("  can0  RX B -  123   [02]  11 22", "(0.000000) can0 123##51122"),
        ("  can0  RX - -  123   [02]  11 22", "(0.000000) can0 123##41122"),
    ] {
        assert_eq!(read(line).as_deref(), Some(expected), "{line}");
    }
    for line in
        ["", "date Fri Nov 1 2024", "base hex  timestamps absolute", "// version 13.0.0", "End TriggerBlock"]
    {
        assert_eq!(read(line), None, "{line}");
    }
    for line in [
        "base dec  timestamps absolute",
        "base hex timestamps relative",
        "0.5 1 123 Rx d 3 11 22",
        "can0 123 [3] 11 22",
        "words",
    ] {
        assert!(Record::of_log(line).is_err(), "{line}");
    }
}

#[test]
fn states_and_modes_match_the_database() {
    let node = Node::new(5).unwrap();
    let database = odrive();
    let text = |frame: &Frame| database.decode(frame).unwrap().to_string();
    let heartbeat =
        node.report_frame(&Report::Heartbeat { error: 0x40, state: AxisState::ClosedLoop, result: 0 });
    assert_eq!(text(&heartbeat), "Heartbeat(Axis_Error: 64, Axis_State: CLOSED_LOOP_CONTROL)");
    assert_eq!(
        text(&node.frame(&Instruction::SetState(AxisState::Idle))),
        "Set_Axis_State(Axis_Requested_State: IDLE)"
    );
    assert_eq!(
        text(&node.frame(&Instruction::SetModes(ControlMode::Torque, InputMode::Passthrough))),
        "Set_Controller_Mode(Control_Mode: TORQUE, Input_Mode: 1)"
    );
    let supply = node.report_frame(&Report::Supply { voltage: 23.5, current: 0.0 });
    assert_eq!(text(&supply), "Get_Vbus_Voltage(Vbus_Voltage: 23.5 V)");
}

#[test]
fn without_a_mask_only_the_own_node_is_decoded() {
    let plain = Database::parse(ODRIVE).unwrap();
    assert!(plain.decode(&frame("s9", "0000000000000000")).is_some());
    assert!(plain.decode(&frame("s69", "0000000000000000")).is_none());
    assert!(odrive().decode(&frame("s69", "0000000000000000")).is_some());
    assert!(
        odrive().decode(&frame("x69", "0000000000000000")).is_none(),
        "a 29-bit identifier is a different one"
    );
    let error = Database::parse(KINDS).unwrap().with_mask(0xff).unwrap_err();
    assert!(matches!(error, DatabaseError::Twice { mask: 0xff, .. }), "{error}");
}

#[test]
fn a_short_frame_has_the_signals_that_fit() {
    let database = Database::parse(KINDS).unwrap();
    let decoded = database.decode(&frame("s100", "f0ff")).unwrap();
    // raw value -1, factor 0.5 deg, offset -3 deg
    assert_eq!(decoded.to_string(), "Orders(Intel: -3.5 deg)");
    assert_eq!(database.decode(&frame("s100", "")).unwrap().signals, []);
}

#[test]
fn signals_of_inactive_pages_are_omitted() {
    let database = Database::parse(KINDS).unwrap();
    let names = |id, data| -> Vec<String> {
        let decoded = database.decode(&frame(id, data)).unwrap();
        decoded.signals.iter().map(|signal| signal.name.to_string()).collect()
    };
    assert_eq!(names("s200", "0000000000000000"), ["Page", "Current", "Always"]);
    assert_eq!(names("s200", "0500000000000000"), ["Page", "Always"]);
    assert_eq!(names("s400", "0700000000000000"), ["Page"]);
    assert_eq!(names("s400", "0900000000000000"), ["Page", "High"]);
}

#[test]
fn invalid_databases_are_refused_with_their_position() {
    let refused = |text: &str| Database::parse(text).unwrap_err().to_string();
    let broken = refused(&KINDS.replace("12@1-", "12@7-"));
    assert!(broken.contains("the text is not a DBC file") && broken.contains("10:"), "{broken}");
    assert_eq!(
        refused(&KINDS.replace("63|1@1+", "60|8@1+")),
        "the signal `Bit` of the message `Orders`: its 8 bits from bit 60 on exceed the 8 bytes of the message"
    );
    let message = |signals: &str| format!("VERSION \"\"\nNS_ :\nBS_:\nBU_: A\nBO_ 291 Msg: 8 A\n{signals}");
    let signal =
        |name: &str, start: u8, factor: u8| format!(" SG_ {name} : {start}|8@1+ ({factor},0) [0|0] \"\" A\n");
    let twice = [signal("T", 0, 1), signal("T", 8, 1)].concat();
    assert_eq!(
        refused(&message(&twice)),
        "the signal `T` of the message `Msg`: a second signal has this name, expected distinct names"
    );
    assert_eq!(
        refused(&message(&signal("T", 0, 0))),
        "the signal `T` of the message `Msg`: its factor is 0, expected a number other than 0"
    );
    // pages of one name, and a byte order mark
    let pages = twice.replacen("T :", "T m1 :", 1).replacen("T :", "T m2 :", 1);
    let pages = format!("\u{feff}{}", message(&format!("{pages} SG_ S M : 16|8@1+ (1,0) [0|0] \"\" A\n")));
    assert!(Database::parse(&pages).is_ok(), "{:?}", Database::parse(&pages));
    assert_eq!(
        refused(&ODRIVE.replace("Input_Torque : 0|32@1+", "Input_Torque : 0|16@1+")),
        "the signal `Input_Torque` of the message `Set_Input_Torque`: 16 bits, expected 32 to 32"
    );
    assert_eq!(
        refused(&ODRIVE.replace("BO_ 23 ", "BO_ 14 ")),
        "the messages `Set_Input_Torque` and `Get_Vbus_Voltage` have the same identifier"
    );
    assert_eq!(
        refused(&KINDS.replace("Page M : 0|4", "Page : 0|4")),
        "the signal `Current` of the message `Switched`: its multiplexer is missing"
    );
}

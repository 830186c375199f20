//! MIT protocol: published bytes, and round trips within half a field step.

use motorium_can::drive::{Command, Fault, Feedback, Ranges, State};
use motorium_can::mit::{Drive, Instruction, Reply};
use motorium_can::{DecodeError, Frame, Id, Range};
use proptest::prelude::*;

fn knee() -> Drive {
    Drive::mini_cheetah(1).with_ranges(Ranges::new(12.5, 45.0, 18.0))
}

fn every_drive() -> [Drive; 5] {
    let of = |reply, ranges| Drive::new(5, Id::Standard(0x11), reply, ranges);
    [
        of(Reply::MiniCheetah, Ranges::MINI_CHEETAH),
        of(Reply::MiniCheetahVoltage, Ranges::MINI_CHEETAH),
        of(Reply::CubeMars, Ranges::AK80_64),
        Drive::damiao(5, 0x15, Ranges::new(12.5, 30.0, 10.0)),
        of(Reply::RobStride, Ranges::RS00),
    ]
}

#[test]
fn a_zero_command_has_the_published_bytes() {
    let frame = knee().command(&Command::default());
    assert_eq!(frame, Frame::classic(Id::Standard(1), &[0x7f, 0xff, 0x7f, 0xf0, 0, 0, 0x07, 0xff]));
}

#[test]
fn fields_are_at_their_published_positions() {
    let drive = knee();
    let lowest = Command { position: -99.0, velocity: -99.0, kp: 0.0, kd: 0.0, torque: -99.0 };
    let bytes = |command: &Command| drive.command(command).data().to_vec();
    assert_eq!(bytes(&lowest), [0; 8]);
    assert_eq!(bytes(&Command { position: 99.0, ..lowest }), [0xff, 0xff, 0, 0, 0, 0, 0, 0]);
    assert_eq!(bytes(&Command { velocity: 99.0, ..lowest }), [0, 0, 0xff, 0xf0, 0, 0, 0, 0]);
    assert_eq!(bytes(&Command { kp: 999.0, ..lowest }), [0, 0, 0, 0x0f, 0xff, 0, 0, 0]);
    assert_eq!(bytes(&Command { kd: 99.0, ..lowest }), [0, 0, 0, 0, 0, 0xff, 0xf0, 0]);
    assert_eq!(bytes(&Command { torque: 99.0, ..lowest }), [0, 0, 0, 0, 0, 0, 0x0f, 0xff]);
}

#[test]
fn enabling_disabling_and_zeroing_have_the_published_codes() {
    for (instruction, code) in
        [(Instruction::Enable, 0xfc), (Instruction::Disable, 0xfd), (Instruction::SetZero, 0xfe)]
    {
        let frame = knee().instruct(&instruction);
        assert_eq!(frame.data(), [0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, code]);
        assert_eq!(knee().instruction(&frame), Ok(instruction));
    }
}

#[test]
fn no_command_looks_like_enabling_or_disabling() {
    let highest = Command { position: 1e9, velocity: 1e9, kp: 1e9, kd: 1e9, torque: 1e9 };
    let frame = knee().command(&highest);
    assert!(matches!(knee().instruction(&frame), Ok(Instruction::Command(_))), "{frame:?}");
}

#[test]
fn a_nan_setpoint_is_sent_as_zero() {
    let broken = Command { position: f64::NAN, velocity: f64::NAN, kp: f64::NAN, kd: 0.0, torque: f64::NAN };
    assert_eq!(knee().command(&broken), knee().command(&Command::default()));
}

#[test]
fn states_and_faults_round_trip_in_every_format() {
    let faults = [
        Fault::OverVoltage,
        Fault::UnderVoltage,
        Fault::OverCurrent,
        Fault::HotTransistors,
        Fault::HotMotor,
        Fault::Overload,
    ];
    let feedback = |state| Feedback {
        position: 0.0,
        velocity: 0.0,
        torque: 0.0,
        temperature: Some(41.0),
        voltage: None,
        state,
    };
    for drive in every_drive().iter().filter(|drive| matches!(drive.reply, Reply::CubeMars | Reply::Damiao)) {
        for fault in faults {
            let got = drive.reply(&drive.answer(&feedback(State::Fault(fault)))).unwrap();
            assert_eq!((got.state, got.temperature), (State::Fault(fault), Some(41.0)), "{:?}", drive.reply);
        }
    }
    let damiao = every_drive()[3];
    for state in [State::Disabled, State::Enabled, State::Fault(Fault::CommunicationLost)] {
        assert_eq!(damiao.reply(&damiao.answer(&feedback(state))).unwrap().state, state);
    }
}

#[test]
fn an_answer_of_another_length_device_or_state_is_refused() {
    let damiao = every_drive()[3];
    let answer = |bytes: &[u8]| damiao.reply(&Frame::classic(Id::Standard(0x15), bytes));
    assert_eq!(answer(&[0x15, 0, 0, 0, 0, 0]), Err(DecodeError::Length { found: 6, expected: 8 }));
    assert_eq!(answer(&[0x16, 0, 0, 0, 0, 0, 0, 0]), Err(DecodeError::Device { found: 6, expected: 5 }));
    let unknown = Err(DecodeError::Field { field: "the state", found: 0x2 });
    assert_eq!(answer(&[0x25, 0, 0, 0, 0, 0, 0, 0]), unknown);
    let elsewhere = damiao.reply(&Frame::classic(Id::Standard(0x16), &[0x15; 8]));
    assert!(matches!(elsewhere, Err(DecodeError::Id { .. })));
}

/// Integer for a number by the published formula `(x - min) (2^n - 1) / (max - min)`, and its distance from a
/// half.
fn published(x: f64, range: &Range, bits: u32) -> (f64, f64) {
    let scaled = (x - range.min) * f64::from((1_u32 << bits) - 1) / (range.max - range.min);
    (scaled.round(), (scaled.fract() - 0.5).abs())
}

#[test]
fn halves_round_down_and_range_ends_are_reached() {
    for most in [0.1, 1.0 / 3.0, 1.1, 2.2, 3.0, 6.27, 8.0, 9.42, 11.3, 12.5, 12.57, 65.0, 144.0, 1e6] {
        for bits in [8, 12, 16] {
            let (range, highest) = (Range::symmetric(most), ((1_u32 << bits) - 1) as u16);
            assert_eq!(range.encode(0.0, bits), highest / 2, "{most} in {bits} bits");
            assert_eq!((range.encode(most, bits), range.encode(-most, bits)), (highest, 0));
            assert_eq!(range.encode(f64::INFINITY, bits), highest);
            assert_eq!(range.encode(f64::NEG_INFINITY, bits), 0);
            assert_eq!(Range::from_zero(most).encode(0.0, bits), 0);
            for value in [0, 1, highest / 2, highest / 2 + 1, highest] {
                assert_eq!(range.encode(range.decode(value, bits), bits), value, "{most} in {bits} bits");
            }
        }
    }
    let beside = Range { min: 2.0, max: 4.0 };
    assert_eq!(
        (beside.encode(f64::NAN, 12), Range { min: -4.0, max: -2.0 }.encode(f64::NAN, 12)),
        (0, 0xfff)
    );
}

proptest! {
    #[test]
    fn an_integer_follows_the_published_formula(
        x in -20.0..20.0_f64, min in -18.0..-0.01_f64, max in 0.01..18.0_f64, bits in 1..=16_u32,
    ) {
        let range = Range { min, max };
        let (expected, from_half) = published(x.clamp(min, max), &range, bits);
        prop_assume!(from_half > 1e-9);
        prop_assert_eq!(f64::from(range.encode(x, bits)), expected);
    }

    #[test]
    fn a_command_arrives_within_half_a_step_of_each_field(
        position in -12.5..12.5_f64, velocity in -45.0..45.0_f64, kp in 0.0..500.0_f64, kd in 0.0..5.0_f64,
        torque in -18.0..18.0_f64,
    ) {
        let (drive, sent) = (knee(), Command { position, velocity, kp, kd, torque });
        let Ok(Instruction::Command(got)) = drive.instruction(&drive.command(&sent)) else { panic!() };
        let near = |a: f64, b: f64, range: &Range, bits| (a - b).abs() <= range.resolution(bits) * (0.5 + 1e-9);
        let r = drive.ranges();
        prop_assert!(near(got.position, position, &r.position, 16));
        prop_assert!(near(got.velocity, velocity, &r.velocity, 12));
        prop_assert!(near(got.kp, kp, &r.kp, 12));
        prop_assert!(near(got.kd, kd, &r.kd, 12));
        prop_assert!(near(got.torque, torque, &r.torque, 12));
    }

    #[test]
    fn an_answer_keeps_its_precision_over_two_round_trips(
        form in 0..5_usize, position in -8.0..8.0_f64, velocity in -8.0..8.0_f64, torque in -10.0..10.0_f64,
        temperature in 0..100_i32,
    ) {
        let drive = every_drive()[form];
        let temperature = Some(f64::from(temperature));
        let sent = Feedback { position, velocity, torque, temperature, voltage: Some(24.0), state: State::Unknown };
        let got = drive.reply(&drive.answer(&sent)).unwrap();
        let near = |a: f64, b: f64, range: &Range, bits| (a - b).abs() <= range.resolution(bits) * (0.5 + 1e-9);
        prop_assert!(near(got.position, position, &drive.ranges().position, 16));
        prop_assert!(near(got.velocity, velocity, &drive.ranges().velocity, 12));
        prop_assert!(near(got.torque, torque, &drive.ranges().torque, 12));
        prop_assert!(got.temperature.is_none() || got.temperature == temperature);
        prop_assert!(got.voltage.is_none_or(|voltage| (voltage - 24.0).abs() <= 40.0 / 255.0 / 2.0));
        prop_assert_eq!(drive.reply(&drive.answer(&got)).unwrap(), got);
    }
}

//! Packets of serial servos, compared with the manufacturers' manuals.

use motorium_can::servo::{
    FastReader, FastTurn, Instruction, LONGEST, Packet, Protocol, Reader, fast_sum, write, write_fast_status,
    write_status,
};
use motorium_can::{DecodeError, feetech};
use proptest::prelude::*;

fn bytes(hex: &str) -> Vec<u8> {
    hex.split(' ').map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn written(protocol: Protocol, servo: u8, instruction: &Instruction<'_>) -> Vec<u8> {
    let mut packet = [0; LONGEST];
    let length = write(protocol, servo, instruction, &mut packet).unwrap();
    packet[..length].to_vec()
}

/// Answer: servo, error and data.
type Answer = (u8, u8, Vec<u8>);

/// Answers in a stream of bytes.
fn read(bytes: &[u8]) -> Vec<Result<Answer, DecodeError>> {
    let mut reader = Reader::default();
    let mut found = Vec::new();
    for byte in bytes {
        if let Some(status) = reader.push(*byte) {
            found.push(status.map(|status| (status.servo, status.error, status.data.to_vec())));
        }
    }
    found
}

#[test]
fn packets_of_protocol_1_match_the_manual() {
    let one = |servo, instruction| written(Protocol::One, servo, &instruction);
    assert_eq!(one(1, Instruction::Ping), bytes("FF FF 01 02 01 FB"));
    assert_eq!(one(1, Instruction::Read { register: 0x2b, count: 1 }), bytes("FF FF 01 04 02 2B 01 CC"));
    let data = bytes("00 10 00 50 01 01 20 02 60 03 02 30 00 70 01 03 20 02 80 03");
    assert_eq!(
        one(9, Instruction::WriteMany { register: 0x1e, each: 4, data: &data }),
        bytes("FF FF FE 18 83 1E 04 00 10 00 50 01 01 20 02 60 03 02 30 00 70 01 03 20 02 80 03 12")
    );
    assert_eq!(read(&bytes("FF FF 01 02 00 FC")), [Ok((1, 0, vec![]))]);
    assert_eq!(read(&bytes("FF FF 01 03 00 20 DB")), [Ok((1, 0, vec![0x20]))]);
}

#[test]
fn packets_of_protocol_2_match_the_manual() {
    let two = |servo, instruction| written(Protocol::Two, servo, &instruction);
    assert_eq!(two(1, Instruction::Ping), bytes("FF FF FD 00 01 03 00 01 19 4E"));
    assert_eq!(
        two(1, Instruction::Read { register: 132, count: 4 }),
        bytes("FF FF FD 00 01 07 00 02 84 00 04 00 1D 15")
    );
    assert_eq!(
        two(1, Instruction::Write { register: 116, data: &[0, 2, 0, 0] }),
        bytes("FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89")
    );
    assert_eq!(read(&bytes("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D")), [Ok((1, 0, vec![6, 4, 0x26]))]);
    assert_eq!(
        read(&bytes("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0")),
        [Ok((1, 0, vec![0xa6, 0, 0, 0]))]
    );
}

#[test]
fn packets_to_many_servos_match_the_manual() {
    let data = bytes("01 00 02 00 00 02 C7 05 00 00");
    assert_eq!(
        written(Protocol::Two, 0xfe, &Instruction::WriteMany { register: 116, each: 4, data: &data }),
        bytes("FF FF FD 00 FE 11 00 83 74 00 04 00 01 00 02 00 00 02 C7 05 00 00 92 80")
    );
    let fast = Instruction::FastReadMany { register: 132, count: 4, servos: &[3, 7, 4] };
    assert_eq!(
        written(Protocol::Two, 0xfe, &fast),
        bytes("FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2")
    );
    // one packet; each servo writes its share, with the checksum of all previous bytes
    let whole = bytes(
        "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E",
    );
    let answers = |bytes: &[u8]| -> Vec<(u8, u8, Vec<u8>)> {
        let (mut reader, mut found) = (FastReader::default(), Vec::new());
        reader.expect(4);
        // split at any position
        for part in bytes.chunks(7) {
            reader.push(part);
            while let Some(Ok(status)) = reader.next() {
                found.push((status.servo, status.error, status.data.to_vec()));
            }
        }
        found
    };
    let expected = [(3, 0, vec![0xa6, 0, 0, 0]), (7, 0, vec![0x1f, 8, 0, 0]), (4, 0, vec![0xff, 3, 0, 0])];
    assert_eq!(answers(&whole), expected);
    // shares up to the first damaged one
    for (place, count) in [(10, 0), (15, 0), (18, 1), (28, 2), (5, 0)] {
        let mut broken = whole.clone();
        broken[place] ^= 1;
        assert_eq!(answers(&broken), expected[..count], "byte {place}");
    }
    assert_eq!(answers(&whole[..whole.len() - 1]), expected[..2], "the answers before a silent servo");
    // the servo side writes the same bytes
    let (mut said, mut share) = (Vec::new(), [0; LONGEST]);
    for (servo, error, data) in &expected {
        let sum = fast_sum(0, &said);
        let turn = if said.is_empty() { FastTurn::First { servos: 3 } } else { FastTurn::After { sum } };
        let length = write_fast_status(turn, *servo, *error, data, &mut share).unwrap();
        said.extend_from_slice(&share[..length]);
    }
    assert_eq!(said, whole);
    let mut packet = [0; LONGEST];
    assert_eq!(write(Protocol::One, 0xfe, &fast, &mut packet), None);
}

#[test]
fn both_protocols_are_read_from_a_noisy_line() {
    let stream = bytes(
        "00 FF 12 FF FF FF 01 03 00 20 DB 55 FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0 FF FF 01 02 00 FC",
    );
    assert_eq!(read(&stream), [Ok((1, 0, vec![0x20])), Ok((1, 0, vec![0xa6, 0, 0, 0])), Ok((1, 0, vec![]))]);
}

#[test]
fn oversized_packets_are_not_written() {
    let mut packet = [0; LONGEST];
    let mut refused =
        |protocol, instruction: Instruction<'_>| write(protocol, 1, &instruction, &mut packet).is_none();
    assert!(refused(Protocol::One, Instruction::Read { register: 256, count: 1 }));
    assert!(refused(Protocol::One, Instruction::Write { register: 0, data: &[0; 300] }));
    assert!(refused(Protocol::Two, Instruction::Write { register: 0, data: &[0; 250] }));
    assert!(refused(Protocol::One, Instruction::WriteMany { register: 0, each: 2, data: &[1, 0, 0, 2] }));
}

proptest! {
    #[test]
    fn answers_round_trip(
        two: bool, servo in 0..0xfd_u8, error: u8, data in prop::collection::vec(prop_oneof![Just(0xff_u8), Just(0xfd), any::<u8>()], 0..80),
    ) {
        let protocol = if two { Protocol::Two } else { Protocol::One };
        let mut packet = [0; LONGEST];
        let length = write_status(protocol, servo, error, &data, &mut packet).unwrap();
        prop_assert_eq!(read(&packet[..length]), vec![Ok((servo, error, data))]);
    }

    #[test]
    fn an_answer_with_one_flipped_bit_is_never_accepted(
        servo in 0..0xfd_u8, data in prop::collection::vec(any::<u8>(), 0..40), place: u16, bit in 0..8,
    ) {
        for protocol in [Protocol::One, Protocol::Two] {
            let mut packet = [0; LONGEST];
            let length = write_status(protocol, servo, 0, &data, &mut packet).unwrap();
            packet[usize::from(place) % length] ^= 1_u8 << bit;
            let whole = packet[..length].to_vec();
            prop_assert!(read(&whole).iter().all(|found| found.as_ref() != Ok(&(servo, 0, data.clone()))));
        }
    }

    #[test]
    fn no_byte_stream_makes_the_reader_panic(stream in prop::collection::vec(prop_oneof![Just(0xff_u8), Just(0xfd), Just(0), any::<u8>()], 0..600)) {
        read(&stream);
    }
}

#[test]
fn instructions_round_trip() {
    let data = [1, 0x00, 0x08, 2, 0xff, 0x0f];
    for (servo, instruction) in [
        (3, Instruction::Ping),
        (3, Instruction::Read { register: 56, count: 8 }),
        (3, Instruction::Write { register: 40, data: &[1] }),
        (0xfe, Instruction::WriteMany { register: 42, each: 2, data: &data }),
        (0xfe, Instruction::ReadMany { register: 40, count: 26, servos: &[1, 2, 3] }),
    ] {
        for protocol in [Protocol::One, Protocol::Two] {
            let packet = written(protocol, servo, &instruction);
            let mut reader = Packet::default();
            assert_eq!(reader.instruction(&packet), Ok((protocol, servo, instruction)));
            for place in 4..packet.len() {
                let mut broken = packet.clone();
                broken[place] ^= 0x10;
                assert!(reader.instruction(&broken).is_err(), "{broken:x?}");
            }
            assert!(reader.instruction(&packet[..packet.len() - 1]).is_err());
        }
    }
}

proptest! {
    #[test]
    fn no_packet_makes_a_servo_or_the_adapter_panic(bytes in prop::collection::vec(any::<u8>(), 0..64), whole in any::<bool>(), two in any::<bool>()) {
        let (mut bytes, mut packet) = (bytes, Packet::default());
        let mut reader = FastReader::default();
        reader.expect(4);
        bytes.chunks(9).for_each(|part| reader.push(part));
        while reader.next().is_some() {}
        if two && bytes.len() >= 10 {
            let (length, number) = ((bytes.len() - 7) as u8, bytes[4]);
            bytes[..7].copy_from_slice(&[0xff, 0xff, 0xfd, 0, number, length, 0]);
            let _ = packet.instruction(&bytes);
            let _ = packet.status(&bytes);
        }
        // most of them with a valid header and length
        if whole && bytes.len() >= 6 {
            bytes[..2].fill(0xff);
            bytes[3] = (bytes.len() - 4) as u8;
            let end = bytes.len() - 1;
            bytes[end] = !bytes[2..end].iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte));
        }
        let _ = packet.instruction(&bytes);
        if let Ok(status) = packet.status(&bytes)
            && let Ok(state) = feetech::State::decode(status.data)
        {
            prop_assert!(state.position.abs() <= core::f64::consts::PI && state.load.abs() <= 1.024 && state.velocity.is_finite());
        }
    }
}

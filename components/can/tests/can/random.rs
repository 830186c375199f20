//! Random frames: no frame makes a decoder panic, and encoding a decoded frame reproduces it.

use motorium_can::bus::slcan::{LONGEST, Line, Reader, write};
use motorium_can::drive::Ranges;
use motorium_can::{Database, Form, Frame, Id, cia402, damiao, mit, moteus, odrive};

const FRAMES: u64 = 10_000_000;

/// Pseudo-random numbers (splitmix64).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// Random frame, mostly with an identifier and a length that some device uses.
    fn frame(&mut self) -> Frame {
        let (choice, data) = (self.next(), self.next().to_le_bytes());
        let length = [8, 8, 8, 8, 6, 6, 4, 2, 1, 0, 3, 5, 7][(choice >> 8) as usize % 13];
        const USED: [u16; 12] =
            [0x000, 0x001, 0x011, 0x011, 0x7ff, 0x061, 0x069, 0x06c, 0x181, 0x281, 0x581, 0x701];
        let id = match choice % 16 {
            0 => Id::Extended((choice >> 32) as u32 & 0x1fff_ffff),
            1 => Id::Standard((choice >> 32) as u16 & 0x7ff),
            _ => Id::Standard(USED[(choice >> 16) as usize % USED.len()]),
        };
        let mut data = data;
        // most frames come from the queried device, or concern the requested register or object
        match choice >> 60 {
            0..=3 => data[0] = data[0] & 0xf0 | 1,
            4..=7 => data[0] = 1,
            8 => data[..4].copy_from_slice(&[1, 0, 0x33, 23]),
            9 => {
                data[0] = 0x43 | data[0] & 0x0c;
                data[1..4].copy_from_slice(&[0x60, 0x60, 0]);
            }
            _ => {}
        }
        Frame::new(id, Form::Classic, &data[..length]).unwrap()
    }
}

#[test]
fn ten_million_random_frames_cause_no_panic() {
    let mut numbers = Numbers(15);
    let forms = [
        mit::Reply::MiniCheetah,
        mit::Reply::MiniCheetahVoltage,
        mit::Reply::CubeMars,
        mit::Reply::Damiao,
        mit::Reply::RobStride,
    ];
    let drives = forms.map(|reply| {
        let id = Id::Standard(if reply == mit::Reply::MiniCheetah { 0 } else { 0x11 });
        mit::Drive::new(1, id, reply, Ranges::MINI_CHEETAH)
    });
    let (node, axis) = (cia402::Node::new(1).unwrap(), odrive::Node::new(3).unwrap());
    let request = damiao::Request { node: 1, register: damiao::Register::TorqueMax };
    let mut accepted = [0_u64; 8];
    for round in 0..FRAMES {
        let frame = numbers.frame();
        let drive = &drives[round as usize % drives.len()];
        if let Ok(feedback) = drive.reply(&frame) {
            accepted[0] += 1;
            let numbers = [feedback.position, feedback.velocity, feedback.torque];
            assert!(numbers.iter().all(|x| x.is_finite()), "{frame:?}");
            let again = drive.answer(&feedback);
            // the higher of two temperatures is kept, and an unused byte becomes zero
            assert_eq!(drive.reply(&again), Ok(feedback), "{frame:?}");
            assert_eq!(again.data()[..6], frame.data()[..6], "{frame:?}");
        }
        if let Ok(instruction) = drive.instruction(&frame) {
            accepted[1] += 1;
            assert_eq!(drive.instruct(&instruction), frame);
        }
        if let Ok(value) = request.value(&frame, Id::Standard(0x11)) {
            accepted[2] += 1;
            assert_eq!(request.answer(Id::Standard(0x11), value), frame);
        }
        if let Ok(report) = axis.report(&frame) {
            accepted[3] += 1;
            if let odrive::Report::Encoder { position, velocity } = report {
                assert!(position.is_finite() && velocity.is_finite());
            }
        }
        if axis.instruction(&frame).is_ok() {
            accepted[4] += 1;
        }
        if let Ok(process) = node.process(&frame) {
            accepted[5] += 1;
            assert_eq!(node.process_frame(&process), frame);
        }
        let read = cia402::Service::Read(cia402::Object::MODE);
        if node.service_result(&read, &frame).is_ok() || node.service_request(&frame).is_ok() {
            accepted[6] += 1;
        }
        if node.heartbeat(&frame).is_ok() || node.network_command(&frame).is_ok() {
            accepted[7] += 1;
        }
    }
    // The frames reach every decoder.
    for (place, least) in
        [(0, 100_000), (1, 100_000), (2, 10_000), (3, 10_000), (4, 100), (5, 10_000), (6, 100), (7, 100)]
    {
        assert!(accepted[place] >= least, "{accepted:?}");
    }
}

/// Number of frames in the tests below: `MOTORIUM_CAN_FRAMES`, or a default.
fn frames() -> u64 {
    let asked =
        std::env::var("MOTORIUM_CAN_FRAMES").ok().map(|text| text.parse().expect("a number of frames"));
    asked.unwrap_or(500_000)
}

/// Random CAN FD frame from or to drive 1, mostly with whole moteus subframes.
fn fd_frame(numbers: &mut Numbers) -> Frame {
    let mut bytes = Vec::with_capacity(64);
    let choice = numbers.next();
    while bytes.len() < 40 && !numbers.next().is_multiple_of(4) {
        let kind = numbers.next();
        // a reply or a write of some registers, starting with an existing one
        let action = [0x20, 0x20, 0x00, 0x10, 0x30, 0x70]
            [kind as usize % if choice.is_multiple_of(8) { 6 } else { 2 }];
        let resolution = (kind >> 8) as u8 % 4;
        let first = [0x00, 0x01, 0x0d, 0x20, 0x27][(kind >> 16) as usize % 5];
        let count = 1 + (kind >> 24) as u8 % 3;
        bytes.extend([action | resolution << 2 | count, first]);
        for register in (first..).take(count.into()) {
            let width = [1, 2, 4, 4][usize::from(resolution)];
            let number = if register == 0 { (kind >> 32) % 20 } else { numbers.next() };
            bytes.extend_from_slice(&number.to_le_bytes()[..width]);
        }
    }
    bytes.truncate(64);
    while Frame::new(Id::Standard(0), Form::FdFast, &bytes).is_none() {
        bytes.push(if choice % 16 == 1 { 0x20 } else { 0x50 });
    }
    let id = [Id::Standard(0x100), Id::Standard(0x100), Id::Extended(0x8001), Id::Extended(0x100)];
    Frame::new(id[(choice >> 8) as usize % 4], Form::FdFast, &bytes).unwrap()
}

#[test]
fn random_fd_frames_cause_no_panic_or_corrupt_value() {
    let (mut numbers, node) = (Numbers(16), moteus::Node::new(1).unwrap());
    let database = Database::parse(include_str!("databases/kinds.dbc")).unwrap();
    let mut accepted = [0_u64; 3];
    for _ in 0..frames() {
        let frame = fd_frame(&mut numbers);
        if let Ok(state) = node.reply(&frame) {
            accepted[0] += 1;
            let numbers = [state.position, state.velocity, state.torque, state.voltage, state.temperature];
            assert!(numbers.iter().all(|number| number.is_finite()), "{frame:?}");
            assert!((state.mode as u8) < 16, "{frame:?}");
            // a number at the end of its range may round to infinity
            if numbers.iter().all(|number| number.abs() < 1e37) {
                let again = node.reply(&node.reply_frame(&state, moteus::Resolution::Float)).unwrap();
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs() + 1e-44;
                assert!(
                    near(again.position, state.position) && near(again.torque, state.torque),
                    "{frame:?}"
                );
                assert_eq!((again.mode, again.fault), (state.mode, state.fault), "{frame:?}");
            }
        }
        if let Ok(instruction) = node.instruction(&frame) {
            accepted[1] += 1;
            if let moteus::Instruction::Position(command) = instruction {
                let numbers = [command.velocity, command.torque, command.kp_scale, command.kd_scale];
                assert!(numbers.iter().all(|number| number.is_finite()), "{frame:?}");
            }
        }
        // a database decodes frames of every length, and never reads beyond their end
        let named = Frame::new(
            Id::Standard([0x100, 0x200, 0x300, 0x400][frame.data().len() % 4]),
            frame.form,
            frame.data(),
        );
        accepted[2] +=
            u64::from(database.decode(&named.unwrap()).is_some_and(|message| !message.signals.is_empty()));
    }
    let share = frames() / 1000;
    assert!(accepted.iter().all(|count| *count > share / 10), "{accepted:?}");
}

#[test]
fn random_serial_lines_cause_no_panic() {
    let (mut numbers, mut reader) = (Numbers(17), Reader::default());
    let (mut read, mut torn) = (0_u64, 0_u64);
    for _ in 0..frames() / 4 {
        let mut line = [0; LONGEST];
        let sent = if numbers.next() % 2 == 0 { numbers.frame() } else { fd_frame(&mut numbers) };
        let length = write(&sent, &mut line);
        // half of the lines lack a byte or have a wrong one
        let choice = numbers.next();
        let place = (choice >> 8) as usize % length;
        if choice % 4 == 0 {
            line[place] = (choice >> 32) as u8;
        }
        let bytes = line[..length].iter().enumerate().filter(|(at, _)| choice % 4 != 1 || *at != place);
        for (_, byte) in bytes {
            if let Some(Line::Frame(found)) = reader.push(*byte) {
                read += 1;
                torn += u64::from(choice % 4 < 2);
                let mut again = [0; LONGEST];
                let length = write(&found, &mut again);
                assert!(length <= LONGEST && (choice % 4 < 2 || found == sent), "{found:?} {sent:?}");
            }
        }
        // terminates any damaged line
        reader.push(b'\r');
    }
    assert!(read > frames() / 10 && torn > 0, "{read} {torn}");
}

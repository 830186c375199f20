//! Random frames: none makes a decoder panic, and what it accepts is what it would send.

use motorium_can::{Form, Frame, Id, cia402, damiao, mit, odrive};

const FRAMES: u64 = 10_000_000;

/// Numbers that only look random: splitmix64.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A frame, most often with an identifier and a length that some device uses.
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
        // most of them from the device that is asked, or about the register or object that was asked for
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
fn of_ten_million_random_frames_none_panics_and_each_accepted_one_is_sent_the_same() {
    let mut numbers = Numbers(15);
    let forms = [
        mit::Reply::MiniCheetah,
        mit::Reply::MiniCheetahVoltage,
        mit::Reply::CubeMars,
        mit::Reply::Damiao,
        mit::Reply::RobStride,
    ];
    let drives = forms.map(|reply| mit::Drive {
        reply,
        reply_id: Id::Standard(if reply == mit::Reply::MiniCheetah { 0 } else { 0x11 }),
        ..mit::Drive::mini_cheetah(1)
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
            // temperatures of both kinds become the higher one, an unused byte zero
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

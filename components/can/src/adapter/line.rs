//! Packets of a serial line: one packet writes the goals of all servos, and one queries all servos.

use super::common_answer::CommonAnswer;
use super::{Link, OnTrip};
use crate::frame::Frame;
use crate::protocols::dialogue::Dialogue as _;
use crate::servo::{self, Instruction, LONGEST};

/// Length of the longest outgoing packet, bytes.
const PACKET: usize = 64;
/// Maximum number of written register blocks, and of read blocks.
const MOST: usize = 6;

/// Writes the packets of a cycle for all servos of a line, and records for each servo the number of frames
/// after which it has been queried. Servos answer together if supported, unless one was silent: all servos
/// after it would be silent, too.
pub(super) fn write(
    links: &mut [Link],
    common: Option<&mut CommonAnswer>,
    bus: usize,
    (trip, cycle): (Option<OnTrip>, u64),
    frames: &mut Vec<Frame>,
) {
    let before = frames.len();
    let mut members = links.iter().filter(|link| link.bus() == bus).filter_map(|link| link.dialogue.member());
    // all servos of a line have the same manufacturer
    let Some(layout) = members.next().map(|servo| servo.layout()) else { return };
    let mut out = Packets { protocol: layout.protocol, frames };
    let mut groups = [const { Group::new(0, 0) }; MOST];
    for (group, (register, each)) in groups.iter_mut().zip(layout.written) {
        *group = Group::new(*register, *each);
    }
    let mut askable = [false; MOST];
    for link in links.iter_mut().filter(|link| link.bus() == bus && !link.answers.is_probed) {
        let order = link.order(trip);
        let Some(servo) = link.dialogue.member_mut() else { continue };
        askable[servo.block(&order)] = true;
        let number = servo.number();
        servo.put(&order, &mut |group, bytes| groups[group].add(number, bytes, &mut out));
    }
    groups.iter_mut().for_each(|group| group.write(&mut out));
    // one query per cycle: servos would answer two of them simultaneously
    let blocks = askable.iter().filter(|is| **is).count() as u64;
    let Some(chosen) = (0..MOST).filter(|block| askable[*block]).nth((cycle % blocks.max(1)) as usize) else {
        return;
    };
    let mut servos = [0; PACKET];
    let mut count = 0;
    let asked_by = out.frames.len() - before + 1;
    for link in links.iter_mut().filter(|link| link.bus() == bus) {
        let order = link.order(trip);
        let Some(servo) = link.dialogue.member() else { continue };
        let is_asked = !link.answers.is_probed && servo.block(&order) == chosen;
        link.answers.asked_by = is_asked.then_some(asked_by);
        if is_asked && count < servos.len() {
            servos[count] = servo.number();
            count += 1;
        }
    }
    // the servos answer in this order; on a simulated line the lowest number answers first
    servos[..count].sort_unstable();
    let (register, bytes) = layout.read[chosen];
    let servos = &servos[..count];
    let is_whole =
        links.iter().all(|link| link.bus() != bus || link.answers.is_present() && !link.answers.is_probed);
    let together = is_whole && common.is_some_and(|common| common.ask(bytes));
    out.push(&match together {
        true => Instruction::FastReadMany { register, count: bytes, servos },
        false => Instruction::ReadMany { register, count: bytes, servos },
    });
}

/// Outgoing packets.
struct Packets<'a> {
    protocol: servo::Protocol,
    frames: &'a mut Vec<Frame>,
}

impl Packets<'_> {
    fn push(&mut self, instruction: &Instruction<'_>) {
        let mut packet = [0; LONGEST];
        let written = servo::write(self.protocol, servo::EVERYBODY, instruction, &mut packet);
        let frame = written.and_then(|length| Frame::packet(servo::EVERYBODY, &packet[..length]));
        debug_assert!(frame.is_some());
        self.frames.extend(frame);
    }
}

/// Register block of several servos, in as few packets as possible.
struct Group {
    register: u16,
    each: u8,
    data: [u8; PACKET],
    length: usize,
}

/// Bytes of a packet besides the servo data, including the byte stuffing of protocol 2, which needs more.
const AROUND: usize = 20;

impl Group {
    const fn new(register: u16, each: u8) -> Self {
        Self { register, each, data: [0; PACKET], length: 0 }
    }

    fn add(&mut self, servo: u8, bytes: &[u8], out: &mut Packets<'_>) {
        if self.length + 1 + bytes.len() > PACKET - AROUND {
            self.write(out);
        }
        self.data[self.length] = servo;
        self.data[self.length + 1..][..bytes.len()].copy_from_slice(bytes);
        self.length += 1 + bytes.len();
    }

    fn write(&mut self, out: &mut Packets<'_>) {
        if self.length > 0 {
            let data = &self.data[..self.length];
            out.push(&Instruction::WriteMany { register: self.register, each: self.each, data });
            self.length = 0;
        }
    }
}

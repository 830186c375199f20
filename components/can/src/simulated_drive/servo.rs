//! A simulated Feetech servo: a table of registers, and a position loop.

use super::Motor;
use crate::feetech::{self, OVERHEATED, STATE_BYTES, State, TORQUE_ENABLE};
use crate::frame::{Form, Frame, Id};
use crate::servo::{EVERYBODY, Instruction, LONGEST, Protocol, read_instruction, write_status};
use crate::table::{LoopEntry, Table};

/// Registers of the table.
const REGISTERS: usize = 128;
/// Supply voltage, V.
const VOLTAGE: f64 = 7.4;

/// A Feetech servo with its registers.
#[derive(Clone, Debug)]
pub struct Servo {
    number: u8,
    gains: LoopEntry,
    registers: [u8; REGISTERS],
    status: u8,
    pub(super) motor: Motor,
}

impl Servo {
    pub(super) fn new(table: &Table, index: usize) -> Self {
        let mut registers = [0; REGISTERS];
        let highest = (feetech::TURN as u16 - 1).to_le_bytes();
        registers[usize::from(feetech::ANGLE_LIMITS) + 2..][..2].copy_from_slice(&highest);
        Self {
            number: table.drives[index].node,
            gains: table.position_loop(index),
            registers,
            status: 0,
            motor: Motor::new(table.ranges(index).torque.max),
        }
    }

    pub(super) fn ids(&self) -> Vec<Id> {
        vec![Id::Standard(self.number.into()), Id::Standard(EVERYBODY.into())]
    }

    pub(super) fn is_enabled(&self) -> bool {
        self.registers[usize::from(TORQUE_ENABLE)] == 1
    }

    pub(super) fn cut_power(&mut self) {
        self.registers[usize::from(TORQUE_ENABLE)..].fill(0);
        self.status = 0;
    }

    pub(super) fn receive(&mut self, frame: &Frame) -> Option<Frame> {
        if frame.form != Form::Packet {
            return None;
        }
        let (servo, instruction) = read_instruction(frame.data()).ok()?;
        let is_meant = servo == self.number;
        match instruction {
            Instruction::Ping if is_meant => self.answer(0, 0),
            Instruction::Read { register, count } if is_meant => self.answer(register, count),
            Instruction::ReadMany { register, count, servos } if servos.contains(&self.number) => {
                self.answer(register, count)
            }
            Instruction::Write { register, data } if is_meant || servo == EVERYBODY => {
                self.write(register, data);
                if is_meant { self.answer(0, 0) } else { None }
            }
            Instruction::WriteMany { register, each, data } => {
                let mine = data.chunks(usize::from(each) + 1).find(|chunk| chunk[0] == self.number);
                if let Some([_, data @ ..]) = mine {
                    self.write(register, data);
                }
                None
            }
            _ => None,
        }
    }

    fn write(&mut self, register: u16, data: &[u8]) {
        let register = usize::from(register);
        if let Some(place) = self.registers.get_mut(register..register + data.len()) {
            place.copy_from_slice(data);
        }
        // torque that is switched on anew ends the error that switched it off
        let switch = usize::from(TORQUE_ENABLE);
        if (register..register + data.len()).contains(&switch) && self.registers[switch] == 0 {
            self.status = 0;
        }
    }

    fn answer(&mut self, register: u16, count: u8) -> Option<Frame> {
        let state = State {
            is_enabled: self.is_enabled(),
            position: self.motor.position,
            velocity: self.motor.velocity,
            load: self.motor.torque / self.motor.largest,
            voltage: VOLTAGE,
            temperature: self.motor.temperature,
            status: self.status,
        };
        let place =
            self.registers[usize::from(TORQUE_ENABLE)..].first_chunk_mut::<{ STATE_BYTES as usize }>()?;
        state.encode(place);
        let data = self.registers.get(usize::from(register)..usize::from(register) + usize::from(count))?;
        let mut packet = [0; LONGEST];
        let length = write_status(Protocol::One, self.number, self.status, data, &mut packet)?;
        Frame::packet(self.number, &packet[..length])
    }

    pub(super) fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        if self.is_enabled() && self.motor.is_too_hot() {
            self.status |= OVERHEATED;
            self.registers[usize::from(TORQUE_ENABLE)] = 0;
        }
        let place = usize::from(feetech::GOAL_POSITION);
        let goal = u16::from_le_bytes([self.registers[place], self.registers[place + 1]]);
        let LoopEntry { kp, kd } = self.gains;
        let wanted = kp * (feetech::position(goal) - position) - kd * velocity;
        self.motor.give(self.is_enabled().then_some(wanted))
    }
}

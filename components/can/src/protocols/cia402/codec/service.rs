//! Expedited service data: reads and writes of objects of up to four bytes, with one frame in each direction.

use super::{Mode, Node};
use crate::frame::{DecodeError, Frame, exactly};

/// Entry of the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index in the object dictionary.
    pub index: u16,
    /// Subindex of the object.
    pub subindex: u8,
}

impl Object {
    /// Monitored heartbeat: node ID in bits 16 to 22, time in ms in bits 0 to 15.
    pub const HEARTBEAT_CONSUMER: Self = Self { index: 0x1016, subindex: 1 };
    /// Period of the node's own heartbeat, ms.
    pub const HEARTBEAT_PRODUCER: Self = Self { index: 0x1017, subindex: 0 };
    /// Controlword: command to the state machine.
    pub const CONTROLWORD: Self = Self { index: 0x6040, subindex: 0 };
    /// Statusword: state of the state machine.
    pub const STATUSWORD: Self = Self { index: 0x6041, subindex: 0 };
    /// Requested mode of operation.
    pub const MODE: Self = Self { index: 0x6060, subindex: 0 };
    /// Active mode of operation.
    pub const MODE_DISPLAY: Self = Self { index: 0x6061, subindex: 0 };
    /// Position at the homing mark, increments.
    pub const HOME_OFFSET: Self = Self { index: 0x607c, subindex: 0 };
    /// Homing method.
    pub const HOMING_METHOD: Self = Self { index: 0x6098, subindex: 0 };
    /// Velocity towards the mark, increments per second.
    pub const HOMING_VELOCITY: Self = Self { index: 0x6099, subindex: 1 };
    /// Creep velocity at the mark, increments per second.
    pub const HOMING_CREEP_VELOCITY: Self = Self { index: 0x6099, subindex: 2 };
    /// Acceleration of a homing, increments per second squared.
    pub const HOMING_ACCELERATION: Self = Self { index: 0x609a, subindex: 0 };
    /// Rated torque of the motor, thousandths of N m.
    pub const RATED_TORQUE: Self = Self { index: 0x6076, subindex: 0 };
    /// Maximum current of the motor, thousandths of the rated current.
    pub const MAX_CURRENT: Self = Self { index: 0x6073, subindex: 0 };
    /// Rated current of the motor, mA.
    pub const RATED_CURRENT: Self = Self { index: 0x6075, subindex: 0 };
    /// Time between two setpoints, as a number of units.
    pub const INTERPOLATION_UNITS: Self = Self { index: 0x60c2, subindex: 1 };
    /// Exponent of the unit of [`INTERPOLATION_UNITS`](Self::INTERPOLATION_UNITS): the unit is this power of
    /// ten, in seconds.
    pub const INTERPOLATION_EXPONENT: Self = Self { index: 0x60c2, subindex: 2 };
    /// Supported modes of operation, one bit each.
    pub const SUPPORTED_MODES: Self = Self { index: 0x6502, subindex: 0 };

    /// Returns `true` for an object that defines the content of a process data frame.
    pub fn is_mapping(self) -> bool {
        matches!(self.index, 0x1600..=0x17ff | 0x1a00..=0x1bff)
    }
}

/// Configurable process data frame: its parameters, and the objects mapped into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Controlword and setpoint, received by the node.
    Setpoint,
    /// Statusword and position, sent by the node.
    Position,
    /// Velocity and torque, sent by the node.
    Motion,
}

impl Mapping {
    /// All mappings.
    pub const ALL: [Self; 3] = [Self::Setpoint, Self::Position, Self::Motion];
    /// Number of services to configure one mapping.
    pub const STEPS: u8 = 7;

    /// Returns the index of the parameters, index of the mapping, identifier for node 0, and mapped objects
    /// with their number of bits in the lowest byte.
    fn objects(self, mode: Mode) -> (u16, u16, u32, [u32; 2]) {
        let target = match mode {
            Mode::Position => 0x607a_0020,
            Mode::Velocity => 0x60ff_0020,
            Mode::Torque => 0x6071_0010,
        };
        match self {
            Self::Setpoint => (0x1400, 0x1600, 0x200, [0x6040_0010, target]),
            Self::Position => (0x1800, 0x1a00, 0x4000_0180, [0x6041_0010, 0x6064_0020]),
            Self::Motion => (0x1801, 0x1a01, 0x4000_0280, [0x606c_0020, 0x6077_0010]),
        }
    }

    /// Returns the service for step `step` of configuring this mapping. The steps switch the frame off, map
    /// its objects, make it synchronous, and switch it on.
    pub fn step(self, node: Node, mode: Mode, step: u8) -> Service {
        const OFF: u32 = 1 << 31;
        let (parameters, objects, id, mapped) = self.objects(mode);
        let id = id | u32::from(node.0);
        let at = |index, subindex| Object { index, subindex };
        match step {
            0 => Service::Write(at(parameters, 1), Value::long(id | OFF)),
            1 => Service::Write(at(objects, 0), Value::byte(0)),
            2 => Service::Write(at(objects, 1), Value::long(mapped[0])),
            3 => Service::Write(at(objects, 2), Value::long(mapped[1])),
            4 => Service::Write(at(objects, 0), Value::byte(2)),
            // transmission with each synchronisation
            5 => Service::Write(at(parameters, 2), Value::byte(1)),
            _ => Service::Write(at(parameters, 1), Value::long(id)),
        }
    }
}

/// Service of up to four bytes, with one frame in each direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Reads an object.
    Read(Object),
    /// Writes an object of 1, 2 or 4 bytes.
    Write(Object, Value),
}

/// Value of an object, least significant byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Value {
    bytes: [u8; 4],
    length: u8,
}

impl Value {
    /// Creates a value of one byte.
    pub fn byte(value: u8) -> Self {
        Self { bytes: [value, 0, 0, 0], length: 1 }
    }

    /// Creates a value of two bytes.
    pub fn word(value: u16) -> Self {
        let [a, b] = value.to_le_bytes();
        Self { bytes: [a, b, 0, 0], length: 2 }
    }

    /// Creates a value of four bytes.
    pub fn long(value: u32) -> Self {
        Self { bytes: value.to_le_bytes(), length: 4 }
    }

    /// Returns the value as an unsigned integer.
    pub fn number(self) -> u32 {
        u32::from_le_bytes(self.bytes)
    }

    /// Returns the number of bytes, 1 to 4.
    pub fn length(self) -> usize {
        self.length.into()
    }
}

impl Node {
    /// Returns the frame that requests a service.
    ///
    /// ```
    /// use motorium_can::cia402::{Mode, Node, Object, Service, Value};
    ///
    /// let node = Node::new(2).ok_or("1 to 127")?;
    /// let write = Service::Write(Object::MODE, Value::byte(Mode::Position as u8));
    /// assert_eq!(format!("{:?}", node.service(&write)), "0x602#2F60600008000000");
    /// # Ok::<(), &str>(())
    /// ```
    pub fn service(self, service: &Service) -> Frame {
        let (command, object, bytes) = match *service {
            Service::Read(object) => (0x40, object, [0; 4]),
            Service::Write(object, value) => (0x23 | (4 - value.length) << 2, object, value.bytes),
        };
        let ([low, high], [a, b, c, d]) = (object.index.to_le_bytes(), bytes);
        Frame::classic(self.id(0x600), &[command, low, high, object.subindex, a, b, c, d])
    }

    /// Decodes a service request that the node has received.
    ///
    /// # Errors
    /// Returns an error if the frame is not a service for this node, is not expedited, or has reserved bits
    /// set.
    pub fn service_request(self, frame: &Frame) -> Result<Service, DecodeError> {
        let data: &[u8; 8] = exactly(frame, self.id(0x600))?;
        let object = object(data);
        match data[0] {
            0x40 if data[4..] == [0; 4] => Ok(Service::Read(object)),
            command if command & 0xf3 == 0x23 => Ok(Service::Write(object, value(data)?)),
            found => Err(DecodeError::Field { field: "the service", found: found.into() }),
        }
    }

    /// Returns the frame with which the node answers a service: the value of a read, or an abort code.
    pub fn service_answer(self, service: &Service, answer: Result<Value, u32>) -> Frame {
        let (of, answer) = match (*service, answer) {
            (Service::Read(of) | Service::Write(of, _), Err(code)) => (of, (0x80, code.to_le_bytes())),
            (Service::Read(of), Ok(value)) => (of, (0x43 | (4 - value.length) << 2, value.bytes)),
            (Service::Write(of, _), Ok(_)) => (of, (0x60, [0; 4])),
        };
        let ([low, high], (command, [a, b, c, d])) = (of.index.to_le_bytes(), answer);
        Frame::classic(self.id(0x580), &[command, low, high, of.subindex, a, b, c, d])
    }

    /// Decodes the answer to a service. Returns the value of a read, or `None` for a write.
    ///
    /// # Errors
    /// Returns an error if the frame is not an answer of this node, concerns an object that was not
    /// requested, or is not expedited, or if the node refused the service.
    pub fn service_result(self, service: &Service, frame: &Frame) -> Result<Option<Value>, DecodeError> {
        let data: &[u8; 8] = exactly(frame, self.id(0x580))?;
        let (Service::Read(asked) | Service::Write(asked, _)) = *service;
        let found = object(data);
        let number = |object: Object| u32::from(object.index) << 8 | u32::from(object.subindex);
        if found != asked {
            return Err(DecodeError::Answer { found: number(found), expected: number(asked) });
        }
        match (data[0], service) {
            (0x80, _) => {
                Err(DecodeError::Refused { code: u32::from_le_bytes([data[4], data[5], data[6], data[7]]) })
            }
            (0x60, Service::Write(..)) if data[4..] == [0; 4] => Ok(None),
            (command, Service::Read(_)) if command & 0xf3 == 0x43 => value(data).map(Some),
            (found, _) => Err(DecodeError::Field { field: "the service", found: found.into() }),
        }
    }
}

fn object(data: &[u8; 8]) -> Object {
    Object { index: u16::from_le_bytes([data[1], data[2]]), subindex: data[3] }
}

/// Returns the value of an expedited transfer; unused bytes must be zero.
fn value(data: &[u8; 8]) -> Result<Value, DecodeError> {
    let length = 4 - (data[0] >> 2 & 0x3);
    let bytes = [data[4], data[5], data[6], data[7]];
    if bytes[usize::from(length)..].iter().any(|byte| *byte != 0) {
        return Err(DecodeError::Field { field: "an unused byte", found: u32::from_le_bytes(bytes) });
    }
    Ok(Value { bytes, length })
}

//! CANopen, as far as drives of the profile CiA 402 need it: network management, heartbeat, synchronisation, expedited
//! service data, process data in the cyclic modes.
//!
//! A drive goes through a state machine by `controlword` 0x6040 and tells its state in `statusword` 0x6041. Setpoints go
//! out once per synchronisation, and take effect with it.

use crate::frame::{DecodeError, Frame, Id, exactly};

/// A node of the network, 1 to 127.
///
/// ```
/// use motorium_can::cia402::{NetworkCommand, Node};
///
/// let node = Node::new(5).ok_or("1 to 127")?;
/// assert_eq!(format!("{:?}", node.network(NetworkCommand::Start)), "0x000#0105");
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node(u8);

/// A command of network management.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NetworkCommand {
    /// To *operational*: process data flow.
    Start = 0x01,
    /// To *stopped*: nothing but network management and heartbeat.
    Stop = 0x02,
    /// To *pre-operational*: service data, no process data.
    PreOperational = 0x80,
    /// Starts the device again.
    Reset = 0x81,
    /// Starts its communication again.
    ResetCommunication = 0x82,
}

/// The state of a node that its heartbeat tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NetworkState {
    /// It has just started.
    BootUp = 0x00,
    /// Nothing but network management and heartbeat.
    Stopped = 0x04,
    /// Process data flow.
    Operational = 0x05,
    /// Service data, no process data.
    PreOperational = 0x7f,
}

/// An entry of the object dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Its index.
    pub index: u16,
    /// Its subindex.
    pub subindex: u8,
}

impl Object {
    /// The heartbeats that the node waits for: node in bits 16 to 22, time in ms in bits 0 to 15.
    pub const HEARTBEAT_CONSUMER: Self = Self { index: 0x1016, subindex: 1 };
    /// The time between its own heartbeats, ms.
    pub const HEARTBEAT_PRODUCER: Self = Self { index: 0x1017, subindex: 0 };
    /// The command of the state machine.
    pub const CONTROLWORD: Self = Self { index: 0x6040, subindex: 0 };
    /// The state of the state machine.
    pub const STATUSWORD: Self = Self { index: 0x6041, subindex: 0 };
    /// The mode of operation.
    pub const MODE: Self = Self { index: 0x6060, subindex: 0 };
    /// The time between two setpoints: units.
    pub const INTERPOLATION_UNITS: Self = Self { index: 0x60c2, subindex: 1 };
    /// The time between two setpoints: power of ten of the unit in seconds.
    pub const INTERPOLATION_EXPONENT: Self = Self { index: 0x60c2, subindex: 2 };
}

/// A service of up to four bytes, in one frame each way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Reads an object.
    Read(Object),
    /// Writes an object of 1, 2 or 4 bytes.
    Write(Object, Value),
}

/// The value of an object, the least significant byte first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Value {
    bytes: [u8; 4],
    length: u8,
}

impl Value {
    /// A value of one byte.
    pub fn byte(value: u8) -> Self {
        Self { bytes: [value, 0, 0, 0], length: 1 }
    }

    /// A value of two bytes.
    pub fn word(value: u16) -> Self {
        let [a, b] = value.to_le_bytes();
        Self { bytes: [a, b, 0, 0], length: 2 }
    }

    /// A value of four bytes.
    pub fn long(value: u32) -> Self {
        Self { bytes: value.to_le_bytes(), length: 4 }
    }

    /// The number, without a sign.
    pub fn number(self) -> u32 {
        u32::from_le_bytes(self.bytes)
    }

    /// Bytes of the value, 1 to 4.
    pub fn length(self) -> usize {
        self.length.into()
    }
}

/// A cyclic mode: the drive follows the setpoint of each synchronisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// Cyclic synchronous position: object 0x607A.
    Position = 8,
    /// Cyclic synchronous velocity: object 0x60FF.
    Velocity = 9,
    /// Cyclic synchronous torque: object 0x6071, thousandths of the rated torque.
    Torque = 10,
}

/// The state of a drive's state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// It starts.
    NotReady,
    /// It cannot be switched on yet.
    SwitchOnDisabled,
    /// It may be switched on.
    ReadyToSwitchOn,
    /// It has power.
    SwitchedOn,
    /// It follows setpoints.
    Enabled,
    /// It comes to rest.
    QuickStop,
    /// It comes to rest because of a fault.
    FaultReaction,
    /// It lets go because of a fault.
    Fault,
}

impl DriveState {
    /// The state in a statusword.
    ///
    /// # Errors
    /// The bits belong to no state.
    pub fn of(statusword: u16) -> Result<Self, DecodeError> {
        Ok(match (statusword & 0x4f, statusword & 0x6f) {
            (0x00, _) => Self::NotReady,
            (0x40, _) => Self::SwitchOnDisabled,
            (_, 0x21) => Self::ReadyToSwitchOn,
            (_, 0x23) => Self::SwitchedOn,
            (_, 0x27) => Self::Enabled,
            (_, 0x07) => Self::QuickStop,
            (0x0f, _) => Self::FaultReaction,
            (0x08, _) => Self::Fault,
            _ => return Err(DecodeError::Field { field: "the statusword", found: statusword.into() }),
        })
    }

    /// The controlword of the next step towards enabled, or back to where that way begins.
    ///
    /// ```
    /// use motorium_can::cia402::DriveState;
    ///
    /// let way = [0x0250, 0x0231, 0x0233].map(|word| DriveState::of(word).map(|state| state.towards_enabled()));
    /// assert_eq!(way, [Ok(Some(6)), Ok(Some(7)), Ok(Some(0xf))]);
    /// ```
    pub fn towards_enabled(self) -> Option<u16> {
        match self {
            Self::SwitchOnDisabled => Some(0x06),
            Self::ReadyToSwitchOn => Some(0x07),
            Self::SwitchedOn | Self::Enabled => Some(0x0f),
            // to switch-on disabled
            Self::QuickStop => Some(0x00),
            // a fault is reset by a person's decision only
            Self::NotReady | Self::FaultReaction | Self::Fault => None,
        }
    }
}

/// The controlword that resets a fault, at its rising edge.
pub const FAULT_RESET: u16 = 0x80;
/// The controlword that takes the power from the motor.
pub const DISABLE_VOLTAGE: u16 = 0x00;

/// Setpoints of one cycle: the first process data that a node receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
    /// The controlword.
    pub controlword: u16,
    /// The setpoint of the mode, in the drive's units: increments, increments per second, or thousandths of the rated
    /// torque, which have 16 bits.
    pub target: i32,
}

/// What a node sends in each cycle, in two frames: statusword and position, then velocity and torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// The first process data of a node.
    Position {
        /// The statusword.
        statusword: u16,
        /// Actual position, increments.
        position: i32,
    },
    /// The second process data of a node.
    Motion {
        /// Actual velocity, increments per second.
        velocity: i32,
        /// Actual torque, thousandths of the rated torque.
        torque: i16,
    },
}

/// The frame of a synchronisation.
pub fn sync() -> Frame {
    Frame::classic(Id::Standard(0x080), &[])
}

/// An emergency message: error code, error register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// The error code; 0 when the last error is gone.
    pub code: u16,
    /// The error register, object 0x1001.
    pub register: u8,
}

impl Node {
    /// The node with this number; `None` for 0 and beyond 127.
    pub fn new(node: u8) -> Option<Self> {
        (1..128).contains(&node).then_some(Self(node))
    }

    fn id(self, base: u16) -> Id {
        Id::Standard(base | u16::from(self.0))
    }

    /// The frame of a command of network management.
    pub fn network(self, command: NetworkCommand) -> Frame {
        Frame::classic(Id::Standard(0x000), &[command as u8, self.0])
    }

    /// The node's side: the command in a frame, if it is for this node or for all.
    ///
    /// # Errors
    /// It is no such frame, for another node, or a command that there is not.
    pub fn network_command(self, frame: &Frame) -> Result<NetworkCommand, DecodeError> {
        let [command, node] = *exactly(frame, Id::Standard(0x000))?;
        if node != 0 && node != self.0 {
            return Err(DecodeError::Device { found: node, expected: self.0 });
        }
        let all = [
            NetworkCommand::Start,
            NetworkCommand::Stop,
            NetworkCommand::PreOperational,
            NetworkCommand::Reset,
            NetworkCommand::ResetCommunication,
        ];
        let found = all.into_iter().find(|known| *known as u8 == command);
        found.ok_or(DecodeError::Field { field: "the network command", found: command.into() })
    }

    /// The node's side: its heartbeat.
    pub fn heartbeat_frame(self, state: NetworkState) -> Frame {
        Frame::classic(self.id(0x700), &[state as u8])
    }

    /// The state in a heartbeat.
    ///
    /// # Errors
    /// It is no heartbeat of this node, or the state is unknown.
    pub fn heartbeat(self, frame: &Frame) -> Result<NetworkState, DecodeError> {
        match *exactly(frame, self.id(0x700))? {
            [0x00] => Ok(NetworkState::BootUp),
            [0x04] => Ok(NetworkState::Stopped),
            [0x05] => Ok(NetworkState::Operational),
            [0x7f] => Ok(NetworkState::PreOperational),
            [found] => Err(DecodeError::Field { field: "the network state", found: found.into() }),
        }
    }

    /// The emergency message in a frame.
    ///
    /// # Errors
    /// It is no emergency message of this node.
    pub fn emergency(self, frame: &Frame) -> Result<Emergency, DecodeError> {
        let [low, high, register, ..]: [u8; 8] = *exactly(frame, self.id(0x080))?;
        Ok(Emergency { code: u16::from_le_bytes([low, high]), register })
    }

    /// The frame of a service.
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

    /// The node's side: the service that a frame asks for.
    ///
    /// # Errors
    /// It is no service of this node, not expedited, or reserved bits are set.
    pub fn service_request(self, frame: &Frame) -> Result<Service, DecodeError> {
        let data: &[u8; 8] = exactly(frame, self.id(0x600))?;
        let object = object(data);
        match data[0] {
            0x40 if data[4..] == [0; 4] => Ok(Service::Read(object)),
            command if command & 0xf3 == 0x23 => Ok(Service::Write(object, value(data)?)),
            found => Err(DecodeError::Field { field: "the service", found: found.into() }),
        }
    }

    /// The node's side: the frame that answers a service with this value (of a reading), or with a code that refuses it.
    pub fn service_answer(self, service: &Service, answer: Result<Value, u32>) -> Frame {
        let (of, answer) = match (*service, answer) {
            (Service::Read(of) | Service::Write(of, _), Err(code)) => (of, (0x80, code.to_le_bytes())),
            (Service::Read(of), Ok(value)) => (of, (0x43 | (4 - value.length) << 2, value.bytes)),
            (Service::Write(of, _), Ok(_)) => (of, (0x60, [0; 4])),
        };
        let ([low, high], (command, [a, b, c, d])) = (of.index.to_le_bytes(), answer);
        Frame::classic(self.id(0x580), &[command, low, high, of.subindex, a, b, c, d])
    }

    /// The answer to a service: of a reading the value.
    ///
    /// # Errors
    /// It is no answer of this node, about another object, not expedited, or the node refused.
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

    /// The frame of the setpoints of one cycle: 6 bytes, in the torque mode 4.
    pub fn setpoint(self, mode: Mode, setpoint: &Setpoint) -> Frame {
        let ([c0, c1], [a, b, c, d]) = (setpoint.controlword.to_le_bytes(), setpoint.target.to_le_bytes());
        if mode == Mode::Torque {
            let limited = setpoint.target.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
            let [a, b] = limited.to_le_bytes();
            return Frame::classic(self.id(0x200), &[c0, c1, a, b]);
        }
        Frame::classic(self.id(0x200), &[c0, c1, a, b, c, d])
    }

    /// The node's side: the setpoints in a frame.
    ///
    /// # Errors
    /// It is no such frame of this node, or of another mode.
    pub fn setpoint_of(self, mode: Mode, frame: &Frame) -> Result<Setpoint, DecodeError> {
        let word = |low, high| u16::from_le_bytes([low, high]);
        if mode == Mode::Torque {
            let [c0, c1, a, b]: [u8; 4] = *exactly(frame, self.id(0x200))?;
            let target = i16::from_le_bytes([a, b]).into();
            return Ok(Setpoint { controlword: word(c0, c1), target });
        }
        let [c0, c1, a, b, c, d]: [u8; 6] = *exactly(frame, self.id(0x200))?;
        Ok(Setpoint { controlword: word(c0, c1), target: i32::from_le_bytes([a, b, c, d]) })
    }

    /// The node's side: a frame of its process data.
    pub fn process_frame(self, process: &Process) -> Frame {
        match *process {
            Process::Position { statusword, position } => {
                let ([s0, s1], [a, b, c, d]) = (statusword.to_le_bytes(), position.to_le_bytes());
                Frame::classic(self.id(0x180), &[s0, s1, a, b, c, d])
            }
            Process::Motion { velocity, torque } => {
                let ([a, b, c, d], [t0, t1]) = (velocity.to_le_bytes(), torque.to_le_bytes());
                Frame::classic(self.id(0x280), &[a, b, c, d, t0, t1])
            }
        }
    }

    /// The process data in a frame.
    ///
    /// # Errors
    /// It is no process data of this node, has another length, or a statusword without a state.
    pub fn process(self, frame: &Frame) -> Result<Process, DecodeError> {
        if frame.id == self.id(0x280) {
            let [a, b, c, d, t0, t1]: [u8; 6] = *exactly(frame, self.id(0x280))?;
            let (velocity, torque) = (i32::from_le_bytes([a, b, c, d]), i16::from_le_bytes([t0, t1]));
            return Ok(Process::Motion { velocity, torque });
        }
        let [s0, s1, a, b, c, d]: [u8; 6] = *exactly(frame, self.id(0x180))?;
        let statusword = u16::from_le_bytes([s0, s1]);
        DriveState::of(statusword)?;
        Ok(Process::Position { statusword, position: i32::from_le_bytes([a, b, c, d]) })
    }
}

fn object(data: &[u8; 8]) -> Object {
    Object { index: u16::from_le_bytes([data[1], data[2]]), subindex: data[3] }
}

/// The value of an expedited transfer; the bytes that it does not use must be zero.
fn value(data: &[u8; 8]) -> Result<Value, DecodeError> {
    let length = 4 - (data[0] >> 2 & 0x3);
    let bytes = [data[4], data[5], data[6], data[7]];
    if bytes[usize::from(length)..].iter().any(|byte| *byte != 0) {
        return Err(DecodeError::Field { field: "an unused byte", found: u32::from_le_bytes(bytes) });
    }
    Ok(Value { bytes, length })
}

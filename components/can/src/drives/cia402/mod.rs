//! CANopen, as far as drives of the profile CiA 402 need it: network management, heartbeat, synchronisation,
//! expedited service data, process data in the cyclic modes.
//!
//! `controlword` 0x6040 moves a drive through its state machine, and `statusword` 0x6041 reports its state.
//! Setpoints are sent once per synchronisation, and take effect with it.

pub mod eds;
mod service;

use crate::frame::{DecodeError, Frame, Id, exactly};

pub use service::{Mapping, Object, Service, Value};

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

/// State of a node, as reported by its heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NetworkState {
    /// Just started.
    BootUp = 0x00,
    /// Nothing but network management and heartbeat.
    Stopped = 0x04,
    /// Process data flow.
    Operational = 0x05,
    /// Service data, no process data.
    PreOperational = 0x7f,
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
    /// Starting.
    NotReady,
    /// Cannot be switched on yet.
    SwitchOnDisabled,
    /// Can be switched on.
    ReadyToSwitchOn,
    /// Has power.
    SwitchedOn,
    /// Follows setpoints.
    Enabled,
    /// Stopping.
    QuickStop,
    /// Stopping because of a fault.
    FaultReaction,
    /// Disabled because of a fault.
    Fault,
}

impl DriveState {
    /// The state in a statusword.
    ///
    /// # Errors
    /// The bits belong to no state.
    pub fn from_statusword(statusword: u16) -> Result<Self, DecodeError> {
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

    /// The controlword of the next step towards enabled, or back to the beginning of that sequence.
    ///
    /// ```
    /// use motorium_can::cia402::DriveState;
    ///
    /// let way = [0x0250, 0x0231, 0x0233].map(|word| DriveState::from_statusword(word).map(|state| state.towards_enabled()));
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
/// The controlword that removes the power from the motor.
pub const DISABLE_VOLTAGE: u16 = 0x00;

/// The mode of operation in which a drive looks for its mark.
pub const HOMING_MODE: u8 = 6;
/// Bit of the controlword that starts a homing.
pub const HOMING_START: u16 = 1 << 4;

/// The progress of a homing, in bits 10, 12 and 13 of the statusword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingStatus {
    /// Running, or not started.
    Running,
    /// The mark has been found, and the drive is at rest.
    Attained,
    /// Failed.
    Failed,
}

impl HomingStatus {
    /// The progress in a statusword.
    ///
    /// ```
    /// use motorium_can::cia402::HomingStatus;
    ///
    /// let all = [0x0237, 0x1237, 0x1637, 0x2637].map(HomingStatus::from_statusword);
    /// assert_eq!(all, [HomingStatus::Running, HomingStatus::Running, HomingStatus::Attained, HomingStatus::Failed]);
    /// ```
    pub fn from_statusword(statusword: u16) -> Self {
        match (statusword >> 13 & 1, statusword >> 12 & 1, statusword >> 10 & 1) {
            (1, ..) => Self::Failed,
            (_, 1, 1) => Self::Attained,
            _ => Self::Running,
        }
    }
}

/// Setpoints of one cycle: the first process data that a node receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
    /// The controlword.
    pub controlword: u16,
    /// The setpoint of the mode, in the drive's units: increments, increments per second, or thousandths of
    /// the rated torque, which have 16 bits.
    pub target: i32,
}

/// The process data that a node sends in each cycle, in two frames: statusword and position, then velocity
/// and torque.
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

/// Heartbeat frame of the adapter, node 127: the drives disable themselves without it.
pub fn adapter_heartbeat() -> Frame {
    Frame::classic(Id::Standard(0x700 | u16::from(ADAPTER)), &[NetworkState::Operational as u8])
}

/// The number of the adapter among the nodes.
pub const ADAPTER: u8 = 127;

/// An emergency message: error code, error register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// The error code; 0 when the last error is gone.
    pub code: u16,
    /// The error register, object 0x1001.
    pub register: u8,
}

impl Node {
    /// The node with the lowest number.
    pub(crate) const FIRST: Self = Self(1);

    /// The node with this number; `None` for 0 and beyond 127.
    pub fn new(node: u8) -> Option<Self> {
        (1..128).contains(&node).then_some(Self(node))
    }

    /// The identifier of one of its messages.
    pub(crate) fn id(self, base: u16) -> Id {
        Id::Standard(base | u16::from(self.0))
    }

    /// The frame of a command of network management.
    pub fn network(self, command: NetworkCommand) -> Frame {
        Frame::classic(Id::Standard(0x000), &[command as u8, self.0])
    }

    /// The node's side: the command in a frame, if it is for this node or for all.
    ///
    /// # Errors
    /// Another kind of frame, for another node, or with an unknown command.
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
    /// Not a heartbeat of this node, or an unknown state.
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
    /// Not an emergency message of this node.
    pub fn emergency(self, frame: &Frame) -> Result<Emergency, DecodeError> {
        let [low, high, register, ..]: [u8; 8] = *exactly(frame, self.id(0x080))?;
        Ok(Emergency { code: u16::from_le_bytes([low, high]), register })
    }

    /// The node's side: the frame of an emergency message.
    pub fn emergency_frame(self, emergency: &Emergency) -> Frame {
        let [low, high] = emergency.code.to_le_bytes();
        Frame::classic(self.id(0x080), &[low, high, emergency.register, 0, 0, 0, 0, 0])
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
    /// Not such a frame of this node, or of another mode.
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
    /// No process data of this node, another length, or a statusword without a state.
    pub fn process(self, frame: &Frame) -> Result<Process, DecodeError> {
        if frame.id == self.id(0x280) {
            let [a, b, c, d, t0, t1]: [u8; 6] = *exactly(frame, self.id(0x280))?;
            let (velocity, torque) = (i32::from_le_bytes([a, b, c, d]), i16::from_le_bytes([t0, t1]));
            return Ok(Process::Motion { velocity, torque });
        }
        let [s0, s1, a, b, c, d]: [u8; 6] = *exactly(frame, self.id(0x180))?;
        let statusword = u16::from_le_bytes([s0, s1]);
        DriveState::from_statusword(statusword)?;
        Ok(Process::Position { statusword, position: i32::from_le_bytes([a, b, c, d]) })
    }
}

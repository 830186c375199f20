//! Subset of CANopen for drives with the CiA 402 profile: network management, heartbeat, synchronisation,
//! expedited service data, and process data in the cyclic modes.
//!
//! The controlword 0x6040 drives the state machine of a drive, and the statusword 0x6041 reports its state.
//! Setpoints are sent once per synchronisation frame, and take effect when that frame arrives.

pub mod eds;
mod service;

use crate::frame::{DecodeError, Frame, Id, exactly};

pub use service::{Mapping, Object, Service, Value};

/// Node of the network, 1 to 127.
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

/// Network management command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NetworkCommand {
    /// Enters *operational*: process data are exchanged.
    Start = 0x01,
    /// Enters *stopped*: only network management and heartbeat remain active.
    Stop = 0x02,
    /// Enters *pre-operational*: service data are exchanged, but no process data.
    PreOperational = 0x80,
    /// Restarts the device.
    Reset = 0x81,
    /// Restarts the communication of the device.
    ResetCommunication = 0x82,
}

/// State of a node, reported by its heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NetworkState {
    /// The node has just started.
    BootUp = 0x00,
    /// Only network management and heartbeat are active.
    Stopped = 0x04,
    /// Process data are exchanged.
    Operational = 0x05,
    /// Service data are exchanged, but no process data.
    PreOperational = 0x7f,
}

/// Cyclic mode: the drive follows the setpoint of each synchronisation.
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

/// State of a drive's state machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveState {
    /// *Not ready to switch on*: the drive is starting.
    NotReady,
    /// *Switch on disabled*: the drive cannot be switched on yet.
    SwitchOnDisabled,
    /// *Ready to switch on*.
    ReadyToSwitchOn,
    /// *Switched on*: the drive has power.
    SwitchedOn,
    /// *Operation enabled*: the drive follows setpoints.
    Enabled,
    /// *Quick stop active*: the drive is stopping.
    QuickStop,
    /// *Fault reaction active*: the drive is stopping because of a fault.
    FaultReaction,
    /// *Fault*: the drive is disabled because of a fault.
    Fault,
}

impl DriveState {
    /// Decodes the state in a statusword.
    ///
    /// # Errors
    /// Returns an error if the bits do not represent a state.
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

    /// Returns the controlword for the next transition towards *operation enabled*. From *quick stop active*,
    /// the transition leads back to *switch on disabled*. `None` while the drive is starting or has a fault.
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
            // to *switch on disabled*
            Self::QuickStop => Some(0x00),
            // the operator decides when to reset a fault
            Self::NotReady | Self::FaultReaction | Self::Fault => None,
        }
    }
}

/// Controlword that resets a fault at its rising edge.
pub const FAULT_RESET: u16 = 0x80;
/// Controlword that removes power from the motor.
pub const DISABLE_VOLTAGE: u16 = 0x00;

/// Mode of operation for homing.
pub const HOMING_MODE: u8 = 6;
/// Bit of the controlword that starts a homing.
pub const HOMING_START: u16 = 1 << 4;

/// Progress of a homing, in bits 10, 12 and 13 of the statusword.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingStatus {
    /// Homing is running, or has not been started.
    Running,
    /// The mark has been found, and the drive is at rest.
    Attained,
    /// Homing has failed.
    Failed,
}

impl HomingStatus {
    /// Decodes the progress of a homing in a statusword.
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

/// Setpoints of one cycle: the first receive process data object (RPDO) of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Setpoint {
    /// Controlword.
    pub controlword: u16,
    /// Setpoint of the mode: position in increments, velocity in increments per second, or torque in
    /// thousandths of the rated torque (16 bits).
    pub target: i32,
}

/// Process data that a node sends in each cycle, in two frames: statusword and position, then velocity and
/// torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Process {
    /// First transmit process data object (TPDO) of a node.
    Position {
        /// Statusword.
        statusword: u16,
        /// Actual position, increments.
        position: i32,
    },
    /// Second transmit process data object (TPDO) of a node.
    Motion {
        /// Actual velocity, increments per second.
        velocity: i32,
        /// Actual torque, thousandths of the rated torque.
        torque: i16,
    },
}

/// Returns the synchronisation frame.
pub fn sync() -> Frame {
    Frame::classic(Id::Standard(0x080), &[])
}

/// Returns the heartbeat frame of the adapter, node 127. Drives disable themselves when the heartbeat stops.
pub fn adapter_heartbeat() -> Frame {
    Frame::classic(Id::Standard(0x700 | u16::from(ADAPTER)), &[NetworkState::Operational as u8])
}

/// Node ID of the adapter.
pub const ADAPTER: u8 = 127;

/// Emergency message: error code and error register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code; 0 when the last error has cleared.
    pub code: u16,
    /// Error register, object 0x1001.
    pub register: u8,
}

impl Node {
    /// Node with the lowest ID.
    pub(crate) const FIRST: Self = Self(1);

    /// Creates the node with ID `node`; `None` for 0 and above 127.
    pub fn new(node: u8) -> Option<Self> {
        (1..128).contains(&node).then_some(Self(node))
    }

    /// Returns the identifier of one of the node's messages.
    pub(crate) fn id(self, base: u16) -> Id {
        Id::Standard(base | u16::from(self.0))
    }

    /// Returns the frame of a network management command.
    pub fn network(self, command: NetworkCommand) -> Frame {
        Frame::classic(Id::Standard(0x000), &[command as u8, self.0])
    }

    /// Decodes a network management command that the node has received, for this node or for all nodes.
    ///
    /// # Errors
    /// Returns an error if the frame is not a network management command, is for another node, or has an
    /// unknown command.
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

    /// Returns the frame with which the node sends its heartbeat.
    pub fn heartbeat_frame(self, state: NetworkState) -> Frame {
        Frame::classic(self.id(0x700), &[state as u8])
    }

    /// Decodes the state in a heartbeat.
    ///
    /// # Errors
    /// Returns an error if the frame is not a heartbeat of this node, or if the state is unknown.
    pub fn heartbeat(self, frame: &Frame) -> Result<NetworkState, DecodeError> {
        match *exactly(frame, self.id(0x700))? {
            [0x00] => Ok(NetworkState::BootUp),
            [0x04] => Ok(NetworkState::Stopped),
            [0x05] => Ok(NetworkState::Operational),
            [0x7f] => Ok(NetworkState::PreOperational),
            [found] => Err(DecodeError::Field { field: "the network state", found: found.into() }),
        }
    }

    /// Decodes an emergency message.
    ///
    /// # Errors
    /// Returns an error if the frame is not an emergency message of this node.
    pub fn emergency(self, frame: &Frame) -> Result<Emergency, DecodeError> {
        let [low, high, register, ..]: [u8; 8] = *exactly(frame, self.id(0x080))?;
        Ok(Emergency { code: u16::from_le_bytes([low, high]), register })
    }

    /// Returns the frame with which the node sends an emergency message.
    pub fn emergency_frame(self, emergency: &Emergency) -> Frame {
        let [low, high] = emergency.code.to_le_bytes();
        Frame::classic(self.id(0x080), &[low, high, emergency.register, 0, 0, 0, 0, 0])
    }

    /// Returns the frame with the setpoints of one cycle: 6 bytes, or 4 in the torque mode.
    pub fn setpoint(self, mode: Mode, setpoint: &Setpoint) -> Frame {
        let ([c0, c1], [a, b, c, d]) = (setpoint.controlword.to_le_bytes(), setpoint.target.to_le_bytes());
        if mode == Mode::Torque {
            let limited = setpoint.target.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
            let [a, b] = limited.to_le_bytes();
            return Frame::classic(self.id(0x200), &[c0, c1, a, b]);
        }
        Frame::classic(self.id(0x200), &[c0, c1, a, b, c, d])
    }

    /// Decodes the setpoints in a frame that the node has received.
    ///
    /// # Errors
    /// Returns an error if the frame does not contain setpoints for this node, or if its length does not
    /// match `mode`.
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

    /// Returns the frame with which the node sends process data.
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

    /// Decodes process data.
    ///
    /// # Errors
    /// Returns an error if the frame is not process data of this node, has the wrong length, or has a
    /// statusword without a valid state.
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

/// Returns the nearest integer; halves round away from zero.
pub(crate) fn nearest(x: f64) -> i32 {
    if x < 0.0 { (x - 0.5) as i32 } else { (x + 0.5) as i32 }
}

//! Dialogue with CiA 402 drives: first service data, one object per cycle, then process data with each
//! synchronisation.
//!
//! The set-up stops process data, maps them, configures the adapter's heartbeat as the drive's watchdog, and
//! compares the rated torque with the table. Then it starts the node, and uses the controlword to advance the
//! state machine to *operation enabled*.

mod emergency;
mod homing;
mod stage;

use core::f64::consts::TAU;

use super::codec::{
    ADAPTER, DISABLE_VOLTAGE, DriveState, FAULT_RESET, Mapping, Mode, NetworkCommand, NetworkState, Node,
    Object, Process, Service, Setpoint, Value, adapter_heartbeat, nearest, sync,
};
use super::data_sheet::fixed_mappings;
use super::homing_objects::HomingObjects;
use crate::drive::{Command, Feedback, Ranges, State};
use crate::frame::{DecodeError, Form, Frame};
use crate::protocols::dialogue::{Dialogue, Motion, Order, Response};
use crate::protocols::entries::{ControlMode, LoopEntry};
use crate::protocols::homing_fault::HomingFault;
use crate::protocols::setting::WrongSetting;
use crate::protocols::spec::DriveSetup;
use emergency::{fault, response};
use stage::Stage;

#[derive(Clone, Debug)]
pub(crate) struct Cia402 {
    node: Node,
    mode: ControlMode,
    watchdog_ms: u16,
    increments: f64,
    rated_torque: f64,
    /// Maximum and rated current, A; `None` keeps the limit stored in the drive.
    currents: Option<[f64; 2]>,
    /// Homing objects, if the drive homes with its own procedure.
    homes: Option<HomingObjects>,
    homing: Stage,
    ranges: Ranges,
    gains: LoopEntry,
    /// Process data with a read-only mapping, which is only compared.
    fixed: Vec<Mapping>,
    /// Time between two synchronisations, ns.
    cycle_ns: u64,
    /// `true` if process data have been started.
    is_started: bool,
    /// Remaining cycles of the fault reset.
    clears: u8,
    state: DriveState,
    motion: Motion,
    /// `true` if the statusword and position of this cycle have arrived.
    has_position: bool,
    /// Position of this cycle, rad.
    read_position: f64,
    /// Number of consecutive reads of the mode display that returned another mode.
    mode_reads: u8,
    /// Code of the last emergency message.
    emergency: u16,
    /// `true` if a heartbeat has arrived since the settings were written. From then on, the heartbeat is
    /// monitored.
    is_beating: bool,
}

/// Duration of a fault reset, cycles.
const CLEARS: u8 = 4;
/// Index of the first setting after the mappings.
const WATCHDOG: u8 = Mapping::ALL.len() as u8 * Mapping::STEPS;
const READ_WATCHDOG: u8 = WATCHDOG + 1;
const MODE: u8 = WATCHDOG + 2;
const READ_MODE: u8 = WATCHDOG + 3;
const INTERPOLATION_UNITS: u8 = WATCHDOG + 4;
const INTERPOLATION_EXPONENT: u8 = WATCHDOG + 5;
const RATED_TORQUE: u8 = WATCHDOG + 6;
const HEARTBEAT: u8 = WATCHDOG + 7;
const SETTINGS: u8 = WATCHDOG + 8;
/// Heartbeat period of a drive, ms. It is long enough not to delay process data, whose loss is detected
/// within three cycles.
const HEARTBEAT_MS: u16 = 1000;
/// Maximum time between two heartbeats, ns: two periods, plus half a period for bus delays.
const HEARTBEAT_WITHIN_NS: u64 = 2_500_000 * HEARTBEAT_MS as u64;
/// Number of reads of the mode display after which a written mode counts as refused.
const MODE_READS: u8 = 100;
/// Settings of a drive with a current limit.
const LIMITED: [Extra; 2] = [Extra::RatedCurrent, Extra::MaxCurrent];
/// Settings of a drive with its own homing procedure.
const HOMED: [Extra; 5] = [
    Extra::Homing(Object::HOMING_METHOD),
    Extra::Homing(Object::HOMING_VELOCITY),
    Extra::Homing(Object::HOMING_CREEP_VELOCITY),
    Extra::Homing(Object::HOMING_ACCELERATION),
    Extra::Homing(Object::HOME_OFFSET),
];

/// Optional setting of a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Extra {
    RatedCurrent,
    MaxCurrent,
    Homing(Object),
}

impl Cia402 {
    pub(crate) fn new(setup: &DriveSetup<'_>) -> Self {
        let entry = setup.entry;
        Self {
            node: Node::new(entry.node).unwrap_or(Node::FIRST),
            mode: entry.mode.unwrap_or_default(),
            watchdog_ms: u16::try_from(entry.watchdog.ns / 1_000_000).unwrap_or(u16::MAX),
            increments: entry.increments.unwrap_or(1.0),
            rated_torque: entry.rated_torque.unwrap_or(1.0),
            currents: entry.current_limit.zip(entry.rated_current).map(|(limit, rated)| [limit, rated]),
            homes: HomingObjects::from_entry(entry),
            homing: Stage::None,
            ranges: setup.ranges,
            gains: setup.gains,
            fixed: fixed_mappings(entry),
            cycle_ns: 1_000_000,
            is_started: false,
            clears: 0,
            state: DriveState::NotReady,
            motion: Motion::default(),
            has_position: false,
            read_position: 0.0,
            mode_reads: 0,
            emergency: 0,
            is_beating: false,
        }
    }

    /// Returns the optional settings of this drive, in addition to the common ones.
    fn extras(&self) -> impl Iterator<Item = Extra> {
        let limited = LIMITED.into_iter().filter(|_| self.currents.is_some());
        limited.chain(HOMED.into_iter().filter(|_| self.homes.is_some()))
    }

    fn extra(&self, setting: u8) -> Option<Extra> {
        self.extras().nth(setting.checked_sub(SETTINGS)?.into())
    }

    fn cyclic(&self) -> Mode {
        match self.mode {
            ControlMode::Position => Mode::Position,
            ControlMode::Velocity => Mode::Velocity,
            ControlMode::Torque => Mode::Torque,
        }
    }

    /// Returns the service that checks or writes a setting.
    fn setting(&self, setting: u8) -> Service {
        let tenths = self.cycle_ns / 100_000;
        // tenths of a millisecond if the period is a whole number of them and fits, otherwise milliseconds
        let (units, exponent) = match tenths {
            1..=255 if self.cycle_ns.is_multiple_of(100_000) => (tenths, -4_i8),
            _ => ((self.cycle_ns / 1_000_000).clamp(1, 255), -3_i8),
        };
        match setting {
            WATCHDOG => {
                let waits = u32::from(ADAPTER) << 16 | u32::from(self.watchdog_ms);
                Service::Write(Object::HEARTBEAT_CONSUMER, Value::long(waits))
            }
            READ_WATCHDOG => Service::Read(Object::HEARTBEAT_CONSUMER),
            MODE => Service::Write(Object::MODE, Value::byte(self.cyclic() as u8)),
            READ_MODE => Service::Read(Object::MODE_DISPLAY),
            INTERPOLATION_UNITS => Service::Write(Object::INTERPOLATION_UNITS, Value::byte(units as u8)),
            INTERPOLATION_EXPONENT => {
                Service::Write(Object::INTERPOLATION_EXPONENT, Value::byte(exponent as u8))
            }
            RATED_TORQUE => Service::Read(Object::RATED_TORQUE),
            HEARTBEAT => Service::Write(Object::HEARTBEAT_PRODUCER, Value::word(HEARTBEAT_MS)),
            extra if extra >= SETTINGS => self.extra_setting(extra),
            step => {
                let mapping = Mapping::ALL[usize::from(step / Mapping::STEPS) % Mapping::ALL.len()];
                let service = mapping.step(self.node, self.cyclic(), step % Mapping::STEPS);
                match service {
                    Service::Write(object, _) if object.is_mapping() && self.fixed.contains(&mapping) => {
                        Service::Read(object)
                    }
                    _ => service,
                }
            }
        }
    }

    /// Returns the service that checks or writes an optional setting.
    fn extra_setting(&self, setting: u8) -> Service {
        let HomingObjects { method, velocities, acceleration } = self.homes.unwrap_or_default();
        let write = |object, number| Service::Write(object, Value::long(number));
        match self.extra(setting) {
            Some(Extra::MaxCurrent) => {
                let [limit, rated] = self.currents.unwrap_or([0.0, 1.0]);
                Service::Write(Object::MAX_CURRENT, Value::word(nearest(limit / rated * 1e3) as u16))
            }
            Some(Extra::Homing(Object::HOMING_METHOD)) => {
                Service::Write(Object::HOMING_METHOD, Value::byte(method as u8))
            }
            Some(Extra::Homing(object @ Object::HOMING_VELOCITY)) => write(object, velocities[0]),
            Some(Extra::Homing(object @ Object::HOMING_CREEP_VELOCITY)) => write(object, velocities[1]),
            Some(Extra::Homing(object @ Object::HOMING_ACCELERATION)) => write(object, acceleration),
            // the drive reads zero at its mark; the table contains the joint position of the mark
            Some(Extra::Homing(object)) => write(object, 0),
            Some(Extra::RatedCurrent) | None => Service::Read(Object::RATED_CURRENT),
        }
    }

    /// Returns the index of the mapping object that is compared for this setting, and its required value.
    fn fixed_mapping(&self, setting: u8) -> Option<(u16, u32)> {
        let mapping = Mapping::ALL.get(usize::from(setting / Mapping::STEPS))?;
        match mapping.step(self.node, self.cyclic(), setting % Mapping::STEPS) {
            // a count of 0 only marks a mapping that is about to change
            Service::Write(_, value) if value.number() == 0 => None,
            Service::Write(object, value) if object.is_mapping() && self.fixed.contains(mapping) => {
                Some((object.index, value.number()))
            }
            _ => None,
        }
    }

    /// Checks a setting. A drive may display its new mode only some time after it was written.
    fn check_setting(&mut self, setting: u8, frame: &Frame) -> Result<Response, DecodeError> {
        let wrong = self.check(setting, frame)?;
        let is_mode = matches!(wrong, Some(WrongSetting::ControlMode { .. }));
        self.mode_reads = if is_mode { self.mode_reads + 1 } else { 0 };
        Ok(match is_mode && self.mode_reads < MODE_READS {
            true => Response::Waiting,
            false => Response::Setting(wrong),
        })
    }

    fn check(&self, setting: u8, frame: &Frame) -> Result<Option<WrongSetting>, DecodeError> {
        let value = match self.node.service_result(&self.setting(setting), frame) {
            // A drive without a heartbeat is only monitored by its process data.
            Err(DecodeError::Refused { .. }) if setting == HEARTBEAT => return Ok(None),
            Err(DecodeError::Refused { code }) => {
                let (Service::Read(object) | Service::Write(object, _)) = self.setting(setting);
                return Ok(Some(WrongSetting::Refused { index: object.index, code }));
            }
            value => value?,
        };
        let Some(value) = value.map(Value::number) else { return Ok(None) };
        if let Some(expected) = self.fixed_mapping(setting)
            && expected.1 != value
        {
            let (index, expected) = expected;
            return Ok(Some(WrongSetting::Mapping { index, found: value, expected }));
        }
        Ok(match setting {
            READ_WATCHDOG => {
                let found_ns = u64::from(value & 0xffff) * 1_000_000;
                let is_ours = value >> 16 & 0x7f == u32::from(ADAPTER) && found_ns > 0;
                let (found, expected) =
                    (is_ours.then_some(found_ns), u64::from(self.watchdog_ms) * 1_000_000);
                (found.unwrap_or(0) != expected).then_some(WrongSetting::Watchdog { found, expected })
            }
            READ_MODE => {
                let (found, expected) = (i64::from(value as u8 as i8), i64::from(self.cyclic() as u8));
                let register = "object 0x6061";
                (found != expected).then_some(WrongSetting::ControlMode { found, expected, register })
            }
            RATED_TORQUE => {
                let (found, expected) = (f64::from(value) * 1e-3, self.rated_torque);
                ((found - expected).abs() > 0.6e-3).then_some(WrongSetting::RatedTorque { found, expected })
            }
            extra if self.extra(extra) == Some(Extra::RatedCurrent) => {
                let (found, expected) =
                    (f64::from(value) * 1e-3, self.currents.map_or(0.0, |[_, rated]| rated));
                ((found - expected).abs() > 0.6e-3).then_some(WrongSetting::RatedCurrent { found, expected })
            }
            _ => None,
        })
    }

    fn process(&mut self, frame: &Frame) -> Result<Response, DecodeError> {
        match self.node.process(frame)? {
            Process::Position { statusword, position } => {
                self.state = DriveState::from_statusword(statusword)?;
                self.take_homing_status(statusword);
                self.read_position = f64::from(position) / self.increments * TAU;
                self.has_position = true;
                Ok(Response::Other)
            }
            // the answer is complete with both frames
            Process::Motion { .. } if !core::mem::take(&mut self.has_position) => Ok(Response::Other),
            Process::Motion { velocity, torque } => {
                let state = match self.state {
                    DriveState::Enabled => State::Enabled,
                    DriveState::Fault | DriveState::FaultReaction if self.clears == 0 => {
                        State::Fault(fault(self.emergency))
                    }
                    _ => State::Disabled,
                };
                Ok(Response::Feedback(Feedback {
                    position: self.read_position,
                    velocity: f64::from(velocity) / self.increments * TAU,
                    torque: f64::from(torque) * 1e-3 * self.rated_torque,
                    temperature: None,
                    voltage: None,
                    state,
                }))
            }
        }
    }
}

impl Dialogue for Cia402 {
    fn set_cycle(&mut self, cycle_ns: u64) {
        self.cycle_ns = cycle_ns;
    }

    fn checks(&self) -> u8 {
        SETTINGS + self.extras().count() as u8
    }

    fn begin_homing(&mut self) {
        self.homing = Stage::begin();
    }

    fn homing_result(&self) -> Option<Result<(), HomingFault>> {
        self.homing.result()
    }

    fn restart(&mut self) {
        self.forget();
        self.clears = CLEARS;
    }

    fn forget(&mut self) {
        (self.is_started, self.state, self.has_position) = (false, DriveState::NotReady, false);
        (self.emergency, self.homing) = (0, Stage::None);
        self.is_beating = false;
    }

    fn state_within_ns(&self) -> Option<u64> {
        self.is_beating.then_some(HEARTBEAT_WITHIN_NS)
    }

    fn is_from(&self, frame: &Frame) -> bool {
        [0x080, 0x180, 0x280, 0x580, 0x700].iter().any(|base| self.node.id(*base) == frame.id)
    }

    fn write(&mut self, order: &Order, frames: &mut Vec<Frame>) {
        if let Order::Check(setting) = order {
            if *setting == 0 {
                // many drives refuse new mappings while process data are active, as after a previous adapter
                // or a trip
                frames.push(self.node.network(NetworkCommand::PreOperational));
            }
            frames.push(self.node.service(&self.setting(*setting)));
            return;
        }
        if !self.is_started {
            self.is_started = true;
            frames.push(self.node.network(NetworkCommand::Start));
        }
        self.motion.begin(order);
        let (controlword, command) = match order {
            Order::Enable if self.clears == 0 => {
                (self.state.towards_enabled().unwrap_or(DISABLE_VOLTAGE), Command::default())
            }
            Order::Follow(command) => (0x0f, *command),
            Order::Home if self.clears == 0 => (self.home(frames), Command::default()),
            _ => {
                // takes effect at the rising edge of the bit
                let resets = self.clears == CLEARS - 1;
                self.clears = self.clears.saturating_sub(1);
                (if resets { FAULT_RESET } else { DISABLE_VOLTAGE }, Command::default())
            }
        };
        let target = match self.mode {
            ControlMode::Position => self.motion.target(&command) / TAU * self.increments,
            ControlMode::Velocity => {
                self.motion.velocity(&command, self.gains, &self.ranges) / TAU * self.increments
            }
            ControlMode::Torque => self.motion.torque(&command, &self.ranges) / self.rated_torque * 1e3,
        };
        let setpoint = Setpoint { controlword, target: nearest(target) };
        frames.push(self.node.setpoint(self.cyclic(), &setpoint));
    }

    fn read(&mut self, checking: Option<u8>, frame: &Frame) -> Result<Response, DecodeError> {
        if frame.id == self.node.id(0x080) {
            let emergency = self.node.emergency(frame)?;
            self.emergency = emergency.code;
            return Ok(response(emergency));
        }
        if frame.id == self.node.id(0x700) {
            return Ok(match self.node.heartbeat(frame)? {
                // the drive has lost its settings
                NetworkState::BootUp => Response::Restarted,
                _ => {
                    self.is_beating = true;
                    Response::Alive
                }
            });
        }
        match checking {
            Some(setting) if frame.id == self.node.id(0x580) => self.check_setting(setting, frame),
            // process data from before the set-up
            Some(_) => Ok(Response::Other),
            None if frame.id == self.node.id(0x580) => {
                self.take_homing_service(frame);
                Ok(Response::Other)
            }
            None => self.process(frame),
        }
    }

    fn accept(&mut self, feedback: &Feedback) {
        (self.motion.position, self.motion.velocity) = (feedback.position, feedback.velocity);
    }

    fn takes_gains(&self) -> bool {
        self.mode == ControlMode::Torque
    }

    fn shortest(&self) -> (Form, usize, usize) {
        // a synchronisation
        (Form::Classic, 0, 6)
    }

    fn is_synchronised(&self, order: &Order) -> bool {
        // answers to service data come independently of the synchronisation
        !matches!(order, Order::Check(_))
    }

    fn synchronise(&self, frames: &mut Vec<Frame>) {
        frames.extend([adapter_heartbeat(), sync()]);
    }
}

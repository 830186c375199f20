//! Simulated CiA 402 drive: network management, the part of the object dictionary used by the adapter, the
//! state machine, and synchronous process data.

use core::f64::consts::TAU;

use super::codec::{
    ADAPTER, DriveState, Emergency, HOMING_MODE, HOMING_START, Mapping, Mode, NetworkCommand, NetworkState,
    Node, Object, Process, Service, Setpoint, Value, adapter_heartbeat, nearest, sync,
};
use super::data_sheet::fixed_mappings;
use crate::frame::{Frame, Id};
use crate::protocols::entries::{ControlMode, LoopEntry};
use crate::protocols::simulation::{Mark, Motor, Overrides, Search, Simulated, Watchdog};
use crate::protocols::spec::DriveSetup;

/// Abort code: the object does not exist.
const NO_OBJECT: u32 = 0x0602_0000;
/// Abort code: the object is read-only.
const READ_ONLY: u32 = 0x0601_0002;
/// Abort code: not allowed in the current state.
const NOT_NOW: u32 = 0x0800_0022;
/// Abort code: the value is out of range.
const NO_SUCH_VALUE: u32 = 0x0609_0030;
/// Accepted modes: none, homing, and cyclic position, velocity and torque.
const MODES: [u32; 5] = [0, HOMING_MODE as u32, 8, 9, 10];
/// Error codes of emergency messages.
const NO_HEARTBEAT: u16 = 0x8130;
const TOO_HOT: u16 = 0x4310;
/// Objects in addition to the mappings.
const OBJECTS: [Object; 11] = [
    Object::MAX_CURRENT,
    Object::HOMING_METHOD,
    Object::HOMING_VELOCITY,
    Object::HOMING_CREEP_VELOCITY,
    Object::HOMING_ACCELERATION,
    Object::HOME_OFFSET,
    Object::HEARTBEAT_CONSUMER,
    Object::HEARTBEAT_PRODUCER,
    Object::MODE,
    Object::INTERPOLATION_UNITS,
    Object::INTERPOLATION_EXPONENT,
];

/// CiA 402 drive with an internal position loop, or in velocity or torque mode.
#[derive(Clone, Debug)]
pub(crate) struct Cia402 {
    node: Node,
    increments: f64,
    rated_torque: f64,
    rated_current: f64,
    gains: LoopEntry,
    network: NetworkState,
    state: DriveState,
    dictionary: Vec<(Object, Value)>,
    /// Object values at power-up.
    initial: Vec<(Object, Value)>,
    /// Process data with a read-only mapping.
    fixed: Vec<Mapping>,
    /// Watchdog that cannot be changed, ns.
    fixed_watchdog_ns: Option<u64>,
    watchdog: Watchdog,
    /// `true` if a heartbeat of the adapter has arrived. From then on, the heartbeat is monitored.
    is_watching: bool,
    /// Setpoints waiting for the next synchronisation, followed by the active setpoints.
    waiting: Option<Setpoint>,
    setpoint: Setpoint,
    /// `true` if the boot-up message has yet to be sent.
    boots: bool,
    /// Time of its next heartbeat, ns; `None` before one is due.
    next_heartbeat_ns: Option<u64>,
    emergency: Option<u16>,
    /// Mode of the setpoints.
    cyclic: Mode,
    homing: Homing,
    motor: Motor,
    watchdog_trips: u64,
}

impl Cia402 {
    pub(crate) fn new(setup: &DriveSetup<'_>, overrides: Overrides) -> Self {
        let (entry, fixed) = (setup.entry, fixed_mappings(setup.entry));
        let node = Node::new(entry.node).unwrap_or(Node::FIRST);
        let mut dictionary: Vec<_> = OBJECTS.iter().map(|object| (*object, Value::long(0))).collect();
        let mode = match entry.mode.unwrap_or_default() {
            ControlMode::Position => Mode::Position,
            ControlMode::Velocity => Mode::Velocity,
            ControlMode::Torque => Mode::Torque,
        };
        for mapping in Mapping::ALL {
            let is_fixed = fixed.contains(&mapping);
            for step in 0..Mapping::STEPS {
                let Service::Write(object, value) = mapping.step(node, mode, step) else { continue };
                match dictionary.iter_mut().find(|(known, _)| *known == object) {
                    // permanent, like a mapping stored in the drive
                    Some((_, place)) if is_fixed => *place = value,
                    Some(_) => {}
                    None => dictionary.push((object, value)),
                }
            }
        }
        Self {
            node,
            increments: entry.increments.unwrap_or(1.0),
            rated_torque: overrides.torque.or(entry.rated_torque).unwrap_or(1.0),
            rated_current: entry.rated_current.unwrap_or(1.0),
            gains: setup.gains,
            network: NetworkState::PreOperational,
            state: DriveState::SwitchOnDisabled,
            initial: dictionary.clone(),
            dictionary,
            fixed,
            fixed_watchdog_ns: overrides.watchdog_ns,
            watchdog: Watchdog::new(overrides.watchdog_ns.filter(|ns| *ns > 0)),
            is_watching: false,
            waiting: None,
            setpoint: Setpoint { controlword: 0, target: 0 },
            boots: true,
            next_heartbeat_ns: None,
            emergency: None,
            cyclic: Mode::Position,
            homing: Homing::None,
            motor: Motor::new(entry.ranges.torque),
            watchdog_trips: 0,
        }
    }

    fn number(&self, object: Object) -> u32 {
        self.get(object).map_or(0, Value::number)
    }

    fn homes(&self) -> bool {
        self.number(Object::MODE) == u32::from(HOMING_MODE)
    }

    fn get(&self, object: Object) -> Option<Value> {
        self.dictionary.iter().find(|(known, _)| *known == object).map(|(_, value)| *value)
    }

    /// Returns `true` if the process data have the expected mapping and are switched on.
    fn is_mapped(&self, mapping: Mapping) -> bool {
        let mut last = (2..Mapping::STEPS).map(|step| mapping.step(self.node, self.cyclic, step));
        last.all(|service| match service {
            Service::Write(object, value) => {
                self.get(object).is_some_and(|found| found.number() == value.number())
            }
            Service::Read(_) => true,
        })
    }

    fn serve(&mut self, service: &Service) -> Frame {
        let result = match *service {
            Service::Read(Object::RATED_TORQUE) => Ok(Value::long((self.rated_torque * 1e3 + 0.5) as u32)),
            Service::Read(Object::RATED_CURRENT) => Ok(Value::long((self.rated_current * 1e3 + 0.5) as u32)),
            Service::Read(Object::MODE_DISPLAY) => Ok(Value::byte(self.number(Object::MODE) as u8)),
            Service::Read(object) => self.identity(object).or_else(|| self.get(object)).ok_or(NO_OBJECT),
            Service::Write(Object::MODE, value) if !MODES.contains(&value.number()) => Err(NO_SUCH_VALUE),
            Service::Write(Object::RATED_TORQUE | Object::RATED_CURRENT | Object::STATUSWORD, _) => {
                Err(READ_ONLY)
            }
            Service::Write(object, _) if self.is_fixed(object) => Err(READ_ONLY),
            Service::Write(object, _) if object.is_mapping() && self.network == NetworkState::Operational => {
                Err(NOT_NOW)
            }
            Service::Write(object, value) => self.put(object, value).map(|()| value),
        };
        self.node.service_answer(service, result)
    }

    /// Returns the value of a read-only object that every CANopen device and CiA 402 drive has.
    fn identity(&self, object: Object) -> Option<Value> {
        Some(match (object.index, object.subindex) {
            (0x1000, 0) => Value::long(0x0002_0192),
            (0x1001, 0) => Value::byte(u8::from(self.state == DriveState::Fault)),
            (0x1018, 0) => Value::byte(4),
            (0x1018, 1..=4) => Value::long(0),
            (0x6040, 0) => Value::word(self.setpoint.controlword),
            (0x6041, 0) => Value::word(statusword(self.state) | self.homing.statusword()),
            _ => return None,
        })
    }

    /// Returns `true` for a read-only mapping object.
    fn is_fixed(&self, object: Object) -> bool {
        let names = |mapping: &Mapping| {
            let mut steps = (0..Mapping::STEPS).map(|step| mapping.step(self.node, self.cyclic, step));
            steps.any(|service| matches!(service, Service::Write(named, _) if named.index == object.index))
        };
        object.is_mapping() && self.fixed.iter().any(names)
    }

    fn put(&mut self, object: Object, value: Value) -> Result<(), u32> {
        let mut value = value;
        if object == Object::HEARTBEAT_CONSUMER {
            if let Some(fixed_ns) = self.fixed_watchdog_ns {
                value = Value::long(u32::from(ADAPTER) << 16 | (fixed_ns / 1_000_000) as u32);
            }
            let after_ns = u64::from(value.number() & 0xffff) * 1_000_000;
            self.watchdog.after_ns = Some(after_ns).filter(|ns| *ns > 0);
        }
        if object == Object::MAX_CURRENT {
            self.motor.limit(f64::from(value.number()) * 1e-3 * self.rated_torque);
        }
        if object == Object::MODE {
            self.homing = Homing::None;
            self.cyclic = match value.number() {
                8 => Mode::Position,
                9 => Mode::Velocity,
                10 => Mode::Torque,
                _ => self.cyclic,
            };
        }
        if object == Object::HEARTBEAT_PRODUCER {
            self.next_heartbeat_ns = None;
        }
        let place = self.dictionary.iter_mut().find(|(known, _)| *known == object).ok_or(NO_OBJECT)?;
        place.1 = value;
        Ok(())
    }

    /// Applies the waiting setpoints, and answers with the state.
    fn synchronise(&mut self, answer: &mut dyn FnMut(Frame)) {
        if let Some(setpoint) = self.waiting.take() {
            let resets = setpoint.controlword & 0x80 != 0 && self.setpoint.controlword & 0x80 == 0;
            let starts =
                setpoint.controlword & HOMING_START != 0 && self.setpoint.controlword & HOMING_START == 0;
            self.state = next(self.state, setpoint.controlword, resets);
            self.setpoint = setpoint;
            if self.homes() && self.is_enabled() && starts {
                self.home();
            }
        }
        let scaled = |rad: f64| nearest(rad / TAU * self.increments);
        let statusword = statusword(self.state) | self.homing.statusword();
        let torque = (self.motor.torque / self.rated_torque * 1e3).clamp(-32768.0, 32767.0);
        let process = [
            (Mapping::Position, Process::Position { statusword, position: scaled(self.motor.position) }),
            (
                Mapping::Motion,
                Process::Motion { velocity: scaled(self.motor.velocity), torque: nearest(torque) as i16 },
            ),
        ];
        for (mapping, process) in process {
            if self.is_mapped(mapping) {
                answer(self.node.process_frame(&process));
            }
        }
    }

    /// Starts the search for the mark.
    fn home(&mut self) {
        let scale = self.number(Object::HOMING_VELOCITY);
        let speed = f64::from(scale) / self.increments * TAU;
        self.homing = match self.number(Object::HOMING_METHOD) as u8 as i8 {
            35 | 37 => {
                Search::here(&mut self.motor);
                Homing::Attained
            }
            _ if self.motor.mark == Mark::Stuck => Homing::Failed,
            _ => Homing::Running(Search::new(&self.motor, speed, self.motor.stepped_ns)),
        };
    }

    /// Sends the heartbeats that are due. The first one is due one period after the period was written.
    fn beat(&mut self, now_ns: u64, send: &mut dyn FnMut(Frame, u64)) {
        let period_ns = u64::from(self.number(Object::HEARTBEAT_PRODUCER)) * 1_000_000;
        if period_ns == 0 {
            self.next_heartbeat_ns = None;
            return;
        }
        let next_ns = self.next_heartbeat_ns.get_or_insert(now_ns + period_ns);
        while *next_ns <= now_ns {
            send(self.node.heartbeat_frame(self.network), *next_ns);
            *next_ns += period_ns;
        }
    }

    fn fail(&mut self, code: u16) {
        (self.state, self.emergency) = (DriveState::Fault, Some(code));
    }
}

impl Simulated for Cia402 {
    fn ids(&self) -> Vec<Id> {
        let all = [Id::Standard(0x000), sync().id, adapter_heartbeat().id];
        all.into_iter().chain([self.node.id(0x200), self.node.id(0x600)]).collect()
    }

    fn is_enabled(&self) -> bool {
        self.state == DriveState::Enabled
    }

    fn cut_power(&mut self) {
        (self.network, self.state) = (NetworkState::PreOperational, DriveState::SwitchOnDisabled);
        (self.is_watching, self.waiting, self.boots, self.emergency) = (false, None, true, None);
        self.setpoint = Setpoint { controlword: 0, target: 0 };
        self.homing = Homing::None;
        self.next_heartbeat_ns = None;
        self.dictionary.copy_from_slice(&self.initial);
        self.watchdog.after_ns = self.fixed_watchdog_ns.filter(|ns| *ns > 0);
        self.motor.limit(f64::INFINITY);
    }

    fn receive(&mut self, frame: &Frame, now_ns: u64, answer: &mut dyn FnMut(Frame)) {
        let is_operational = self.network == NetworkState::Operational;
        if let Ok(command) = self.node.network_command(frame) {
            match command {
                NetworkCommand::Start => self.network = NetworkState::Operational,
                NetworkCommand::Stop => self.network = NetworkState::Stopped,
                NetworkCommand::PreOperational => self.network = NetworkState::PreOperational,
                NetworkCommand::Reset | NetworkCommand::ResetCommunication => self.cut_power(),
            }
        } else if *frame == adapter_heartbeat() {
            (self.is_watching, self.watchdog.fed_ns) = (true, now_ns);
        } else if *frame == sync() {
            if is_operational {
                self.synchronise(answer);
            }
        } else if let Ok(service) = self.node.service_request(frame) {
            if self.network != NetworkState::Stopped {
                answer(self.serve(&service));
            }
        } else if let Ok(setpoint) = self.node.setpoint_of(self.cyclic, frame)
            && is_operational
            && self.is_mapped(Mapping::Setpoint)
        {
            self.waiting = Some(setpoint);
        }
    }

    fn report(&mut self, now_ns: u64, send: &mut dyn FnMut(Frame, u64)) {
        if core::mem::take(&mut self.boots) {
            send(self.node.heartbeat_frame(NetworkState::BootUp), now_ns);
        }
        if let Some(code) = self.emergency.take() {
            send(self.node.emergency_frame(&Emergency { code, register: 1 }), now_ns);
        }
        self.beat(now_ns, send);
    }

    fn step(&mut self, position: f64, velocity: f64, now_ns: u64) -> f64 {
        self.motor.turn(position, velocity, now_ns);
        if self.is_watching && self.watchdog.has_expired(now_ns) {
            self.is_watching = false;
            self.watchdog_trips += 1;
            self.fail(NO_HEARTBEAT);
        }
        if self.is_enabled() && self.motor.is_too_hot() {
            self.fail(TOO_HOT);
        }
        let target = f64::from(self.setpoint.target);
        let LoopEntry { kp, kd } = self.gains;
        if self.homes() {
            let mut goes = 0.0;
            if let (true, Homing::Running(search)) = (self.is_enabled(), &mut self.homing) {
                match search.step(&mut self.motor, now_ns) {
                    Some(velocity) => goes = velocity,
                    None => self.homing = Homing::Attained,
                }
            }
            return self.motor.apply(self.is_enabled().then_some(kd * (goes - velocity)));
        }
        let desired = match self.cyclic {
            Mode::Position => kp * (target / self.increments * TAU - position) - kd * velocity,
            Mode::Velocity => kd * (target / self.increments * TAU - velocity),
            Mode::Torque => target * 1e-3 * self.rated_torque,
        };
        self.motor.apply(self.is_enabled().then_some(desired))
    }

    fn motor(&self) -> &Motor {
        &self.motor
    }

    fn motor_mut(&mut self) -> &mut Motor {
        &mut self.motor
    }

    fn watchdog_trips(&self) -> u64 {
        self.watchdog_trips
    }
}

/// Progress of a homing.
#[derive(Clone, Copy, Debug)]
enum Homing {
    None,
    Running(Search),
    Attained,
    Failed,
}

impl Homing {
    /// Returns the homing bits of the statusword.
    fn statusword(self) -> u16 {
        match self {
            Self::None | Self::Running(_) => 0,
            Self::Attained => 1 << 12 | 1 << 10,
            Self::Failed => 1 << 13,
        }
    }
}

/// Returns the state after a controlword.
fn next(state: DriveState, controlword: u16, resets: bool) -> DriveState {
    use DriveState::{Enabled, Fault, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    match (state, controlword & 0xf) {
        (Fault, _) if resets => SwitchOnDisabled,
        (Fault, _) => Fault,
        // no voltage
        (_, word) if word & 0x2 == 0 => SwitchOnDisabled,
        (_, word) if word & 0x4 == 0 => SwitchOnDisabled,
        (SwitchOnDisabled | SwitchedOn | Enabled, 0x6) => ReadyToSwitchOn,
        (ReadyToSwitchOn | Enabled, 0x7) => SwitchedOn,
        (SwitchedOn, 0xf) => Enabled,
        (state, _) => state,
    }
}

/// Returns the statusword of a state, with voltage enabled.
fn statusword(state: DriveState) -> u16 {
    match state {
        DriveState::NotReady => 0x0000,
        DriveState::SwitchOnDisabled => 0x0250,
        DriveState::ReadyToSwitchOn => 0x0231,
        DriveState::SwitchedOn => 0x0233,
        DriveState::Enabled => 0x0237,
        DriveState::QuickStop => 0x0217,
        DriveState::FaultReaction => 0x021f,
        DriveState::Fault => 0x0218,
    }
}

//! `can.drive_sim`: buses and drives of a robot simulated by a physics component.

mod actuation;
mod axis;
mod channel;
mod config;
mod drives;
mod endpoints;
mod fault_injector;
mod inner_loops;
mod simulated;
mod sockets;
mod stiffness;

use std::path::Path;
use std::time::Duration;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium::state::CanFrame;

use super::faults::{Fault, FaultKind};
use super::wire::BATCH;
use super::{Equipped, interfaces, load};
use crate::bus::offered::BATCH_NS;
use crate::{AnySimulatedDrive, Mark, Overrides, Table};

use actuation::{Actuation, actuations};
use axis::Axis;
use channel::channels;
pub use config::DriveSimulationConfig;
use drives::Drives;
use endpoints::Endpoints;
use simulated::Simulated;
use sockets::Sockets;

/// Component that simulates a robot's buses and drives.
///
/// Each step advances the buses to the current time and lets each drive receive frames and answer. It then
/// runs the inner loops on the joint state that physics has just published, and publishes the efforts. The
/// drives of a bus that the configuration assigns to an interface of this computer, such as `vcan0`, receive
/// and answer frames on that interface.
pub struct DriveSimulation {
    joint_state: Input<JointState>,
    lines: Lines,
    command: Output<JointCommand>,
    clock: RunClock,
    axes: Vec<Axis>,
    faults: Vec<Fault>,
    config: DriveSimulationConfig,
    random: u64,
    lost: u64,
    last_ns: Option<u64>,
}

/// Connection between the adapter and the drives.
enum Lines {
    Simulated(Box<Simulated>),
    Sockets(Sockets),
}

impl Component for DriveSimulation {
    const KIND: &'static str = "can.drive_sim";
    const SUMMARY: &'static str = "simulates drives on CAN buses";
    type Config = DriveSimulationConfig;

    fn declare(config: &DriveSimulationConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let equipped = load(declare.robot(), declare.folder(), &config.source())?;
        axes(config, &equipped, declare.folder())?;
        faults(config, &equipped.table)?;
        if !(0.0..=1.0).contains(&config.loss) {
            return Err(ConfigError::key("loss", format!("{}, expected 0 to 1", config.loss)));
        }
        if let Some(period) = declare.period()
            && period.as_nanos() > 500_000
        {
            let message = format!("an inner loop of {:.0} Hz", 1.0 / period.as_secs_f64());
            let warning = declare.warn(message);
            warning.advise("simulate physics at 2 kHz or more, better at 4 kHz: drives hold stiff gains only in a fast loop");
        }
        if let Some(period) = declare.period()
            && let Some(message) = stiffness::too_stiff(&equipped, period.as_secs_f64())
        {
            declare.warn(message).key("drives").advise(
                "write softer gains in `position_loop` of the drive table, or simulate physics at a higher rate",
            );
        }
        declare.input::<JointState>("joint_state", "true state of the joints");
        if equipped.table.has_adapters_on_terminals() {
            declare.waits(Duration::from_nanos(BATCH_NS));
        }
        if !interfaces::are_real(&equipped.table, declare.clock())? {
            declare.slice_input::<CanFrame>("frames_sent", 16, "frames that the adapter sends");
            declare.slice_output::<CanFrame>(
                "frames_received",
                BATCH,
                16,
                "frames that the adapter receives",
            );
        }
        declare.output::<JointCommand>(
            "joint_command",
            "efforts of the drives, for physics with `plant = true`",
        );
        Ok(())
    }

    fn configure(config: DriveSimulationConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let robot = setup.robot()?.clone();
        let equipped =
            load(Some(&robot), setup.folder(), &config.source()).map_err(ConfigureError::Config)?;
        let mut axes = axes(&config, &equipped, setup.folder()).map_err(ConfigureError::Config)?;
        let table = &equipped.table;
        let (faults, clock) = (faults(&config, table).map_err(ConfigureError::Config)?, setup.clock());
        let is_real = interfaces::are_real(table, clock.kind()).map_err(ConfigureError::Config)?;
        let lines = if is_real && table.is_offered() {
            let endpoints = Endpoints::offers(table).map_err(ConfigureError::Config)?;
            Lines::Simulated(Box::new(Simulated::new(endpoints, channels(table, &mut axes))))
        } else if is_real {
            let sockets = Sockets::open(table, &axes, &faults, clock.clone());
            Lines::Sockets(sockets.map_err(ConfigureError::Config)?)
        } else {
            let (sent, received) =
                (setup.slice_input("frames_sent")?, setup.slice_output("frames_received")?);
            let endpoints = Endpoints::topics(sent, received);
            Lines::Simulated(Box::new(Simulated::new(endpoints, channels(table, &mut axes))))
        };
        Ok(Self {
            joint_state: setup.input("joint_state")?,
            lines,
            command: setup.output("joint_command")?,
            clock,
            axes,
            faults,
            random: setup.seed(),
            config,
            lost: 0,
            last_ns: None,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        let now_ns = self.clock.now_ns().max(tick.time_ns);
        for axis in &mut self.axes {
            let is_off = self.faults.iter().any(|fault| fault.befalls(FaultKind::Off, axis.entry, now_ns));
            if is_off && !axis.was_off {
                axis.drive.cut_power();
            }
            axis.was_off = is_off;
            let is_on = |kind| self.faults.iter().any(|fault| fault.befalls(kind, axis.entry, now_ns));
            axis.drive.set_mark(match () {
                () if is_on(FaultKind::NoMark) => Mark::Missing,
                () if is_on(FaultKind::StuckMark) => Mark::Stuck,
                () => Mark::Works,
            });
        }
        let Self { lines, axes, faults, config, random, clock, .. } = self;
        let mut drives = Drives { axes, faults, config, random, lost: 0 };
        match lines {
            Lines::Simulated(simulated) => {
                simulated.run(&mut drives, clock, now_ns)?;
            }
            Lines::Sockets(sockets) => {
                sockets.begin_faults(drives.faults, now_ns);
                sockets.receive(&mut drives, now_ns);
                drives.lost += sockets.send(now_ns);
            }
        }
        self.lost += drives.lost;
        let periods = tick.periods_since(self.last_ns.replace(tick.time_ns), tick.time_ns);
        self.run_loops(now_ns, tick.dt() * f64::from(periods))
    }

    fn result(&self) -> Option<serde_json::Value> {
        let drive = |axis: &Axis| {
            let value = serde_json::json!({
                "enabled": axis.drive.is_enabled(),
                "watchdog_trips": axis.drive.watchdog_trips(),
                "temperature_celsius": axis.drive.temperature(),
            });
            (axis.name.clone(), value)
        };
        let drives: serde_json::Map<_, _> = self.axes.iter().map(drive).collect();
        let mut result = serde_json::json!({ "answers_lost": self.lost, "drives": drives });
        if let (Lines::Sockets(sockets), Some(table)) = (&self.lines, result.as_object_mut()) {
            let buses =
                sockets.conditions().map(|(name, condition)| (name.to_string(), condition.name().into()));
            table.insert("interfaces".into(), buses.collect::<serde_json::Map<_, _>>().into());
        }
        Some(result)
    }
}

fn axes(
    config: &DriveSimulationConfig,
    equipped: &Equipped,
    folder: &Path,
) -> Result<Vec<Axis>, ConfigError> {
    let Equipped { robot, table, order } = equipped;
    let names = robot.model.joint_names();
    for (index, set) in config.set.iter().enumerate() {
        let positive = set.torque.is_none_or(|torque| torque.is_finite() && torque > 0.0);
        if !names.contains(&set.joint) || !positive {
            let message =
                format!("the setting names the drive of `{}` and a torque of {:?}", set.joint, set.torque);
            return Err(ConfigError::key(format!("set[{index}]"), message)
                .advise("name a joint of the robot, and write a positive torque"));
        }
    }
    let actuations = actuations(config, &robot.model, folder)?;
    let axis = |((name, &entry), actuation): ((&String, &usize), Option<Actuation>)| {
        let (drive, mut overrides) = (&table.drives[entry], Overrides::default());
        for set in config.set.iter().filter(|set| set.joint == *name) {
            overrides.watchdog_ns = set.watchdog.map(|watchdog| watchdog.ns).or(overrides.watchdog_ns);
            overrides.torque = set.torque.or(overrides.torque);
        }
        Axis {
            name: name.clone(),
            drive: AnySimulatedDrive::new(table, entry, overrides),
            gear: table.transmission(entry),
            actuation,
            bus: table.bus_of(drive).unwrap_or(0),
            node: 0,
            entry,
            was_off: false,
            is_cut_off: false,
        }
    };
    Ok(names.iter().zip(order).zip(actuations).map(axis).collect())
}

fn faults(config: &DriveSimulationConfig, table: &Table) -> Result<Vec<Fault>, ConfigError> {
    config.faults.iter().enumerate().map(|(index, fault)| Fault::from_config(fault, index, table)).collect()
}

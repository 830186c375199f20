//! Specification of CiA 402 drives.

use core::f64::consts::TAU;
use std::io;

use super::codec::sync;
use super::data_sheet;
use super::dialogue::Cia402 as Cia402Dialogue;
use super::homing_objects::HomingObjects;
use super::simulated::Cia402 as SimulatedCia402;
use crate::bus::budget::Shape;
use crate::frame::{Form, Frame, Id};
use crate::protocols::device::{Device, DeviceKind};
use crate::protocols::entries::{BusKind, ControlMode, DriveEntry, HomingEntry};
use crate::protocols::simulation::{Overrides, Simulated};
use crate::protocols::spec::{
    CurrentLimit, DriveProtocol, DriveSetup, Frames, Gains, OwnHoming, Refusal, Spec, THOUSANDTHS, Watchdog,
    beyond, require_current_limit,
};

/// CANopen in the cyclic synchronous modes.
#[derive(Debug)]
pub(crate) struct Cia402 {
    spec: Spec,
}

pub(crate) static CIA402: Cia402 = Cia402 {
    spec: Spec {
        bus: BusKind::Can,
        frames: Frames::Classic,
        // 127 is the adapter's own
        nodes: 1..=126,
        shares_bus: false,
        fast_answer: None,
        keys: &["mode", "position_loop", "eds", "increments", "rated_torque", "rated_current"],
        watchdog: Watchdog::Units {
            unit_ns: 1_000_000,
            most: 65_535,
            advice: "write whole milliseconds, up to 65535: object 0x1016 is in milliseconds",
        },
        current_limit: CurrentLimit::Settable {
            keys: &[(
                "rated_current",
                "write object 0x6075 in A, or an `eds` that has it: 0x6073 is in thousandths of the rated current",
            )],
        },
        gains: Gains::InTorqueMode,
        has_velocity_mode: true,
        homing: OwnHoming {
            is_supported: true,
            moves: true,
            keys: &["order", "timeout", "method", "velocity", "creep_velocity", "acceleration"],
        },
    },
};

impl Cia402 {
    /// Returns the dialogue with a drive.
    pub(crate) fn dialogue(&self, setup: &DriveSetup<'_>) -> Cia402Dialogue {
        Cia402Dialogue::new(setup)
    }
}

impl DriveProtocol for Cia402 {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn check_keys(&self, entry: &DriveEntry) -> Result<(), Refusal> {
        let positive = |value: Option<f64>| value.is_some_and(|value| value.is_finite() && value > 0.0);
        if positive(entry.increments) && positive(entry.rated_torque) {
            return Ok(());
        }
        let message = format!(
            "the increments are {:?} and the rated torque is {:?}, expected positive numbers",
            entry.increments, entry.rated_torque
        );
        let advice = "write `increments` per turn of the output shaft, and `rated_torque`, object 0x6076 in N m, or an `eds` that has them";
        Err((message, advice))
    }

    fn check_fields(&self, entry: &DriveEntry) -> Result<(), Refusal> {
        let (ranges, field) = (&entry.ranges, "its field of 32 bits");
        let whole = f64::from(i32::MAX) / entry.increments.unwrap_or(1.0) * TAU;
        beyond("position", ranges.position, "rad", whole, field)?;
        beyond("velocity", ranges.velocity, "rad/s", whole, field)?;
        if entry.mode == Some(ControlMode::Torque) {
            let most = entry.rated_torque.unwrap_or(1.0) * THOUSANDTHS;
            let field = "object 0x6071, in thousandths of the rated torque,";
            beyond("torque", ranges.torque, "N m", most, field)?;
        }
        Ok(())
    }

    fn check_current(&self, entry: &DriveEntry, limit: f64) -> Result<(), Refusal> {
        match entry.rated_current {
            Some(rated) if limit / rated > 65.535 => Err((
                format!("the current limit is {limit} A, more than 65 times the rated current of {rated} A"),
                "write the limit in A",
            )),
            _ => Ok(()),
        }
    }

    fn check_homing(&self, entry: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
        require_current_limit(entry)?;
        let method = homing.method.unwrap_or_default();
        if !matches!(method, i8::MIN..=-1 | 1..=14 | 17..=30 | 33 | 34 | 35 | 37) {
            return Err((
                format!("`homing.method` is {method}, which CiA 402 does not define"),
                "write object 0x6098: 1 to 14 with the index, 17 to 30 without, 33 and 34 the index alone, 37 the current position, negative for manufacturer-specific methods",
            ));
        }
        let all = [
            ("velocity", homing.velocity),
            ("creep_velocity", homing.creep_velocity),
            ("acceleration", homing.acceleration),
        ];
        let scale = entry.increments.unwrap_or(1.0) / TAU * entry.ratio;
        for (key, value) in all {
            let (value, most) = (value.unwrap_or_default(), f64::from(u32::MAX));
            let increments = value * scale;
            if !(increments >= 0.5 && increments <= most) {
                let message = format!(
                    "`homing.{key}` is {value}, {increments:.3} increments of the drive, expected 1 to {most}"
                );
                return Err((
                    message,
                    "write it in rad or m of the joint, without a sign: the method determines the direction",
                ));
            }
        }
        Ok(())
    }

    fn complete(
        &self,
        entry: &mut DriveEntry,
        read: &dyn Fn(&str) -> io::Result<String>,
    ) -> Result<(), Refusal> {
        data_sheet::complete(entry, read)
    }

    fn torque_of_current(&self, entry: &DriveEntry) -> Option<f64> {
        Some(entry.current_limit? * entry.rated_torque? / entry.rated_current?)
    }

    fn homing_registers(&self, entry: &DriveEntry) -> Vec<(u16, u8, i64)> {
        HomingObjects::from_entry(entry).map(|objects| objects.registers()).unwrap_or_default()
    }

    fn is_command(&self, setup: &DriveSetup<'_>, frame: &Frame) -> bool {
        frame.id == sync().id || frame.id == Id::Standard(0x200 | u16::from(setup.entry.node))
    }

    fn heartbeat(&self, frame: &Frame) -> Option<Device> {
        match (frame.id, frame.data()) {
            (Id::Standard(id @ 0x701..=0x77f), [state]) if matches!(state & 0x7f, 0 | 4 | 5 | 127) => {
                Some(Device { node: (id & 0x7f) as u8, kind: DeviceKind::CanOpen { state: state & 0x7f } })
            }
            _ => None,
        }
    }

    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape) {
        (setup.shape(6), setup.shape(6))
    }

    fn additional_frames(&self, setup: &DriveSetup<'_>) -> Vec<Shape> {
        let mut frames = vec![setup.shape(6)];
        if HomingObjects::from_entry(setup.entry).is_some() {
            // service data alongside the process data, and their answer
            frames.extend([setup.shape(8); 2]);
        }
        frames
    }

    fn bus_frames(&self) -> Vec<Shape> {
        // synchronisation, and the heartbeat of the adapter
        [0, 1].map(|bytes| Shape { extended: false, form: Form::Classic, bytes }).into()
    }

    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated> {
        Box::new(SimulatedCia402::new(setup, overrides))
    }
}

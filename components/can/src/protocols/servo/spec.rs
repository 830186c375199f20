//! Specification of servos on serial lines.

use super::codec::{dynamixel, feetech};
use super::dialogue::Servo as ServoDialogue;
use super::maker::Maker;
use super::simulated::Servo as SimulatedServo;
use crate::bus::budget::Shape;
use crate::frame::Form;
use crate::protocols::entries::{BusKind, DriveEntry, HomingEntry};
use crate::protocols::simulation::{Overrides, Simulated};
use crate::protocols::spec::{
    CurrentLimit, DriveProtocol, DriveSetup, Frames, Gains, OwnHoming, Refusal, Spec, TORQUE_CONSTANT,
    Watchdog,
};
use crate::servo::FAST_AROUND;

/// Registers of a manufacturer's servos.
#[derive(Debug)]
pub(crate) struct Servo {
    spec: Spec,
    maker: Maker,
}

/// Largest value of a Dynamixel's current register.
const MOST_UNITS: f64 = 2047.0;

const SPEC: Spec = Spec {
    bus: BusKind::Serial,
    frames: Frames::Packet,
    nodes: 1..=253,
    shares_bus: false,
    fast_answer: None,
    keys: &[],
    watchdog: Watchdog::Any,
    current_limit: CurrentLimit::Settable { keys: &[] },
    gains: Gains::Stored,
    has_velocity_mode: false,
    homing: OwnHoming { is_supported: true, moves: false, keys: &["steps"] },
};

pub(crate) static FEETECH: Servo = Servo {
    spec: Spec {
        keys: &["position_loop", "full_current"],
        watchdog: Watchdog::Missing {
            message: "this servo has no watchdog",
            advice: "write `watchdog = \"0 s\"`, and `allow_no_watchdog = true` for the adapter: the servo holds its last goal",
        },
        current_limit: CurrentLimit::Settable {
            keys: &[(
                "full_current",
                "write the stall current of the servo at its voltage, A: register 48 is in thousandths of this current",
            )],
        },
        ..SPEC
    },
    maker: Maker::Feetech,
};

pub(crate) static DYNAMIXEL: Servo = Servo {
    spec: Spec {
        nodes: 1..=252,
        fast_answer: Some(FAST_AROUND + dynamixel::STATE_BYTES as usize),
        keys: &["position_loop", "torque_constant", "current_unit"],
        watchdog: Watchdog::Units {
            unit_ns: dynamixel::WATCHDOG_UNIT_NS,
            most: dynamixel::LONGEST_WATCHDOG,
            advice: "write a multiple of 20 ms, up to 2540 ms, the unit of register 98",
        },
        current_limit: CurrentLimit::Settable {
            keys: &[
                TORQUE_CONSTANT,
                (
                    "current_unit",
                    "write the unit of register 102, A: 0.00269 of XM, XH and XW, 0.001 of XL330 and XC330",
                ),
            ],
        },
        ..SPEC
    },
    maker: Maker::Dynamixel,
};

impl Servo {
    /// Returns the dialogue with a servo.
    pub(crate) fn dialogue(&self, setup: &DriveSetup<'_>) -> ServoDialogue {
        let limit = self.current_register(setup.entry).map(|number| number as u16);
        ServoDialogue::new(setup, self.maker, limit)
    }

    /// Returns the current limit in units of its register, rounded down: thousandths of the stall current for
    /// a Feetech, current units for a Dynamixel.
    fn current_register(&self, entry: &DriveEntry) -> Option<f64> {
        let limit = entry.current_limit?;
        let units = match self.maker {
            Maker::Feetech => limit / entry.full_current? * 1e3,
            Maker::Dynamixel => limit / entry.current_unit?,
        };
        Some((units + 1e-6).floor())
    }
}

impl DriveProtocol for Servo {
    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn check_current(&self, entry: &DriveEntry, limit: f64) -> Result<(), Refusal> {
        let register = self.current_register(entry);
        match self.maker {
            Maker::Feetech if register.is_some_and(|number| !(1.0..=1e3).contains(&number)) => Err((
                format!(
                    "the current limit is {limit} A, but the servo has {} A",
                    entry.full_current.unwrap_or_default()
                ),
                "write at least a thousandth of `full_current`, and at most `full_current`",
            )),
            Maker::Dynamixel if register.is_some_and(|number| !(1.0..=MOST_UNITS).contains(&number)) => {
                Err((
                    format!(
                        "the current limit is {limit} A, which is {} units",
                        register.unwrap_or_default()
                    ),
                    "write 1 to 2047 units of `current_unit`, and at most the value in register 38 of the servo",
                ))
            }
            _ => Ok(()),
        }
    }

    fn check_homing(&self, _entry: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
        let (most, advice) = match self.maker {
            Maker::Feetech => (2047, "the homing offset in register 31 has 11 bits and a sign"),
            Maker::Dynamixel => (1_044_479, "the homing offset in register 20 is limited to 255 turns"),
        };
        match homing.steps {
            Some(steps) if steps.unsigned_abs() > most => {
                Err((format!("`homing.steps` is {steps}, expected -{most} to {most}"), advice))
            }
            _ => Ok(()),
        }
    }

    fn torque_of_current(&self, entry: &DriveEntry) -> Option<f64> {
        let limit = entry.current_limit?;
        Some(match self.maker {
            // at standstill, torque over stall torque equals current over stall current
            Maker::Feetech => (limit / entry.full_current?).min(1.0) * entry.ranges.torque,
            Maker::Dynamixel => limit * entry.torque_constant?,
        })
    }

    fn exchange(&self, setup: &DriveSetup<'_>) -> (Shape, Shape) {
        // number and goal in the packet with all goals, plus the number in the query
        match (self.maker, self.spec.fast_answer) {
            (Maker::Feetech, _) => (setup.shape(4), setup.shape(6 + usize::from(feetech::STATE_BYTES))),
            (Maker::Dynamixel, Some(answer)) if setup.fast_read => (setup.shape(6), setup.shape(answer)),
            (Maker::Dynamixel, _) => (setup.shape(6), setup.shape(11 + usize::from(dynamixel::STATE_BYTES))),
        }
    }

    fn bus_frames(&self) -> Vec<Shape> {
        // header and end of both packets
        let bytes = match self.maker {
            Maker::Feetech => 8,
            Maker::Dynamixel => 14,
        };
        vec![Shape { extended: false, form: Form::Packet, bytes }; 2]
    }

    fn simulated(&self, setup: &DriveSetup<'_>, overrides: Overrides) -> Box<dyn Simulated> {
        Box::new(SimulatedServo::new(setup, self.maker, overrides))
    }
}

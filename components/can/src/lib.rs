//! Drives on CAN buses.
//!
//! Each protocol has a pure codec, such as [`mit`], [`cia402`] and [`dynamixel`]; [`drive`] is their common
//! vocabulary. [`bus`] contains the bits and durations of frames, a simulated bus with arbitration and error
//! states, kernel interfaces ([`SocketBus`]), serial adapters ([`SlcanBus`]), and lines of serial servos
//! ([`ServoBus`]). A [`Table`] assigns drives to joints. [`Adapter`] implements the logic that commands the
//! drives. [`AnySimulatedDrive`] simulates a drive on a bus. All of these can be used without the runtime.
//!
//! Only the graph components [`CanAdapter`] (`can.adapter`) and [`DriveSimulation`] (`can.drive_sim`) depend
//! on the runtime.

pub mod adapter;
pub mod bus;
mod calibrate;
mod component;
mod database;
mod decimal;
pub mod drive;
mod frame;
mod protocols;
mod range;
mod scan;
mod scan_servos;
pub mod servo;
mod simulated_drive;
mod table;
mod traffic;

pub use adapter::Adapter;
pub use bus::bits::{Bits, Rates};
pub use bus::budget::{Budget, Shape};
pub use bus::real::RealBus;
pub use bus::report::{ErrorState, Report};
pub use bus::servo_line::ServoBus;
pub use bus::simulated::SimulatedBus;
pub use bus::slcan::{Attached, SlcanBus, adapter_version};
pub use bus::socket::{Condition, Interface, OpenError, SocketBus, SocketCounts};
pub use bus::{Bus, Received};
pub use calibrate::{Calibrated, CalibrationError, calibrate};
pub use component::{
    CanAdapter, CanAdapterConfig, DriveSimulation, DriveSimulationConfig, JointHealth, kinds,
};
pub use database::{Database, DatabaseError, Decoded, SignalValue};
pub use frame::{DecodeError, Form, Frame, Id};
pub use protocols::codecs::*;
pub use protocols::entries::{
    BusEntry, BusKind, ControlMode, DriveEntry, HomingBy, HomingEntry, HomingProcedure, LoopEntry,
    RangeEntry, ReferenceEntry,
};
pub use protocols::mit::simulated::SimulatedDrive;
pub use protocols::name::Protocol;
pub use protocols::simulation::{Mark, Overrides};
pub use range::{Fields, Range};
pub use scan::{Device, DeviceKind, FdSearch, Found, scan};
pub use scan_servos::{SPEEDS as SERVO_SPEEDS, ServoFound, scan_servos};
pub use simulated_drive::AnySimulatedDrive;
pub use table::{Table, TableError, Transmission};
pub use traffic::{Listener, Record, RecordError, Sender};

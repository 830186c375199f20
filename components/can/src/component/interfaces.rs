//! Interfaces of the computer named by a drive table.

use motorium::declare::{ClockKind, ConfigError};

use std::time::{Duration, Instant};

use crate::bus::offered::{Offer, Place};
use crate::{BusKind, OpenError, RealBus, Table};

/// Maximum time to wait for another program to offer a simulated bus.
const START: Duration = Duration::from_secs(5);

/// Returns `true` if the buses of a table are interfaces of the computer.
///
/// # Errors
/// Returns an error if the buses are real and the clock is lockstep, because a real bus cannot wait for
/// simulated time.
pub(super) fn are_real(table: &Table, clock: ClockKind) -> Result<bool, ConfigError> {
    if table.is_real() && clock == ClockKind::Lockstep {
        let name = table.buses.first().map_or("", |bus| &bus.name);
        return Err(ConfigError::new(format!("bus `{name}` is real and cannot wait for simulated time"))
            .advise("run the graph in real time, or leave `interface` out to simulate the bus"));
    }
    Ok(table.is_real())
}

/// Opens the interfaces of a table, in the order of its buses.
///
/// # Errors
/// Returns an error if an interface is missing or down, or if its bitrates differ from the table.
pub(super) fn open(table: &Table) -> Result<Vec<RealBus>, ConfigError> {
    let open = |(index, bus): (usize, &crate::BusEntry)| {
        let interface = bus.interface.as_deref().unwrap_or(&bus.name);
        let mut opened = table.open(index);
        let until = Instant::now() + START;
        while Place::from_interface(interface).is_some()
            && matches!(opened, Err(OpenError::NotOffered(_) | OpenError::NoLine(_)))
            && Instant::now() < until
        {
            std::thread::sleep(Duration::from_millis(10));
            opened = table.open(index);
        }
        opened.map_err(|error| {
            ConfigError::key("drives", format!("bus `{}`: {error}", bus.name)).advise(error.advice())
        })
    };
    table.buses.iter().enumerate().map(open).collect()
}

/// Offers the simulated buses of a table to other programs, in the order of its buses.
///
/// # Errors
/// Returns an error if an address is in use, or if the kernel refuses.
pub(super) fn offer(table: &Table) -> Result<Vec<Offer>, ConfigError> {
    let open = |(index, bus): (usize, &crate::BusEntry)| {
        let interface = bus.interface.as_deref().unwrap_or_default();
        let place = Place::from_interface(interface)
            .ok_or_else(|| ConfigError::key("drives", format!("bus `{}` has no address", bus.name)))?;
        let is_servo_line = bus.kind == BusKind::Serial;
        Offer::open(place, table.rates(index), bus.data_bitrate.is_some(), is_servo_line).map_err(|error| {
            let message = format!("bus `{}`: `{interface}` cannot be offered: {error}", bus.name);
            ConfigError::key("drives", message)
                .advise("stop the other program, or give the bus another address")
        })
    };
    table.buses.iter().enumerate().map(open).collect()
}

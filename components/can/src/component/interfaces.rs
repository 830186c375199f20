//! The interfaces of the computer that a drive table names.

use motorium::declare::{ClockKind, ConfigError};

use crate::{BusKind, RealBus, Table};

/// True if the buses of a table are interfaces of the computer.
///
/// # Errors
/// They are, and the clock is that of lockstep, which a real bus does not wait for.
pub(super) fn are_real(table: &Table, clock: ClockKind) -> Result<bool, ConfigError> {
    if table.is_real() && clock == ClockKind::Lockstep {
        let name = table.buses.first().map_or("", |bus| &bus.name);
        return Err(ConfigError::new(format!(
            "bus `{name}` is real, and does not wait for the clock of lockstep"
        ))
        .advise("run it in real time, or simulate its buses: leave `interface` out"));
    }
    Ok(table.is_real())
}

/// Opens the interfaces of a table, in the order of its buses.
///
/// # Errors
/// One is missing, down, or has other bitrates.
pub(super) fn open(table: &Table) -> Result<Vec<RealBus>, ConfigError> {
    let open = |(index, bus): (usize, &crate::BusEntry)| {
        let interface = bus.interface.as_deref().unwrap_or(&bus.name);
        let opened = match bus.kind {
            BusKind::Can => RealBus::open(interface, &table.rates(index), bus.data_bitrate.is_some()),
            BusKind::Serial => RealBus::open_servos(interface, bus.bitrate),
        };
        opened.map_err(|error| {
            ConfigError::key("drives", format!("bus `{}`: {error}", bus.name)).advise(error.advice())
        })
    };
    table.buses.iter().enumerate().map(open).collect()
}

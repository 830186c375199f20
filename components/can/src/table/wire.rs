//! Wire-level checks: frames that a drive does not support, identifiers shared by two drives, and watchdogs
//! beyond their fields.

use super::Table;
use crate::frame::{Form, Id};
use crate::protocols::entries::{BusEntry, DriveEntry};
use crate::protocols::spec::{Refusal, Watchdog};

/// Refuses classic-only drives on a bus where other drives receive CAN FD frames.
pub(super) fn check_forms(table: &Table, bus: &BusEntry) -> Result<(), Refusal> {
    let on_bus = || table.drives.iter().filter(|drive| drive.bus == bus.name);
    let of = |form| on_bus().find(|drive| table.form(drive) == form);
    let (Some(fast), Some(classic)) = (of(Form::FdFast), of(Form::Classic)) else { return Ok(()) };
    let message = format!(
        "bus `{}`: drives of {:?} receive CAN FD frames, but a drive of {:?} does not support and would disturb them",
        bus.name, fast.protocol, classic.protocol
    );
    Err((
        message,
        "put these drives on separate buses, or leave `data_bitrate` out if all drives support classic frames",
    ))
}

/// Returns the identifiers of a drive's commands and of its answers, on a bus shared by several protocols.
fn identifiers(table: &Table, index: usize) -> Option<(Id, Id)> {
    table.drives[index].protocol.definition().identifiers(&table.setup(index))
}

/// Refuses a drive whose answers look like commands to another drive, or like answers of another protocol.
pub(super) fn check_identifiers(table: &Table, index: usize) -> Result<(), Refusal> {
    let drive = &table.drives[index];
    let Some((mine, answers)) = identifiers(table, index) else { return Ok(()) };
    let refuse = |message: String| Err((message, "change `master` or `node`"));
    if answers == mine {
        return refuse("the identifier of the answers is already in use".into());
    }
    for (i, other) in
        table.drives.iter().enumerate().filter(|(i, other)| *i != index && other.bus == drive.bus)
    {
        let Some((theirs, their_answers)) = identifiers(table, i) else { continue };
        if answers == theirs {
            return refuse(format!(
                "the answers have the identifier {answers}, like commands to `{}`",
                other.joint
            ));
        }
        // within one protocol, answers contain the drive's number
        if answers == their_answers && drive.protocol != other.protocol {
            return refuse(format!(
                "the answers have the identifier {answers}, like the answers of `{}`, a drive of {:?}",
                other.joint, other.protocol
            ));
        }
    }
    Ok(())
}

/// Refuses a watchdog time that its register cannot represent.
pub(super) fn check_watchdog(drive: &DriveEntry) -> Result<(), Refusal> {
    let ns = drive.watchdog.ns;
    match drive.protocol.spec().watchdog {
        Watchdog::Units { unit_ns, most, advice } if !ns.is_multiple_of(unit_ns) || ns / unit_ns > most => {
            Err((format!("the watchdog is {} ms", ns as f64 * 1e-6), advice))
        }
        Watchdog::Missing { message, advice } if ns > 0 => Err((message.into(), advice)),
        Watchdog::Any | Watchdog::Units { .. } | Watchdog::Missing { .. } => Ok(()),
    }
}

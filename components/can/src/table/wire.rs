//! Checks against the wire: frames that a drive does not support, identifiers shared by two drives, and
//! numbers beyond their fields.

use core::f64::consts::TAU;

use super::refusal::Refusal;
use super::{BusEntry, ControlMode, DriveEntry, Protocol, Table};
use crate::damiao;
use crate::frame::{Form, Id};
use crate::moteus;

/// Refuses classic-only drives on a bus with drives that receive CAN FD frames.
pub(super) fn check_forms(table: &Table, bus: &BusEntry) -> Result<(), Refusal> {
    let on_bus = || table.drives.iter().filter(|drive| drive.bus == bus.name);
    let of = |form| on_bus().find(|drive| table.form(drive) == form);
    let (Some(fast), Some(classic)) = (of(Form::FdFast), of(Form::Classic)) else { return Ok(()) };
    let message = format!(
        "bus `{}`: drives of {:?} are sent frames of CAN FD, which one of {:?} does not know, and disturbs",
        bus.name, fast.protocol, classic.protocol
    );
    Err((
        message,
        "put them on buses of their own, or leave `data_bitrate` out where all know classic frames",
    ))
}

/// Identifiers of a drive's commands and of its answers, on a bus shared by several protocols.
fn identifiers(table: &Table, index: usize) -> Option<(Id, Id)> {
    let entry = &table.drives[index];
    match (table.drive(index), entry.protocol) {
        (Some(drive), _) => Some((drive.id(), drive.reply_id)),
        (None, Protocol::Moteus) => moteus::Node::new(entry.node).map(|node| (node.id(), node.reply_id())),
        (None, _) => None,
    }
}

/// Refuses a drive whose answers another one would interpret as commands, or whose answers look like another
/// protocol's.
pub(super) fn check_identifiers(table: &Table, index: usize) -> Result<(), Refusal> {
    let drive = &table.drives[index];
    let Some((mine, answers)) = identifiers(table, index) else { return Ok(()) };
    let refuse = |message: String| Err((message, "choose another `master`, or another `node`"));
    if answers == mine || answers == damiao::EVERYBODY {
        return refuse("the identifier of its answers is taken".into());
    }
    for (i, other) in
        table.drives.iter().enumerate().filter(|(i, other)| *i != index && other.bus == drive.bus)
    {
        let Some((theirs, their_answers)) = identifiers(table, i) else { continue };
        if answers == theirs {
            return refuse(format!(
                "its answers have the identifier {answers}, like commands to `{}`",
                other.joint
            ));
        }
        // answers of one protocol contain the drive's number
        if answers == their_answers && drive.protocol != other.protocol {
            return refuse(format!(
                "its answers have the identifier {answers}, like the answers of `{}`, a drive of {:?}",
                other.joint, other.protocol
            ));
        }
    }
    Ok(())
}

/// Largest number in 16-bit thousandths: feed-forward of an ODrive, torques of CiA 402.
const THOUSANDTHS: f64 = 32.767;

/// Refuses numbers beyond the fields of the drive's protocol, and watchdogs beyond the range of their unit.
pub(super) fn check_fields(drive: &DriveEntry) -> Result<(), Refusal> {
    let ranges = &drive.ranges;
    let mode = drive.mode.unwrap_or_default();
    let beyond = |name: &str, value: f64, unit: &str, most: f64, field: &str| {
        (value > most).then(|| format!("a {name} of {value} {unit}, and {field} ends at {most:.2}"))
    };
    let increments = drive.increments.unwrap_or(1.0);
    let whole = f64::from(i32::MAX) / increments * TAU;
    let found = match drive.protocol {
        Protocol::Odrive if mode == ControlMode::Position => {
            let field = "the field of its feed-forward";
            beyond("velocity", ranges.velocity, "rad/s", THOUSANDTHS * TAU, field)
                .or_else(|| beyond("torque", ranges.torque, "N m", THOUSANDTHS, field))
        }
        Protocol::Cia402 => beyond("position", ranges.position, "rad", whole, "its field of 32 bits")
            .or_else(|| beyond("velocity", ranges.velocity, "rad/s", whole, "its field of 32 bits"))
            .or_else(|| {
                let most = drive.rated_torque.unwrap_or(1.0) * THOUSANDTHS;
                let field = "object 0x6071, in thousandths of the rated torque,";
                if mode == ControlMode::Torque {
                    beyond("torque", ranges.torque, "N m", most, field)
                } else {
                    None
                }
            }),
        _ => None,
    };
    if let Some(message) = found {
        return Err((
            message,
            "write what the drive reaches within it: `ranges` refer to the output shaft of the drive",
        ));
    }
    let (unit_ns, most, advice) = match drive.protocol {
        Protocol::Damiao => (50_000, u32::MAX.into(), "write a multiple of 50 us: register 9 has them"),
        Protocol::Moteus => {
            (1_000_000, 32_767, "write whole milliseconds, up to 32767: its commands have them")
        }
        Protocol::Cia402 => {
            (1_000_000, 65_535, "write whole milliseconds, up to 65535: object 0x1016 has them")
        }
        _ => return Ok(()),
    };
    let ns = drive.watchdog.ns;
    if !ns.is_multiple_of(unit_ns) || ns / unit_ns > most {
        return Err((format!("a watchdog of {} ms", ns as f64 * 1e-6), advice));
    }
    Ok(())
}

//! Checks of a drive table that do not require a robot.

use super::{Table, TableError};
use super::{current, homing, wire};
use crate::Range;
use crate::bus::offered::Place;
use crate::protocols::entries::{BusEntry, BusKind, ControlMode, DriveEntry, LoopEntry};
use crate::protocols::spec::Refusal;
use crate::servo::{FAST_HEAD, LONGEST};

/// Mistake in a table: entry with its index, value found, and advice.
pub(super) type Mistake = (Option<(&'static str, usize)>, String, &'static str);

/// Maximum number of servos on one serial line, limited by the size of one packet.
const SERVOS: usize = 50;

impl Table {
    /// Checks a table without a robot.
    ///
    /// # Errors
    /// Returns an error if a value is invalid.
    pub fn check(&self) -> Result<(), TableError> {
        let named =
            |(entry, message, advice)| TableError { line: None, column: None, entry, message, advice };
        check(self).map_err(named)
    }
}

/// Returns the first mistake of a table.
fn check(table: &Table) -> Result<(), Mistake> {
    for (index, bus) in table.buses.iter().enumerate() {
        let at = |(message, advice): Refusal| (Some(("bus", index)), message, advice);
        check_bus(bus, &table.buses[..index]).map_err(at)?;
        check_protocols(table, bus).map_err(at)?;
    }
    for (index, drive) in table.drives.iter().enumerate() {
        let at = |(message, advice): Refusal| {
            (Some(("drive", index)), format!("drive of `{}`: {message}", drive.joint), advice)
        };
        check_drive(table, index).and_then(|()| check_protocol(table, drive)).map_err(at)?;
    }
    if table.drives.is_empty() {
        return Err((None, "there is no drive".into(), "add a `[[drive]]` for each joint"));
    }
    Ok(())
}

fn check_bus(bus: &BusEntry, before: &[BusEntry]) -> Result<(), Refusal> {
    let refuse = |message: &str, advice| Err((format!("bus `{}`: {message}", bus.name), advice));
    let is_serial = bus.kind == BusKind::Serial;
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
    if bus.name.is_empty() || !bus.name.chars().all(is_plain) {
        let message = format!("the bus name {:?} is invalid", bus.name);
        return Err((message, "use letters, digits, `_` and `-`: the ports of the bus contain its name"));
    }
    let speeds = if is_serial { 9_600..=4_000_000 } else { 10_000..=1_000_000 };
    if !speeds.contains(&bus.bitrate) {
        let advice = match is_serial {
            true => "write a number from 9600 to 4000000, in bit/s",
            false => "write a number from 10000 to 1000000, in bit/s",
        };
        return refuse(&format!("the bitrate is {} bit/s", bus.bitrate), advice);
    }
    if bus.data_bitrate.is_some() && is_serial {
        return refuse("a serial line has no data bitrate", "leave `data_bitrate` out");
    }
    if bus.data_bitrate.is_some_and(|fast| fast < bus.bitrate || fast > 8_000_000) {
        let advice = "write a number from `bitrate` to 8000000, in bit/s";
        return refuse("the data bitrate is below `bitrate` or above 8000000 bit/s", advice);
    }
    if let Some(place) = bus.interface.as_deref().and_then(Place::from_interface) {
        check_place(bus, place)?;
    } else if let Some(interface) = &bus.interface {
        let is_path = interface.starts_with('/');
        if is_serial && !is_path {
            let message = format!("the serial line {interface:?} is not a path");
            return refuse(&message, "write its path, such as `/dev/ttyACM0`");
        }
        if interface.is_empty() || (interface.len() > 15 && !is_path) {
            let advice = "write the name of an interface as in `ip link` (1 to 15 letters), or the path of a serial line, such as `/dev/ttyACM0`";
            return refuse(&format!("the interface name {interface:?} is invalid"), advice);
        }
    }
    if before.iter().any(|other| bus.interface.is_some() && other.interface == bus.interface) {
        return refuse("another bus already uses this interface", "give each bus its own interface");
    }
    if before.first().is_some_and(|first| first.interface.is_some() != bus.interface.is_some()) {
        let advice = "give every bus an `interface`, or leave `interface` out of every bus";
        return refuse("the table contains both simulated and real buses", advice);
    }
    let is_offered =
        |bus: &BusEntry| bus.interface.as_deref().is_some_and(|name| Place::from_interface(name).is_some());
    if before.first().is_some_and(|first| is_offered(first) != is_offered(bus)) {
        let advice = "give all buses the address of a simulated bus (`unix:`, `pty:`), or none";
        return refuse("the table contains both simulated buses and interfaces of the computer", advice);
    }
    if before.iter().any(|other| other.name == bus.name) {
        return Err((format!("bus `{}` is defined twice", bus.name), "name each bus once"));
    }
    Ok(())
}

/// Checks the address of a simulated bus for other programs.
fn check_place(bus: &BusEntry, place: Place<'_>) -> Result<(), Refusal> {
    let refuse = |message: &str, advice| Err((format!("bus `{}`: {message}", bus.name), advice));
    match place {
        Place::Socket(name)
            if name.is_empty() || name.len() > 60 || !name.bytes().all(|c| c.is_ascii_graphic()) =>
        {
            refuse(&format!("the socket name {name:?} is invalid"), "write `unix:NAME`, with 1 to 60 letters")
        }
        Place::Terminal(path) if !path.starts_with('/') => {
            let advice =
                "write `pty:PATH`, with the absolute path of the link to create, such as `pty:/tmp/can0`";
            refuse(&format!("the terminal {path:?} is not an absolute path"), advice)
        }
        _ => Ok(()),
    }
}

/// Refuses drives on one bus whose identifiers have a different meaning in another drive's protocol.
fn check_protocols(table: &Table, bus: &BusEntry) -> Result<(), Refusal> {
    let on_bus = || table.drives.iter().filter(|drive| drive.bus == bus.name);
    let Some(first) = on_bus().next() else { return Ok(()) };
    let other = on_bus().find(|drive| drive.protocol != first.protocol);
    if let Some(other) = other
        && !(first.protocol.spec().shares_bus && other.protocol.spec().shares_bus)
    {
        let message = format!(
            "bus `{}`: drives of {:?} and {:?} cannot share a bus",
            bus.name, first.protocol, other.protocol
        );
        return Err((
            message,
            "put ODrives, CANopen drives, and the servos of each protocol on separate buses",
        ));
    }
    wire::check_forms(table, bus)?;
    if bus.kind == BusKind::Serial && on_bus().count() > SERVOS {
        let message = format!("bus `{}`: {} servos, expected at most {SERVOS}", bus.name, on_bus().count());
        return Err((message, "spread the servos over more lines"));
    }
    if bus.fast_read {
        let (message, servos) = (format!("bus `{}`: a fast read", bus.name), on_bus().count());
        let Some(answer) = first.protocol.spec().fast_answer else {
            let advice = "leave `fast_read` out: only Dynamixels answer in one packet";
            return Err((format!("{message} is not supported by drives of {:?}", first.protocol), advice));
        };
        let most = (LONGEST - FAST_HEAD) / answer;
        if servos > most {
            let message =
                format!("{message} of {servos} servos does not fit into a packet, expected at most {most}");
            return Err((message, "leave `fast_read` out, or spread the servos over more lines"));
        }
    }
    Ok(())
}

fn check_drive(table: &Table, index: usize) -> Result<(), Refusal> {
    let (drive, before) = (&table.drives[index], &table.drives[..index]);
    let refuse = |message: String, advice| Err((message, advice));
    if table.bus_of(drive).is_none() {
        return refuse(format!("no bus is named `{}`", drive.bus), "add a `[[bus]]` with this name");
    }
    if before.iter().any(|other| other.joint == drive.joint) {
        return refuse("another drive already moves this joint".into(), "name each joint once");
    }
    if !drive.protocol.spec().nodes.contains(&drive.node) {
        let advice = "write a number from 1 (ODrive: 0), up to 15 for Damiao drives, 63 for ODrives, 126 for CiA 402 \
                      and moteus, 253 for servos (Dynamixel: 252)";
        return refuse(format!("node {} is out of range", drive.node), advice);
    }
    if before.iter().any(|other| other.bus == drive.bus && other.node == drive.node) {
        let message = format!("node {} is used twice on the bus", drive.node);
        return refuse(message, "give each drive a unique number");
    }
    if drive.master.is_some_and(|master| master > 0x7fe) {
        return refuse(
            format!("the answers have the identifier {:?}", drive.master),
            "write a `master` up to 0x7FE",
        );
    }
    wire::check_identifiers(table, index)?;
    let (ranges, torque) = (drive.ranges.ranges(), table.ranges(index).torque);
    let valid = [ranges.position, ranges.velocity, torque, ranges.kp, ranges.kd];
    if !valid.iter().all(Range::is_valid) {
        return refuse("a range is not positive".into(), "write the largest value of each field, above 0");
    }
    if !(drive.ratio.is_finite() && drive.ratio > 0.0 && drive.offset.is_finite()) {
        let advice = "write a positive ratio and a finite offset, and `reversed = true` for a drive that turns in the opposite direction";
        return refuse(format!("the ratio is {} and the offset {}", drive.ratio, drive.offset), advice);
    }
    Ok(())
}

/// Checks the keys that only some protocols support or require.
fn check_protocol(table: &Table, drive: &DriveEntry) -> Result<(), Refusal> {
    let (protocol, spec) = (drive.protocol.definition(), drive.protocol.spec());
    let Some(bus) = table.bus_of(drive).map(|index| &table.buses[index]) else { return Ok(()) };
    if spec.bus != bus.kind {
        let message =
            format!("{:?} drives cannot be on bus `{}`, which is {:?}", drive.protocol, bus.name, bus.kind);
        return Err((message, "servos are on buses with `kind = \"serial\"`, all others on CAN buses"));
    }
    protocol.check_frames(drive, bus)?;
    let keys = [
        ("master", drive.master.is_some(), "the MIT family"),
        ("mode", drive.mode.is_some(), "ODrive and CiA 402"),
        ("position_loop", drive.position_loop.is_some(), "drives with an internal loop"),
        ("report_every", drive.report_every.is_some(), "ODrive"),
        ("reference", drive.reference.is_some(), "moteus without `homing`"),
        ("eds", drive.eds.is_some(), "CiA 402"),
        ("increments", drive.increments.is_some(), "CiA 402"),
        ("rated_torque", drive.rated_torque.is_some(), "CiA 402"),
        ("rated_current", drive.rated_current.is_some(), "CiA 402"),
        ("torque_constant", drive.torque_constant.is_some(), "ODrive, Damiao and Dynamixel"),
        ("full_current", drive.full_current.is_some(), "Damiao and Feetech"),
        ("current_unit", drive.current_unit.is_some(), "Dynamixel"),
    ];
    // homing determines the position instead
    let is_known = |key| spec.has_key(key) && !(key == "reference" && drive.homing.is_some());
    if let Some((key, _, owner)) = keys.iter().find(|(key, is_there, _)| *is_there && !is_known(key)) {
        return Err((format!("`{key}` is only a key of {owner}"), "leave it out"));
    }
    protocol.check_keys(drive)?;
    current::check(drive)?;
    homing::check(drive)?;
    if drive.mode == Some(ControlMode::Velocity) && !spec.has_velocity_mode {
        return Err((
            "the mode \"velocity\" is only supported by CiA 402".into(),
            "write \"position\" or \"torque\"",
        ));
    }
    protocol.check_fields(drive)?;
    wire::check_watchdog(drive)?;
    if drive.report_every.is_some_and(|every| every.ns == 0) {
        return Err((
            "the period of encoder reports is 0".into(),
            "write the period that is configured in the drive, such as \"1 ms\"",
        ));
    }
    let is_sound =
        |gains: LoopEntry| gains.kp.is_finite() && gains.kp > 0.0 && gains.kd.is_finite() && gains.kd >= 0.0;
    let damps = drive.position_loop.is_none_or(|gains| gains.kd > 0.0);
    if drive.mode == Some(ControlMode::Velocity) && !damps {
        return Err((
            "the mode \"velocity\" requires a `kd` above 0 in `position_loop`".into(),
            "write the `kd` of the velocity loop of the drive, and `kp`: their ratio, in 1/s, is the position gain in the adapter",
        ));
    }
    if drive.position_loop.is_some_and(|gains| !is_sound(gains)) {
        return Err((
            "the gains of `position_loop` are not positive".into(),
            "write `kp` above 0, `kd` of 0 or more",
        ));
    }
    Ok(())
}

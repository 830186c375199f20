//! Checks of a drive table that need no robot.

use core::f64::consts::TAU;

use super::refusal::Refusal;
use super::{BusEntry, BusKind, ControlMode, DriveEntry, Protocol, Table, TableError};
use super::{current, homing, wire};
use crate::Range;
use crate::bus::offered::Place;
use crate::dynamixel;
use crate::servo::{FAST_AROUND, FAST_HEAD, LONGEST};

/// Mistake: the entry and its index, the value found, the advice.
pub(super) type Mistake = (Option<(&'static str, usize)>, String, &'static str);

/// Largest number of servos on one serial line, all of whose numbers fit into one packet.
const SERVOS: usize = 50;
/// Number of servos whose states fit into one packet.
const FAST_SERVOS: usize = (LONGEST - FAST_HEAD) / (dynamixel::STATE_BYTES as usize + FAST_AROUND);

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
        let message = format!("a bus named {:?}", bus.name);
        return Err((message, "name it by letters, digits, `_` and `-`: its ports are named after it"));
    }
    let speeds = if is_serial { 9_600..=4_000_000 } else { 10_000..=1_000_000 };
    if !speeds.contains(&bus.bitrate) {
        let advice = match is_serial {
            true => "write bits per second, 9600 to 4000000",
            false => "write bits per second, 10000 to 1000000",
        };
        return refuse(&format!("a bitrate of {}", bus.bitrate), advice);
    }
    if bus.data_bitrate.is_some() && is_serial {
        return refuse("a bitrate of data on a serial line", "leave `data_bitrate` out");
    }
    if bus.data_bitrate.is_some_and(|fast| fast < bus.bitrate || fast > 8_000_000) {
        let advice = "write bits per second, from `bitrate` to 8000000";
        return refuse("a bitrate of data below the other, or too high", advice);
    }
    if let Some(place) = bus.interface.as_deref().and_then(Place::from_interface) {
        check_place(bus, place)?;
    } else if let Some(interface) = &bus.interface {
        let is_path = interface.starts_with('/');
        if is_serial && !is_path {
            let message = format!("a serial line named {interface:?}");
            return refuse(&message, "write its path, such as `/dev/ttyACM0`");
        }
        if interface.is_empty() || (interface.len() > 15 && !is_path) {
            let advice = "name one as `ip link` does: 1 to 15 letters; or a serial line: `/dev/ttyACM0`";
            return refuse(&format!("an interface named {interface:?}"), advice);
        }
    }
    if before.iter().any(|other| bus.interface.is_some() && other.interface == bus.interface) {
        return refuse("another bus has its interface", "each bus has a separate interface");
    }
    if before.first().is_some_and(|first| first.interface.is_some() != bus.interface.is_some()) {
        let advice = "give all of them an `interface`, or none";
        return refuse("simulated buses and real ones in one table", advice);
    }
    let is_offered =
        |bus: &BusEntry| bus.interface.as_deref().is_some_and(|name| Place::from_interface(name).is_some());
    if before.first().is_some_and(|first| is_offered(first) != is_offered(bus)) {
        let advice = "give all of them a place of a simulated bus (`unix:`, `pty:`), or none";
        return refuse("simulated buses and interfaces of the computer in one table", advice);
    }
    if before.iter().any(|other| other.name == bus.name) {
        return Err((format!("bus `{}` stands there twice", bus.name), "name each bus once"));
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
            refuse(&format!("a socket named {name:?}"), "write `unix:NAME`, with 1 to 60 letters")
        }
        Place::Terminal(path) if !path.starts_with('/') => {
            let advice =
                "write `pty:PATH`, with the whole path of a link that is made, such as `pty:/tmp/can0`";
            refuse(&format!("a terminal at {path:?}"), advice)
        }
        _ => Ok(()),
    }
}

/// Refuses drives on one bus whose identifiers have another meaning in the protocol of others.
fn check_protocols(table: &Table, bus: &BusEntry) -> Result<(), Refusal> {
    let on_bus = || table.drives.iter().filter(|drive| drive.bus == bus.name);
    let takes_all =
        |protocol: Protocol| matches!(protocol, Protocol::Odrive | Protocol::Cia402) || protocol.is_servo();
    let Some(first) = on_bus().next() else { return Ok(()) };
    let other = on_bus().find(|drive| drive.protocol != first.protocol);
    if let Some(other) = other
        && (takes_all(first.protocol) || takes_all(other.protocol))
    {
        let message = format!(
            "bus `{}`: drives of {:?} and {:?}, which do not share a bus",
            bus.name, first.protocol, other.protocol
        );
        return Err((
            message,
            "put ODrives, CANopen drives, and the servos of each protocol on buses of their own",
        ));
    }
    wire::check_forms(table, bus)?;
    if bus.kind == BusKind::Serial && on_bus().count() > SERVOS {
        let message = format!("bus `{}`: {} servos, expected at most {SERVOS}", bus.name, on_bus().count());
        return Err((message, "spread them over more lines"));
    }
    if bus.fast_read {
        let (message, servos) = (format!("bus `{}`: a fast read", bus.name), on_bus().count());
        if first.protocol != Protocol::Dynamixel {
            let advice = "leave `fast_read` out: only Dynamixels answer in one packet";
            return Err((format!("{message} of drives of {:?}", first.protocol), advice));
        }
        if servos > FAST_SERVOS {
            let message = format!(
                "{message} of {servos} servos, whose packet is too long: expected at most {FAST_SERVOS}"
            );
            return Err((message, "leave `fast_read` out, or spread them over more lines"));
        }
    }
    Ok(())
}

fn check_drive(table: &Table, index: usize) -> Result<(), Refusal> {
    let (drive, before) = (&table.drives[index], &table.drives[..index]);
    let refuse = |message: String, advice| Err((message, advice));
    if table.bus_of(drive).is_none() {
        return refuse(format!("no bus is named `{}`", drive.bus), "add a `[[bus]]` of that name");
    }
    if before.iter().any(|other| other.joint == drive.joint) {
        return refuse("another drive moves that joint".into(), "name each joint once");
    }
    let first = u8::from(drive.protocol != Protocol::Odrive);
    if drive.node < first || drive.node > drive.protocol.last_node() {
        let advice = "nodes are numbered from 1 (ODrive: 0); those of Damiao drives end at 15, of ODrives at 63, of \
                      CiA 402 and moteus at 126, of servos at 253 (Dynamixel: 252)";
        return refuse(format!("node {}", drive.node), advice);
    }
    if before.iter().any(|other| other.bus == drive.bus && other.node == drive.node) {
        let message = format!("node {} stands on that bus twice", drive.node);
        return refuse(message, "give each its own number");
    }
    if drive.master.is_some_and(|master| master > 0x7fe) {
        return refuse(
            format!("answers with the identifier {:?}", drive.master),
            "write a `master` up to 0x7FE",
        );
    }
    wire::check_identifiers(table, index)?;
    let (ranges, torque) = (drive.ranges.ranges(), table.ranges(index).torque);
    let valid = [ranges.position, ranges.velocity, torque, ranges.kp, ranges.kd];
    if !valid.iter().all(Range::is_valid) {
        return refuse("a range that is not positive".into(), "write the largest value of each field");
    }
    let gains = drive.ranges.kp.is_some() || drive.ranges.kd.is_some();
    if gains && drive.protocol == Protocol::Damiao {
        let advice = "leave `kp` and `kd` out, and let `ratio` scale them";
        return refuse("the gains of a Damiao drive end at 500 and 5".into(), advice);
    }
    if !(drive.ratio.is_finite() && drive.ratio > 0.0 && drive.offset.is_finite()) {
        let advice = "write a positive ratio, and `reversed = true` for a drive that turns the other way";
        return refuse(format!("a ratio of {}, an offset of {}", drive.ratio, drive.offset), advice);
    }
    Ok(())
}

/// Checks the keys that only one protocol supports or requires.
fn check_protocol(table: &Table, drive: &DriveEntry) -> Result<(), Refusal> {
    let protocol = drive.protocol;
    let Some(bus) = table.bus_of(drive).map(|index| &table.buses[index]) else { return Ok(()) };
    if protocol.bus() != bus.kind {
        let message = format!("{protocol:?} on the bus `{}`, which is {:?}", bus.name, bus.kind);
        return Err((message, "servos are on buses with `kind = \"serial\"`, all others on CAN buses"));
    }
    if protocol == Protocol::Moteus && bus.data_bitrate.is_none() {
        let message = format!("moteus on the classic bus `{}`", bus.name);
        return Err((message, "its frames are CAN FD: give the bus a `data_bitrate`, usually 5_000_000"));
    }
    if protocol == Protocol::Moteus {
        check_moteus(drive)?;
    }
    let is_cia402 = protocol == Protocol::Cia402;
    let foreign = [
        ("master", drive.master.is_some(), protocol.reply().is_some(), "the MIT family"),
        ("mode", drive.mode.is_some(), protocol.has_modes(), "ODrive and CiA 402"),
        (
            "position_loop",
            drive.position_loop.is_some(),
            protocol.has_loop(),
            "drives with a loop of their own",
        ),
        ("report_every", drive.report_every.is_some(), protocol == Protocol::Odrive, "ODrive"),
        (
            "reference",
            drive.reference.is_some(),
            protocol == Protocol::Moteus && drive.homing.is_none(),
            "moteus without `homing`",
        ),
        ("eds", drive.eds.is_some(), is_cia402, "CiA 402"),
        ("increments", drive.increments.is_some(), is_cia402, "CiA 402"),
        ("rated_torque", drive.rated_torque.is_some(), is_cia402, "CiA 402"),
        ("rated_current", drive.rated_current.is_some(), is_cia402, "CiA 402"),
        (
            "torque_constant",
            drive.torque_constant.is_some(),
            matches!(protocol, Protocol::Odrive | Protocol::Damiao | Protocol::Dynamixel),
            "ODrive, Damiao and Dynamixel",
        ),
        (
            "full_current",
            drive.full_current.is_some(),
            matches!(protocol, Protocol::Damiao | Protocol::Feetech),
            "Damiao and Feetech",
        ),
        ("current_unit", drive.current_unit.is_some(), protocol == Protocol::Dynamixel, "Dynamixel"),
    ];
    if let Some((key, _, _, owner)) = foreign.iter().find(|(_, is_there, is_known, _)| *is_there && !is_known)
    {
        return Err((format!("`{key}`, which is a key of {owner}"), "leave it out"));
    }
    let positive = |value: Option<f64>| value.is_some_and(|value| value.is_finite() && value > 0.0);
    if is_cia402 && !(positive(drive.increments) && positive(drive.rated_torque)) {
        let message = format!("increments {:?}, rated torque {:?}", drive.increments, drive.rated_torque);
        let advice = "write `increments` per turn of the output shaft, and `rated_torque`, object 0x6076 in N m, or an `eds` that has them";
        return Err((message, advice));
    }
    current::check(drive)?;
    homing::check(drive)?;
    if drive.mode == Some(ControlMode::Velocity) && !is_cia402 {
        return Err(("velocities, which are a mode of CiA 402".into(), "write \"position\" or \"torque\""));
    }
    wire::check_fields(drive)?;
    if protocol == Protocol::Feetech && drive.watchdog.ns > 0 {
        let advice = "write `watchdog = \"0 s\"`, and `allow_no_watchdog = true` for the adapter: it holds its last goal";
        return Err(("a watchdog, which such a servo does not have".into(), advice));
    }
    let (unit_ns, most) = (dynamixel::WATCHDOG_UNIT_NS, dynamixel::LONGEST_WATCHDOG);
    if protocol == Protocol::Dynamixel
        && !(drive.watchdog.ns.is_multiple_of(unit_ns) && drive.watchdog.ns / unit_ns <= most)
    {
        return Err((
            format!("a watchdog of {} ms", drive.watchdog.ns as f64 * 1e-6),
            "write a multiple of 20 ms, up to 2540 ms: register 98 has them",
        ));
    }
    if drive.report_every.is_some_and(|every| every.ns == 0) {
        return Err(("no report of the encoder".into(), "let the drive report it, every cycle if it can"));
    }
    let sound = |gain: f64| gain.is_finite() && gain >= 0.0;
    let damps = drive.position_loop.is_none_or(|gains| gains.kd > 0.0);
    if drive.mode == Some(ControlMode::Velocity) && !damps {
        return Err((
            "velocities, and a loop without `kd`".into(),
            "write the `kd` of the velocity loop of the drive, and `kp`: their ratio, in 1/s, is the position gain in the adapter",
        ));
    }
    if drive.position_loop.is_some_and(|gains| !sound(gains.kd) || !positive(Some(gains.kp))) {
        return Err((
            "gains of its loop that are not positive".into(),
            "write `kp` above 0, `kd` of 0 or more",
        ));
    }
    Ok(())
}

/// Largest values of 16-bit registers: position and velocity (converted from turns and turns per second) and
/// torque.
const MOTEUS_MOST: [f64; 3] = [3.2767 * TAU, 8.19175 * TAU, 327.67];

/// Refuses ranges beyond the registers of a moteus, where all larger values would be clamped.
fn check_moteus(drive: &DriveEntry) -> Result<(), Refusal> {
    let ranges = [drive.ranges.position, drive.ranges.velocity, drive.ranges.torque];
    let names = [("position", "rad"), ("velocity", "rad/s"), ("torque", "N m")];
    let beyond = ranges.into_iter().zip(MOTEUS_MOST).zip(names).find(|((value, most), _)| value > most);
    beyond.map_or(Ok(()), |((value, most), (name, unit))| {
        let message = format!("a {name} of {value} {unit}, and the registers of a moteus end at {most:.2}");
        Err((message, "reduce it; `ratio` is the ratio of the joint to the output of the drive"))
    })
}

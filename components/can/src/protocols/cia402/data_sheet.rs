//! Checks of a drive's table entry against its data sheet.

use core::f64::consts::TAU;
use std::io;

use super::codec::eds::Eds;
use super::codec::{Mapping, Mode, Node, Object, Service};
use crate::protocols::entries::{ControlMode, DriveEntry, HomingBy};
use crate::protocols::spec::Refusal;

/// Objects that the adapter writes in addition to the mappings.
const WRITTEN: [Object; 4] =
    [Object::HEARTBEAT_CONSUMER, Object::MODE, Object::INTERPOLATION_UNITS, Object::INTERPOLATION_EXPONENT];

/// Additional objects that the adapter writes for a homing by the drive.
const HOMED: [Object; 5] = [
    Object::HOMING_METHOD,
    Object::HOMING_VELOCITY,
    Object::HOMING_CREEP_VELOCITY,
    Object::HOMING_ACCELERATION,
    Object::HOME_OFFSET,
];

const CORRECT: &str = "correct the entry of the drive, or name the data sheet of its firmware";

/// Fills in missing increments, rated torque and rated current of an entry from the drive's data sheet, and
/// checks the other keys.
pub(crate) fn complete(
    drive: &mut DriveEntry,
    read: &dyn Fn(&str) -> io::Result<String>,
) -> Result<(), Refusal> {
    let Some(name) = drive.eds.clone() else { return Ok(()) };
    let text = read(&name).map_err(|error| {
        (format!("{name}: {error}"), "name an EDS or DCF file, relative to the drive table")
    })?;
    let sheet = Eds::parse(&text).map_err(|error| {
        (format!("{name}, {error}"), "use an EDS or DCF file as published by the manufacturer")
    })?;
    let at = |(message, advice): Refusal| (format!("{name}: {message}"), advice);
    scales(drive, &sheet);
    mode(drive, &sheet).map_err(at)?;
    drive.fixed_mappings = fixed(drive, &sheet).map_err(at)?;
    let object = |(index, subindex)| Object { index, subindex };
    let limits_current = drive.current_limit.map(|_| Object::MAX_CURRENT);
    let needed = WRITTEN.iter().copied().chain(limits_current).map(|object| (object, true));
    let is_homed = homes_itself(drive);
    let homed = HOMED.map(|object| (object, true)).into_iter().chain([(Object::MODE_DISPLAY, false)]);
    let needed = needed.chain(homed.filter(|_| is_homed));
    for (needed, is_written) in needed.chain([(Object::RATED_TORQUE, false), (object((0x6040, 0)), false)]) {
        let Some(entry) = sheet.entry(needed) else {
            return Err(at((
                format!("the drive has no object {}, which the adapter needs", display_object(needed)),
                "such a drive cannot be commanded in a cyclic synchronous mode; look for newer firmware",
            )));
        };
        if is_written && !entry.is_writable() {
            let message = format!(
                "line {}: {} \"{}\" is read-only",
                entry.line(),
                display_object(needed),
                entry.name()
            );
            return Err(at((message, CORRECT)));
        }
    }
    limits(drive, &sheet).and_then(|()| method(drive, &sheet)).map_err(at)
}

/// Refuses a homing method outside of the drive's limits, 0x6098.
fn method(drive: &DriveEntry, sheet: &Eds) -> Result<(), Refusal> {
    let method = drive.homing.as_ref().and_then(|homing| homing.method).map(i64::from);
    let (Some(method), Some(entry)) = (method, sheet.entry(Object::HOMING_METHOD)) else { return Ok(()) };
    // a signed byte, which some data sheets write as unsigned
    let signed = |limit: i64| if (128..256).contains(&limit) { limit - 256 } else { limit };
    let (low, high) = (entry.low(drive.node).map(signed), entry.high(drive.node).map(signed));
    // unsigned limits that cover the whole byte do not restrict the method
    let is_range = !matches!((low, high), (Some(low), Some(high)) if low > high);
    let is_beyond = low.is_some_and(|low| method < low) || high.is_some_and(|high| method > high);
    if is_range && is_beyond {
        let message =
            format!("line {}: `homing.method` is {method}, beyond the methods of 0x6098", entry.line());
        return Err((message, "write a method of the drive's manual"));
    }
    Ok(())
}

/// Returns `true` if the drive uses its own homing procedure.
fn homes_itself(drive: &DriveEntry) -> bool {
    drive.homing.as_ref().is_some_and(|homing| homing.by == HomingBy::Drive)
}

/// Formats an object in the usual notation.
fn display_object(object: Object) -> String {
    format!("0x{:04X}:{:02X}", object.index, object.subindex)
}

/// Fills in the increments per turn of the output shaft, the rated torque (0x6076) and the rated current
/// (0x6075). The increments follow from the feed constant 0x6092, or else from the encoder 0x608F and the
/// gear 0x6091.
fn scales(drive: &mut DriveEntry, sheet: &Eds) {
    let ratio = |index| {
        let number = |subindex| sheet.value(index, subindex, drive.node).filter(|number| *number > 0);
        Some(number(1)? as f64 / number(2)? as f64)
    };
    let encoder = || Some(ratio(0x608f)? * ratio(0x6091).unwrap_or(1.0));
    let increments = ratio(0x6092).or_else(encoder);
    let torque = sheet.value(0x6076, 0, drive.node).filter(|torque| *torque > 0);
    let current = sheet.value(0x6075, 0, drive.node).filter(|current| *current > 0);
    drive.increments = drive.increments.or(increments);
    drive.rated_current = drive.rated_current.or(current.map(|current| current as f64 * 1e-3));
    drive.rated_torque = drive.rated_torque.or(torque.map(|torque| torque as f64 * 1e-3));
}

/// Returns the CiA 402 mode of the entry.
fn cyclic(drive: &DriveEntry) -> Mode {
    match drive.mode.unwrap_or_default() {
        ControlMode::Position => Mode::Position,
        ControlMode::Velocity => Mode::Velocity,
        ControlMode::Torque => Mode::Torque,
    }
}

/// Refuses a mode that is missing in the drive's object 0x6502, where bit 7 represents mode 8.
fn mode(drive: &DriveEntry, sheet: &Eds) -> Result<(), Refusal> {
    let known = sheet.entry(Object::SUPPORTED_MODES).and_then(|entry| entry.value(drive.node));
    let mode = cyclic(drive);
    match known {
        Some(known) if known != 0 && known >> (mode as u8 - 1) & 1 == 0 => {
            let message = format!(
                "the drive does not support the mode {} of `mode`: 0x6502 is 0x{known:X}",
                mode as u8
            );
            let advice = "0x80 is position, 0x100 velocity, 0x200 torque: write a `mode` that it supports";
            Err((message, advice))
        }
        Some(known) if known != 0 && known >> 5 & 1 == 0 && homes_itself(drive) => {
            let message = format!("the drive does not support homing: 0x6502 is 0x{known:X}");
            Err((
                message,
                "0x20 is homing, mode 6: leave `homing` out, or home it at its stop with `mode = \"torque\"`",
            ))
        }
        _ => Ok(()),
    }
}

/// Returns the process data of an entry whose mapping is read-only.
pub(crate) fn fixed_mappings(drive: &DriveEntry) -> Vec<Mapping> {
    let is_fixed = |(number, _): &(u8, Mapping)| drive.fixed_mappings.contains(number);
    (0..).zip(Mapping::ALL).filter(is_fixed).map(|(_, mapping)| mapping).collect()
}

/// Returns the indices of the process data with a read-only mapping, which must match the adapter's mapping.
fn fixed(drive: &DriveEntry, sheet: &Eds) -> Result<Vec<u8>, Refusal> {
    let (node, mode) = (Node::new(drive.node).unwrap_or(Node::FIRST), cyclic(drive));
    let mut fixed = Vec::new();
    for (number, mapping) in (0..).zip(Mapping::ALL) {
        let mut is_fixed = false;
        for step in 0..Mapping::STEPS {
            let Service::Write(object, value) = mapping.step(node, mode, step) else { continue };
            let Some(entry) = sheet.entry(object) else {
                let message =
                    format!("the drive has no object {}, which the adapter writes", display_object(object));
                return Err((message, "the drive has too few process data, or too few objects in them"));
            };
            if !object.is_mapping() || entry.is_writable() || value.number() == 0 {
                continue;
            }
            is_fixed = true;
            let found = entry.value(drive.node);
            if found != Some(value.number().into()) {
                let found = found.map_or_else(|| "nothing".to_string(), |found| format!("0x{found:08X}"));
                let message = format!(
                    "line {}: {} maps {found} and cannot be written, expected 0x{:08X}",
                    entry.line(),
                    display_object(object),
                    value.number()
                );
                return Err((message, "choose another `mode`, or a drive whose process data can be mapped"));
            }
        }
        if is_fixed {
            fixed.push(number);
        }
    }
    Ok(fixed)
}

/// Refuses ranges beyond the limits of the drive.
fn limits(drive: &DriveEntry, sheet: &Eds) -> Result<(), Refusal> {
    let (node, ranges) = (drive.node, &drive.ranges);
    let high = |index| {
        let entry = sheet.entry(Object { index, subindex: 0 })?;
        entry.high(node).filter(|high| *high > 0).map(|high| high as f64)
    };
    let value = |index, subindex| {
        sheet.value(index, subindex, node).filter(|value| *value > 0).map(|value| value as f64)
    };
    let least = |one: Option<f64>, two: Option<f64>| one.into_iter().chain(two).reduce(f64::min);
    let turn = drive.increments.map(|increments| TAU / increments);
    let torque = drive.rated_torque.map(|torque| torque * 1e-3);
    let scaled = |limit: Option<f64>, scale: Option<f64>| Some(limit? * scale?);
    let all = [
        (
            "position",
            "rad",
            ranges.position,
            scaled(least(high(0x607a), value(0x607d, 2)), turn),
            "0x607A, 0x607D",
        ),
        ("velocity", "rad/s", ranges.velocity, scaled(high(0x60ff), turn), "0x60FF"),
        (
            "torque",
            "N m",
            ranges.torque,
            scaled(least(high(0x6071), value(0x6072, 0)), torque),
            "0x6071, 0x6072",
        ),
    ];
    for (key, unit, found, limit, objects) in all {
        if let Some(limit) = limit
            && found > limit * (1.0 + 1e-9)
        {
            let message = format!(
                "`ranges.{key}` is {found} {unit}, but the drive is limited to {limit:.4} ({objects})"
            );
            return Err((message, "write a range that the drive reaches: commands beyond it are clamped"));
        }
    }
    Ok(())
}

//! Homing of drives whose position is unknown after power-up.

use super::refusal::Refusal;
use super::{ControlMode, DriveEntry, HomingBy, HomingEntry, Protocol};
use core::f64::consts::TAU;

/// Objects of a CiA 402 homing, in units of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HomingObjects {
    /// 0x6098.
    pub(crate) method: i8,
    /// 0x6099:01 and 02, increments per second.
    pub(crate) velocities: [u32; 2],
    /// 0x609A, increments per second squared.
    pub(crate) acceleration: u32,
}

impl DriveEntry {
    /// Returns `true` if the joint has to move before its position is known.
    pub fn is_homed(&self) -> bool {
        self.homing.is_some() && !self.protocol.is_servo()
    }

    /// Objects written for the homing, with index, subindex and number; empty without a CiA 402 homing.
    ///
    /// Velocities are increments of the drive per second.
    pub fn homing_registers(&self) -> Vec<(u16, u8, i64)> {
        let Some(HomingObjects { method, velocities, acceleration }) = self.homing_objects() else {
            return Vec::new();
        };
        vec![
            (0x6098, 0, method.into()),
            (0x6099, 1, velocities[0].into()),
            (0x6099, 2, velocities[1].into()),
            (0x609a, 0, acceleration.into()),
            (0x607c, 0, 0),
        ]
    }

    /// Homing objects; `None` if the drive does not home with its own procedure, or if a value does not fit
    /// into its object.
    pub(crate) fn homing_objects(&self) -> Option<HomingObjects> {
        let homing = self.homing.as_ref().filter(|homing| homing.by == HomingBy::Drive)?;
        let per_joint = self.increments? / TAU * self.ratio;
        let whole = |value: Option<f64>| {
            let increments = (value? * per_joint + 0.5).floor();
            (1.0..=f64::from(u32::MAX)).contains(&increments).then_some(increments as u32)
        };
        Some(HomingObjects {
            method: homing.method?,
            velocities: [whole(homing.velocity)?, whole(homing.creep_velocity)?],
            acceleration: whole(homing.acceleration)?,
        })
    }
}

/// Refuses a homing that the drive does not support.
pub(super) fn check(drive: &DriveEntry) -> Result<(), Refusal> {
    let Some(homing) = &drive.homing else { return Ok(()) };
    check_keys(drive, homing)?;
    if homing.timeout.is_some_and(|timeout| timeout.ns == 0) {
        return Err((
            "`homing.timeout` is 0".into(),
            "write the time in which the mark is found, such as \"20 s\"",
        ));
    }
    match homing.by {
        HomingBy::Drive => check_own(drive, homing),
        HomingBy::Stop => check_stop(drive, homing),
    }
}

/// Refuses keys of another homing, and missing keys.
fn check_keys(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    let (is_own, is_stop) = (homing.by == HomingBy::Drive, homing.by == HomingBy::Stop);
    let is_cia402 = is_own && drive.protocol == Protocol::Cia402;
    let is_servo = drive.protocol.is_servo();
    let is_required = true;
    let keys = [
        ("order", homing.order.is_some(), !is_servo, false),
        ("timeout", homing.timeout.is_some(), !is_servo, false),
        ("procedure", homing.procedure.is_some(), is_own && drive.protocol == Protocol::Odrive, false),
        ("method", homing.method.is_some(), is_cia402, is_required),
        ("velocity", homing.velocity.is_some(), is_cia402 || is_stop, is_required),
        ("creep_velocity", homing.creep_velocity.is_some(), is_cia402, is_required),
        ("acceleration", homing.acceleration.is_some(), is_cia402, is_required),
        ("steps", homing.steps.is_some(), is_own && is_servo, is_required),
        ("effort", homing.effort.is_some(), is_stop, is_required),
        ("position", homing.position.is_some(), is_stop, is_required),
        ("back_off", homing.back_off.is_some(), is_stop, false),
        ("energy", homing.energy.is_some(), is_stop, false),
    ];
    let by = if is_own { "drive" } else { "stop" };
    for (key, is_there, is_known, is_required) in keys {
        if is_there && !is_known {
            let message =
                format!("`homing.{key}`, which a homing by the {by} of {:?} does not have", drive.protocol);
            return Err((message, "leave it out"));
        }
        if is_known && is_required && !is_there && can_home(drive, homing.by) {
            let message = format!("a homing by the {by} without `{key}`");
            return Err((message, "the page of `can.adapter` lists the keys of `homing`"));
        }
    }
    Ok(())
}

/// Returns `true` if the drive supports this homing.
fn can_home(drive: &DriveEntry, by: HomingBy) -> bool {
    match by {
        HomingBy::Drive => drive.protocol.has_modes() || drive.protocol.is_servo(),
        HomingBy::Stop => takes_torques(drive),
    }
}

/// Returns `true` if the gains and efforts of commands reach the drive.
fn takes_torques(drive: &DriveEntry) -> bool {
    let is_by_mode = drive.protocol.has_modes() && drive.mode == Some(ControlMode::Torque);
    drive.protocol.reply().is_some() || drive.protocol == Protocol::Moteus || is_by_mode
}

/// Checks a homing by the drive.
fn check_own(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    match drive.protocol {
        Protocol::Moteus => Err((
            "a homing by the drive, which moteus does not have".into(),
            "with an encoder at its output it needs none: leave `homing` out; else write `by = \"stop\"`",
        )),
        protocol if protocol.reply().is_some() => Err((
            format!("a homing by the drive, which {protocol:?} does not have"),
            "write `by = \"stop\"`; its command \"set zero\" is not sent, for many such drives keep the zero for ever",
        )),
        Protocol::Odrive | Protocol::Cia402 if drive.current_limit.is_none() => Err((
            "a homing by the drive without `current_limit`".into(),
            "write the largest current: no command gate limits a drive that homes itself",
        )),
        Protocol::Cia402 => check_objects(drive, homing),
        Protocol::Feetech => within(homing.steps, 2047, "of 11 bits and a sign: register 31"),
        Protocol::Dynamixel => within(homing.steps, 1_044_479, "of 255 turns: register 20"),
        _ => Ok(()),
    }
}

fn within(steps: Option<i32>, most: i32, advice: &'static str) -> Result<(), Refusal> {
    match steps {
        Some(steps) if steps.unsigned_abs() > most.unsigned_abs() => {
            Err((format!("`homing.steps` is {steps}, expected {} to {most}", -most), advice))
        }
        _ => Ok(()),
    }
}

/// Checks the CiA 402 objects.
fn check_objects(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    let method = homing.method.unwrap_or_default();
    if !matches!(method, i8::MIN..=-1 | 1..=14 | 17..=30 | 33 | 34 | 35 | 37) {
        return Err((
            format!("`homing.method` is {method}, which CiA 402 does not know"),
            "write object 0x6098: 1 to 14 with the index, 17 to 30 without, 33 and 34 the index alone, 37 where it is, negative ones of the maker",
        ));
    }
    let all = [
        ("velocity", homing.velocity),
        ("creep_velocity", homing.creep_velocity),
        ("acceleration", homing.acceleration),
    ];
    let scale = drive.increments.unwrap_or(1.0) / TAU * drive.ratio;
    for (key, value) in all {
        let (value, most) = (value.unwrap_or_default(), f64::from(u32::MAX));
        let increments = value * scale;
        if !(increments >= 0.5 && increments <= most) {
            let message = format!(
                "`homing.{key}` is {value}, {increments:.3} increments of the drive, expected 1 to {most}"
            );
            return Err((
                message,
                "write it in rad or m of the joint, without a sign: the method has the direction",
            ));
        }
    }
    Ok(())
}

/// Checks a homing by the adapter.
fn check_stop(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    if drive.protocol.is_servo() {
        return Err((
            "a homing at the stop, of a servo, which knows its position within a turn".into(),
            "leave `homing` out, and measure `offset` by `motorium can calibrate`",
        ));
    }
    if !takes_torques(drive) {
        return Err((
            "a homing at the stop, of a drive that follows positions or velocities with all its torque"
                .into(),
            "write `by = \"drive\"`, or `mode = \"torque\"`",
        ));
    }
    let [velocity, effort, position] =
        [homing.velocity, homing.effort, homing.position].map(Option::unwrap_or_default);
    let is_number = velocity.is_finite() && velocity != 0.0 && position.is_finite();
    let (is_positive, back_off) = (|x: f64| x.is_finite() && x > 0.0, homing.back_off());
    if !is_positive(homing.energy()) {
        let message = format!("a homing with an `energy` of {} J", homing.energy());
        return Err((message, "write what the stop stands, such as 0.1"));
    }
    if !(is_number && is_positive(effort) && is_positive(back_off)) {
        return Err((
            format!(
                "a homing with `velocity` {velocity}, `effort` {effort}, `position` {position}, `back_off` {back_off}"
            ),
            "write a velocity with the sign of its direction, a positive effort and distance, a finite position",
        ));
    }
    let (torque, ratio) = (effort / drive.ratio, drive.ratio * drive.ratio);
    if torque > drive.limited_ranges().torque.max {
        return Err((
            format!("a homing with {torque:.3} N m at the output shaft, beyond the range of torques"),
            "write less `effort`",
        ));
    }
    // its torque at standstill comes from the velocity gain
    let gain = effort / velocity.abs() / ratio;
    let most = match drive.protocol {
        Protocol::Moteus => drive.loop_gains().kd,
        protocol if protocol.reply().is_some() => drive.limited_ranges().kd.max,
        _ => f64::INFINITY,
    };
    if gain > most {
        return Err((
            format!("a homing with a velocity gain of {gain:.3} N m s/rad, and the drive ends at {most:.3}"),
            "write a higher `velocity`, or less `effort`: the gain is effort over velocity",
        ));
    }
    Ok(())
}

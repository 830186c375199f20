//! Homing of drives whose position is unknown after power-up.

use crate::protocols::entries::{DriveEntry, HomingBy, HomingEntry};
use crate::protocols::spec::Refusal;

/// Keys of a homing at a stop.
const AT_STOP: [&str; 7] = ["order", "timeout", "velocity", "effort", "position", "back_off", "energy"];
/// Required keys of a homing, if the kind of homing has them.
const REQUIRED: [&str; 7] =
    ["method", "velocity", "creep_velocity", "acceleration", "steps", "effort", "position"];

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
        HomingBy::Drive => drive.protocol.definition().check_homing(drive, homing),
        HomingBy::Stop => check_stop(drive, homing),
    }
}

/// Refuses keys of another kind of homing, and missing keys.
fn check_keys(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    let spec = drive.protocol.spec();
    let keys = [
        ("order", homing.order.is_some()),
        ("timeout", homing.timeout.is_some()),
        ("procedure", homing.procedure.is_some()),
        ("method", homing.method.is_some()),
        ("velocity", homing.velocity.is_some()),
        ("creep_velocity", homing.creep_velocity.is_some()),
        ("acceleration", homing.acceleration.is_some()),
        ("steps", homing.steps.is_some()),
        ("effort", homing.effort.is_some()),
        ("position", homing.position.is_some()),
        ("back_off", homing.back_off.is_some()),
        ("energy", homing.energy.is_some()),
    ];
    let (by, known, can_home) = match homing.by {
        HomingBy::Drive => ("drive", spec.homing.keys, spec.homing.is_supported),
        HomingBy::Stop => ("stop", &AT_STOP[..], spec.takes_torques(drive.mode)),
    };
    // a joint that does not move is homed immediately
    let is_known = |key| known.contains(&key) && (spec.homing.moves || !matches!(key, "order" | "timeout"));
    for (key, is_there) in keys {
        if is_there && !is_known(key) {
            let message =
                format!("`homing.{key}` is not a key of `by = \"{by}\"` for {:?} drives", drive.protocol);
            return Err((message, "leave it out"));
        }
        if is_known(key) && REQUIRED.contains(&key) && !is_there && can_home {
            let message = format!("a homing by the {by} requires `{key}`");
            return Err((message, "the page of `can.adapter` lists the keys of `homing`"));
        }
    }
    Ok(())
}

/// Checks a homing by the adapter.
fn check_stop(drive: &DriveEntry, homing: &HomingEntry) -> Result<(), Refusal> {
    let spec = drive.protocol.spec();
    if !spec.homing.moves {
        return Err((
            "a servo knows its position within a turn and needs no homing at the stop".into(),
            "leave `homing` out, and measure `offset` with `motorium can calibrate`",
        ));
    }
    if !spec.takes_torques(drive.mode) {
        return Err((
            "a drive that follows positions or velocities cannot be homed at the stop, because it would use its full torque"
                .into(),
            "write `by = \"drive\"`, or `mode = \"torque\"`",
        ));
    }
    let [velocity, effort, position] =
        [homing.velocity, homing.effort, homing.position].map(Option::unwrap_or_default);
    let is_number = velocity.is_finite() && velocity != 0.0 && position.is_finite();
    let (is_positive, back_off) = (|x: f64| x.is_finite() && x > 0.0, homing.back_off());
    if !is_positive(homing.energy()) {
        let message = format!("`homing.energy` is {} J, expected above 0", homing.energy());
        return Err((message, "write the energy that the stop withstands, such as 0.1"));
    }
    if !(is_number && is_positive(effort) && is_positive(back_off)) {
        return Err((
            format!(
                "invalid homing: `velocity` {velocity}, `effort` {effort}, `position` {position}, `back_off` {back_off}"
            ),
            "write a velocity with the sign of its direction, a positive effort and back-off distance, and a finite position",
        ));
    }
    let (torque, ratio) = (effort / drive.ratio, drive.ratio * drive.ratio);
    if torque > drive.limited_ranges().torque.max {
        return Err((
            format!("the homing requires {torque:.3} N m at the output shaft, beyond the range of torques"),
            "reduce `effort`",
        ));
    }
    // the torque at standstill results from the velocity gain
    let gain = effort / velocity.abs() / ratio;
    let most = drive.protocol.definition().largest_damping(drive);
    if gain > most {
        return Err((
            format!(
                "the homing requires a velocity gain of {gain:.3} N m s/rad, but the drive is limited to {most:.3}"
            ),
            "raise `velocity`, or reduce `effort`: the gain is effort over velocity",
        ));
    }
    Ok(())
}

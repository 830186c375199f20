//! Serial lines: slcan adapters and servos, and the speeds at which they are found.

use std::process::ExitCode;

use motorium_can::servo::Protocol;
use motorium_can::{SERVO_SPEEDS, ServoBus, ServoFound, adapter_version, scan_servos};
use serde_json::json;

use super::interface::refused;
use crate::exit;
use crate::out::outln;

/// Highest servo number to poll.
const LAST: u8 = 252;

/// Returns `true` if an slcan adapter is on a serial line, and reports it on standard error.
pub(super) fn is_adapter(path: &str) -> anyhow::Result<bool> {
    let version = adapter_version(path).map_err(refused)?;
    if let Some(version) = &version {
        anstream::eprintln!("an adapter with slcan on `{path}`: {version}");
    }
    Ok(version.is_some())
}

/// Searches for servos on a serial line, at these speeds or at all usual ones.
pub(super) fn scan(path: &str, speeds: &[u32], json: bool) -> anyhow::Result<ExitCode> {
    let speeds = if speeds.is_empty() { &SERVO_SPEEDS[..] } else { speeds };
    let mut found: Vec<(u32, ServoFound)> = Vec::new();
    for speed in speeds {
        let mut line = ServoBus::open(path, *speed).map_err(refused)?;
        let servos = scan_servos(&mut line, LAST, |_, time| std::thread::sleep(time));
        found.extend(servos.into_iter().map(|servo| (*speed, servo)));
    }
    if json {
        let servos: Vec<_> = found.iter().map(|(speed, servo)| as_json(*speed, servo)).collect();
        outln!(
            "{}",
            serde_json::to_string_pretty(&json!({ "interface": path, "speeds": speeds, "servos": servos }))?
        );
    } else {
        found.iter().for_each(|(speed, servo)| outln!("{}", describe(*speed, servo)));
        if found.is_empty() {
            let speeds: Vec<String> = speeds.iter().map(u32::to_string).collect();
            outln!("no servo answers on `{path}` at {} bit/s, and no adapter with slcan:", speeds.join(", "));
            outln!(
                "servos may be off, use a different speed, or be on a different line (`ls /dev/serial/by-id`)"
            );
        }
    }
    Ok(if found.is_empty() { exit::FAILED } else { ExitCode::SUCCESS })
}

fn protocol(servo: &ServoFound) -> (&'static str, u8) {
    match servo.protocol {
        // Feetech's, and Dynamixel's older ones
        Protocol::One => ("feetech", 1),
        Protocol::Two => ("dynamixel", 2),
    }
}

fn as_json(speed: u32, servo: &ServoFound) -> serde_json::Value {
    json!({
        "number": servo.number,
        "speed": speed,
        "protocol": protocol(servo).1,
        "model": servo.model.map(|(model, _)| model),
        "firmware": servo.model.map(|(_, firmware)| firmware),
        "error": servo.error,
    })
}

/// Describes a servo.
fn describe(speed: u32, servo: &ServoFound) -> String {
    let (maker, protocol) = protocol(servo);
    let model = servo
        .model
        .map_or_else(String::new, |(model, firmware)| format!(", model {model}, firmware {firmware}"));
    let error = if servo.error == 0 { String::new() } else { format!(", errors 0x{:02X}", servo.error) };
    format!("servo {:>3}  {speed:>7} bit/s  protocol {protocol} ({maker}){model}{error}", servo.number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servo_is_printed_with_all_reported_facts() {
        let servo = ServoFound { number: 7, protocol: Protocol::Two, model: Some((1200, 52)), error: 0x80 };
        assert_eq!(
            describe(57_600, &servo),
            "servo   7    57600 bit/s  protocol 2 (dynamixel), model 1200, firmware 52, errors 0x80"
        );
        let servo = ServoFound { number: 1, protocol: Protocol::One, model: None, error: 0 };
        assert_eq!(describe(1_000_000, &servo), "servo   1  1000000 bit/s  protocol 1 (feetech)");
        assert_eq!(as_json(1_000_000, &servo)["model"], serde_json::Value::Null);
    }
}

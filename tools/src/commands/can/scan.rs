//! `motorium can scan`: the interfaces of the computer, and the devices on one of them, or on a serial line.

use std::process::ExitCode;
use std::time::Duration;

use motorium::units::TimeSpan;
use motorium_can::{Device, DeviceKind, Found, Interface, Rates, RealBus, scan};
use serde_json::{Value, json};

use super::{refused, serial};
use crate::exit;
use crate::out::{out, outln};
use crate::report::table;

/// List the CAN interfaces of this computer, or the devices on one of them.
///
/// Without an interface it lists those that there are. With one it reads the registers of Damiao drives 1 to 15 and, where the bus
/// carries CAN FD, of moteus, which changes nothing, and listens for the heartbeats of ODrives and CANopen nodes. It never enables a
/// drive.
///
/// A path is a serial line. An adapter with slcan on it is found by the version that it tells, and the bus behind it is looked at
/// with `--bitrate`. On any other line servos are looked for at several speeds, by asking each number whether it is there.
///
/// The exit code is 1 if there is no interface, or no device on the one that is named.
///
/// Example: motorium can scan can0
#[derive(Debug, clap::Args)]
pub(super) struct Scan {
    /// The interface, such as `can0` or `/dev/ttyACM0`; lists those of the kernel if not given
    interface: Option<String>,
    /// Bits per second of the bus behind an adapter with slcan
    #[arg(long, default_value_t = 1_000_000)]
    bitrate: u32,
    /// Bits per second of the data of CAN FD frames behind such an adapter, or on a simulated bus; drives that speak CAN FD are looked
    /// for then, as on interfaces of the kernel that carry it
    #[arg(long, value_name = "BITS")]
    data_bitrate: Option<u32>,
    /// Speeds at which servos are looked for, bit/s; all that are usual if not given
    #[arg(long, value_delimiter = ',')]
    speed: Vec<u32>,
    /// Duration of listening
    #[arg(long = "for", value_name = "TIME", default_value = "1s", allow_hyphen_values = true)]
    time: TimeSpan,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Scan {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let Some(name) = &self.interface else { return self.list() };
        if name.starts_with('/') && !serial::is_adapter(name)? {
            return serial::scan(name, &self.speed, self.json);
        }
        let rates = Rates { nominal: self.bitrate, fast: self.data_bitrate.unwrap_or(self.bitrate) };
        let (opened, is_fd) = if name.starts_with('/') || name.contains(':') {
            let is_fd = self.data_bitrate.is_some();
            (RealBus::open(name, &rates, is_fd), is_fd)
        } else {
            let is_fd = Interface::all()?.iter().any(|interface| interface.name == *name && interface.is_fd);
            (RealBus::of_interface(name), is_fd)
        };
        let mut bus = opened.map_err(refused)?;
        let found = scan(&mut bus, is_fd, Duration::from(self.time), |_, time| std::thread::sleep(time));
        if self.json {
            let condition = bus.condition().name();
            let value = json!({ "interface": name, "condition": condition, "devices": devices(&found), "others": others(&found) });
            outln!("{}", serde_json::to_string_pretty(&value)?);
        } else {
            out!("{}", describe(name, &bus, &found));
        }
        Ok(if found.devices.is_empty() { exit::FAILED } else { ExitCode::SUCCESS })
    }

    fn list(&self) -> anyhow::Result<ExitCode> {
        let all = Interface::all()?;
        if self.json {
            let all: Vec<Value> = all.iter().map(interface).collect();
            outln!("{}", serde_json::to_string_pretty(&json!({ "interfaces": all }))?);
        } else if all.is_empty() {
            outln!("no CAN interface: is the adapter plugged in, is its driver loaded (`dmesg | tail`)?");
        } else {
            let mut rows =
                table(["interface", "kind", "", "bit/s", "data bit/s", "state", "errors tx/rx", "queue"]);
            let number =
                |number: Option<u32>| number.map_or_else(|| "-".to_string(), |number| number.to_string());
            for interface in &all {
                rows.add_row([
                    interface.name.clone(),
                    interface.kind.clone().unwrap_or_else(|| "can".into()),
                    if interface.is_up { "up".into() } else { "down".into() },
                    number(interface.bitrate),
                    number(interface.data_bitrate),
                    interface.state.map_or_else(
                        || "-".into(),
                        |state| motorium_can::Condition::from(state).name().into(),
                    ),
                    interface.counters.map_or_else(|| "-".into(), |[tx, rx]| format!("{tx}/{rx}")),
                    interface.queue.to_string(),
                ]);
            }
            outln!("{}", rows.trim_fmt());
        }
        Ok(if all.is_empty() { exit::FAILED } else { ExitCode::SUCCESS })
    }
}

fn interface(interface: &Interface) -> Value {
    json!({
        "name": interface.name,
        "kind": interface.kind,
        "up": interface.is_up,
        "fd": interface.is_fd,
        "bitrate": interface.bitrate,
        "data_bitrate": interface.data_bitrate,
        "state": interface.state.map(|state| motorium_can::Condition::from(state).name()),
        "restart_ms": interface.restart_ms,
        "errors": interface.counters,
        "queue": interface.queue,
    })
}

fn devices(found: &Found) -> Vec<Value> {
    let device = |device: &Device| match &device.kind {
        DeviceKind::Damiao { master, watchdog_ns, ranges: [position, velocity, torque] } => json!({
            "node": device.node,
            "protocol": "damiao",
            "master": master,
            "watchdog_ms": watchdog_ns.map(|ns| ns as f64 * 1e-6),
            "ranges": { "position": position, "velocity": velocity, "torque": torque },
        }),
        DeviceKind::Odrive { state, errors } => {
            json!({ "node": device.node, "protocol": "odrive", "state": state, "errors": errors })
        }
        DeviceKind::CanOpen { state } => {
            json!({ "node": device.node, "protocol": "canopen", "state": state })
        }
        DeviceKind::Moteus { mode, home, fault } => json!({
            "node": device.node,
            "protocol": "moteus",
            "mode": format!("{mode:?}"),
            "counts_from": home.map(|home| format!("{home:?}")),
            "fault": fault,
        }),
    };
    found.devices.iter().map(device).collect()
}

fn others(found: &Found) -> Vec<Value> {
    found.others.iter().map(|(id, count)| json!({ "id": id.to_string(), "frames": count })).collect()
}

fn describe(name: &str, bus: &RealBus, found: &Found) -> String {
    let mut text = String::new();
    for device in &found.devices {
        text += &format!("node {:>3}  {}\n", device.node, words(&device.kind));
    }
    if found.devices.is_empty() {
        let counts = bus.counts();
        let why = if counts.unacknowledged > 0 || counts.queue_full > 0 {
            "nobody acknowledges: power, bitrate, termination?"
        } else {
            "they may be off, speak another protocol, or have another bitrate"
        };
        text += &format!("no device answers on `{name}`: {why}\n");
    }
    if !found.others.is_empty() {
        let ids: Vec<String> = found.others.iter().map(|(id, count)| format!("{id} ({count})")).collect();
        text += &format!("frames of others: {}\n", ids.join(", "));
    }
    text
}

/// A device in words.
fn words(kind: &DeviceKind) -> String {
    match kind {
        DeviceKind::Damiao { master, watchdog_ns, ranges } => {
            let watchdog = match watchdog_ns {
                None => "watchdog not told".to_string(),
                Some(0) => "watchdog off".to_string(),
                Some(ns) => format!("watchdog {} ms", *ns as f64 * 1e-6),
            };
            let [position, velocity, torque] =
                ranges.map(|range| range.map_or_else(|| "?".to_string(), |max| format!("{max}")));
            format!(
                "damiao   answers as 0x{master:03X}, {watchdog}, {position} rad, {velocity} rad/s, {torque} N m"
            )
        }
        DeviceKind::Odrive { state, errors } => format!("odrive   state {state}, errors 0x{errors:08X}"),
        DeviceKind::CanOpen { state } => {
            let state = match state {
                0 => "boot-up",
                4 => "stopped",
                5 => "operational",
                _ => "pre-operational",
            };
            format!("canopen  {state}")
        }
        DeviceKind::Moteus { mode, home, fault } => {
            let home = home.map_or_else(String::new, |home| format!(", counts from {home}"));
            format!("moteus   mode {mode:?}{home}, fault {fault}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_whose_watchdog_is_off_is_told_from_one_that_did_not_tell() {
        let of = |watchdog_ns| {
            words(&DeviceKind::Damiao { master: 0x11, watchdog_ns, ranges: [Some(12.5), None, Some(10.0)] })
        };
        assert_eq!(of(Some(0)), "damiao   answers as 0x011, watchdog off, 12.5 rad, ? rad/s, 10 N m");
        assert!(of(None).contains("watchdog not told") && of(Some(20_000_000)).contains("watchdog 20 ms"));
    }
}

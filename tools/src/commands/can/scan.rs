//! `motorium can scan`: lists the CAN interfaces of the computer, or the devices on an interface or a serial
//! line.

use std::process::ExitCode;
use std::time::Duration;

use motorium::units::TimeSpan;
use motorium_can::{Device, DeviceKind, FdSearch, Found, Interface, Rates, RealBus, scan};
use serde_json::{Value, json};

use super::interface::refused;
use super::serial;
use crate::exit;
use crate::out::{out, outln};
use crate::report::table;

/// List the CAN interfaces of this computer, or the devices on one of them.
///
/// Without an interface, the command lists the interfaces. With one, it reads the registers of Damiao drives
/// 1 to 15, which has no side effects, and listens for the heartbeats of ODrives and CANopen nodes. It never
/// enables a drive.
///
/// With `--fd`, it also reads the registers of moteus drives 1 to 126 with CAN FD frames. A node without CAN
/// FD disturbs these frames until the interface is bus-off. Use `--fd` only if every node supports CAN FD and
/// no robot runs on the bus. The search does not start after a classic frame or an error, and stops at the
/// first error.
///
/// A path selects a serial line. An slcan adapter is detected by its version, and its bus is scanned at
/// `--bitrate`. On any other line, servos are searched at several speeds, by polling each number.
///
/// The exit code is 1 if no interface exists, or no device is found on the named one.
///
/// Example: motorium can scan can0
#[derive(Debug, clap::Args)]
pub(super) struct Scan {
    /// The interface, such as `can0` or `/dev/ttyACM0` [default: list the kernel's interfaces]
    interface: Option<String>,
    /// Bits per second of the bus of an slcan adapter [default: 1000000]
    #[arg(long, value_name = "BITS", requires = "interface")]
    bitrate: Option<u32>,
    /// Bits per second of the data of CAN FD frames on the bus of an slcan adapter
    #[arg(long, value_name = "BITS", requires = "interface")]
    data_bitrate: Option<u32>,
    /// Also search for CAN FD drives, on a bus whose nodes all support CAN FD; with an slcan adapter, also
    /// set `--data-bitrate`
    #[arg(long, requires = "interface")]
    fd: bool,
    /// Speeds at which to search for servos on a serial line, bit/s [default: all usual speeds]
    #[arg(long, value_delimiter = ',', requires = "interface")]
    speed: Vec<u32>,
    /// Time to listen to a CAN bus [default: 1 s]
    #[arg(long = "for", value_name = "TIME", requires = "interface", allow_hyphen_values = true)]
    time: Option<TimeSpan>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Scan {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let Some(name) = &self.interface else { return self.list() };
        let is_line = name.starts_with('/');
        if is_line && !serial::is_adapter(name)? {
            self.refuse_idle(&["--bitrate", "--data-bitrate", "--fd", "--for"], "a line of servos")?;
            return serial::scan(name, &self.speed, self.json);
        }
        let opened = if is_line || name.starts_with("pty:") {
            self.refuse_idle(&["--speed"], "an adapter with slcan")?;
            anyhow::ensure!(
                !self.fd || self.data_bitrate.is_some(),
                "`--fd` behind an adapter with slcan needs the bitrate of the data: add `--data-bitrate 5000000`"
            );
            let nominal = self.bitrate.unwrap_or(1_000_000);
            let rates = Rates { nominal, fast: self.data_bitrate.unwrap_or(nominal) };
            RealBus::open(name, &rates, self.data_bitrate.is_some())
        } else if name.contains(':') {
            self.refuse_idle(&["--bitrate", "--data-bitrate", "--speed"], "a simulated bus")?;
            let unused = Rates { nominal: 1_000_000, fast: 1_000_000 };
            RealBus::open(name, &unused, self.fd)
        } else {
            self.refuse_idle(&["--bitrate", "--data-bitrate", "--speed"], "an interface of the kernel")?;
            let carries_fd = |interface: &Interface| interface.name == *name && interface.is_fd;
            anyhow::ensure!(
                !self.fd || Interface::all()?.iter().any(carries_fd),
                "`{name}` does not carry CAN FD: configure it for CAN FD (`ip link set {name} type can ... dbitrate \
                 5000000 fd on`), or leave `--fd` out"
            );
            RealBus::of_interface(name)
        };
        let mut bus = opened.map_err(refused)?;
        let time = self.time.map_or(Duration::from_secs(1), Duration::from);
        let has_errors = self.fd.then_some(&RealBus::has_errors as &dyn Fn(&RealBus) -> bool);
        let found = scan(&mut bus, has_errors, time, |_, time| std::thread::sleep(time));
        if self.json {
            let condition = bus.condition().name();
            let value = json!({
                "interface": name,
                "condition": condition,
                "devices": devices(&found),
                "others": others(&found),
                "fd_search": fd_search(found.fd),
            });
            outln!("{}", serde_json::to_string_pretty(&value)?);
        } else {
            out!("{}", describe(name, &bus, &found));
        }
        Ok(if found.devices.is_empty() { exit::FAILED } else { ExitCode::SUCCESS })
    }

    /// Refuses given options that have no effect on such a bus.
    fn refuse_idle(&self, options: &[&str], bus: &str) -> anyhow::Result<()> {
        let given = |option: &str| match option {
            "--bitrate" => self.bitrate.is_some(),
            "--data-bitrate" => self.data_bitrate.is_some(),
            "--fd" => self.fd,
            "--speed" => !self.speed.is_empty(),
            _ => self.time.is_some(),
        };
        match options.iter().find(|option| given(option)) {
            Some(option) => anyhow::bail!("`{option}` has no effect on {bus}: leave it out"),
            None => Ok(()),
        }
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
            "mode": mode,
            "counts_from": home.map(|home| format!("{home:?}")),
            "fault": fault,
        }),
    };
    found.devices.iter().map(device).collect()
}

/// Returns the outcome of the search for CAN FD drives, and the number of IDs queried; `null` if it was
/// not requested.
fn fd_search(search: FdSearch) -> Value {
    match search {
        FdSearch::NotWanted => Value::Null,
        FdSearch::Complete { asked } => json!({ "outcome": "complete", "asked": asked }),
        FdSearch::Classic { asked } => json!({ "outcome": "classic", "asked": asked }),
        FdSearch::Disturbed { asked } => json!({ "outcome": "disturbed", "asked": asked }),
    }
}

fn others(found: &Found) -> Vec<Value> {
    found.others.iter().map(|(id, count)| json!({ "id": id.to_string(), "frames": count })).collect()
}

fn describe(name: &str, bus: &RealBus, found: &Found) -> String {
    let mut text = String::new();
    for device in &found.devices {
        text += &format!("node {:>3}  {}\n", device.node, describe_kind(&device.kind));
    }
    if found.devices.is_empty() {
        let counts = bus.counts();
        let why = if counts.unacknowledged > 0 || counts.queue_full > 0 {
            "nobody acknowledges: power, bitrate, termination?"
        } else {
            "the devices may be off, speak a different protocol, or use a different bitrate"
        };
        text += &format!("no device answers on `{name}`: {why}\n");
    }
    if !found.others.is_empty() {
        let ids: Vec<String> = found.others.iter().map(|(id, count)| format!("{id} ({count})")).collect();
        text += &format!("frames of others: {}\n", ids.join(", "));
    }
    text += &match found.fd {
        FdSearch::NotWanted | FdSearch::Complete { .. } => String::new(),
        FdSearch::Classic { asked: 0 } => {
            "no search for CAN FD drives: a device sends classic frames and may not support CAN FD\n".into()
        }
        FdSearch::Classic { asked } => format!(
            "the search for CAN FD drives stopped at {asked} of 126: a device sends classic frames and may not \
             support CAN FD\n"
        ),
        FdSearch::Disturbed { asked } => {
            format!("the search for CAN FD drives stopped at {asked} of 126: the bus reported an error\n")
        }
    };
    text
}

/// Describes a device.
fn describe_kind(kind: &DeviceKind) -> String {
    match kind {
        DeviceKind::Damiao { master, watchdog_ns, ranges } => {
            let watchdog = match watchdog_ns {
                None => "watchdog not reported".to_string(),
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
            format!("moteus   mode {mode}{home}, fault {fault}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn disabled_watchdog_differs_from_unreported_one() {
        let of = |watchdog_ns| {
            describe_kind(&DeviceKind::Damiao {
                master: 0x11,
                watchdog_ns,
                ranges: [Some(12.5), None, Some(10.0)],
            })
        };
        assert_eq!(of(Some(0)), "damiao   answers as 0x011, watchdog off, 12.5 rad, ? rad/s, 10 N m");
        assert!(
            of(None).contains("watchdog not reported") && of(Some(20_000_000)).contains("watchdog 20 ms")
        );
    }
}

//! `sensor.udp`: publishes datagrams from other programs as states.
//!
//! A datagram holds one value of a built-in state, in its memory layout. Each step publishes the newest valid
//! datagram in the queue. The source time of the published state is the time at which the kernel received the
//! datagram. Senders on this machine are checked by the owner of their socket.

mod config;
mod owners;
mod socket;

use std::net::{IpAddr, SocketAddr};

use motorium::component::RunClock;
use motorium::declare::ClockKind;
use motorium::os::{monotonic_ns, realtime_ns};
use motorium::prelude::*;
use motorium::raw::{RawError, RawOutput};
use motorium::state::{ContentDefect, EmergencyStop};
use motorium::telemetry::set_apart;

use config::Sender;
pub use config::{LocalUsers, UdpSensorConfig};
use owners::{Owners, Ownership};
use socket::{Datagram, Socket};

/// Name of the output.
const VALUE: &str = "value";
/// Maximum number of datagrams read in one step; the remaining ones trigger the next step.
const TAKEN: usize = 64;

/// A component that publishes the newest datagram.
pub struct UdpSensor {
    socket: Socket,
    senders: Vec<Sender>,
    /// Check of local senders; `None` if all users of this machine are trusted.
    owners: Option<Owners>,
    /// Addresses in `from` that belong to this machine, except loopback addresses.
    own_addresses: Vec<IpAddr>,
    /// A pressed emergency stop is published before any newer value.
    is_emergency_stop: bool,
    output: RawOutput,
    clock: RunClock,
    /// Payload of the last datagram, with room for one byte more than a value.
    read: Box<[u8]>,
    /// The newest valid value of a step.
    newest: Box<[u8]>,
    counts: Counts,
}

/// Number of datagrams per outcome.
#[derive(Debug, Default)]
struct Counts {
    received: u64,
    published: u64,
    replaced: u64,
    introduced: u64,
    sender: u64,
    length: u64,
    not_finite: u64,
    count_too_large: u64,
    too_late: u64,
    lost: u32,
}

impl Component for UdpSensor {
    const KIND: &'static str = "sensor.udp";
    const SUMMARY: &'static str = "publishes incoming UDP datagrams as states";
    const RESETS: bool = true;
    type Config = UdpSensorConfig;

    fn declare(config: &UdpSensorConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        config.socket_address()?;
        config.senders()?;
        declare.raw_output(VALUE, config.layout()?, "newest datagram");
        declare.wakes_on_descriptor();
        if declare.clock() == ClockKind::Lockstep {
            let warning =
                declare.warn("datagrams arrive in real time, so lockstep runs are not reproducible");
            warning.advise("simulate their source by a component in its place");
        }
        Ok(())
    }

    fn configure(config: UdpSensorConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let refused = |error: ConfigError| ConfigureError::failed(error.message);
        let address = config.socket_address().map_err(refused)?;
        let socket = Socket::bind(address)
            .map_err(|error| ConfigureError::failed(format!("receiving on {address}: {error}")))?;
        setup.wake_on(&socket)?;
        let owners = match config.local_users {
            LocalUsers::Any => None,
            LocalUsers::Own => Some(Owners::open().map_err(|error| {
                let advice = "`local_users = \"any\"` trusts every user of this machine";
                ConfigureError::failed(format!(
                    "the owners of sending sockets are unknown: {error}; {advice}"
                ))
            })?),
        };
        let senders = config.senders().map_err(refused)?;
        let named = senders.iter().map(|sender| sender.address).filter(|address| !address.is_loopback());
        let own_addresses = named.filter(|address| owners::is_of_this_machine(*address)).collect();
        let output = setup.raw_output(VALUE)?;
        let size = output.layout().size;
        Ok(Self {
            socket,
            senders,
            owners,
            own_addresses,
            is_emergency_stop: output.layout().type_name == EmergencyStop::NAME,
            output,
            clock: setup.clock(),
            read: vec![0; size + 1].into_boxed_slice(),
            newest: vec![0; size + 1].into_boxed_slice(),
            counts: Counts::default(),
        })
    }

    fn step(&mut self, _: &Tick) -> Result<(), StepError> {
        let mut newest: Option<Datagram> = None;
        for _ in 0..TAKEN {
            let received = self.socket.receive(&mut self.read);
            let received = received.map_err(|_| StepError::failed("the socket can no longer be read"))?;
            let Some(datagram) = received else { break };
            self.counts.received += 1;
            self.counts.lost = datagram.lost.unwrap_or(self.counts.lost);
            if self.admit(&datagram) {
                if self.is_emergency_stop && self.read[..datagram.length].iter().any(|byte| *byte != 0) {
                    // The stop takes effect regardless of later values in the same step; earlier values are
                    // older.
                    self.counts.replaced += u64::from(newest.take().is_some());
                    core::mem::swap(&mut self.read, &mut self.newest);
                    self.publish(&datagram);
                    continue;
                }
                core::mem::swap(&mut self.read, &mut self.newest);
                self.counts.replaced += u64::from(newest.replace(datagram).is_some());
            }
        }
        if let Some(datagram) = newest {
            self.publish(&datagram);
        }
        Ok(())
    }

    fn reset(&mut self, _: &Episode) -> Result<(), StepError> {
        // The counts cover the whole run, so there is nothing to reset.
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let counts = &self.counts;
        Some(serde_json::json!({
            "received": counts.received,
            "published": counts.published,
            "replaced": counts.replaced,
            "introduced": counts.introduced,
            "lost": counts.lost,
            "refused": {
                "sender": counts.sender,
                "length": counts.length,
                "not_finite": counts.not_finite,
                "count_too_large": counts.count_too_large,
                "too_late": counts.too_late,
            },
        }))
    }
}

impl UdpSensor {
    /// Returns `true` if the sender of the last datagram is accepted.
    fn admit(&mut self, datagram: &Datagram) -> bool {
        let known = |address| self.senders.iter().any(|sender| sender.is(address));
        if !self.senders.is_empty() && !datagram.sender.is_some_and(known) {
            self.counts.sender += 1;
            return false;
        }
        let size = self.output.layout().size;
        if datagram.length != size {
            self.counts.length += 1;
            return false;
        }
        let checked = self.output.check(&self.read[..size]);
        checked.map_err(|defect| self.counts.refuse(defect)).is_ok() && self.is_owned(datagram)
    }

    /// Returns `false` for a local sender whose socket is not yet known to belong to this user or to root.
    fn is_owned(&mut self, datagram: &Datagram) -> bool {
        let Some(owners) = &mut self.owners else { return true };
        let is_local = |sender: &SocketAddr| {
            let address = sender.ip().to_canonical();
            address.is_loopback() || self.own_addresses.contains(&address)
        };
        let Some(sender) = datagram.sender.filter(is_local) else { return true };
        let now_ns = realtime_ns();
        // The list of sockets is a kernel file whose length varies between reads.
        let owned = set_apart(|| owners.check(sender, datagram.received_ns.unwrap_or(now_ns), now_ns));
        match owned {
            Ownership::Own => return true,
            Ownership::Introduced => self.counts.introduced += 1,
            Ownership::Foreign => self.counts.sender += 1,
        }
        false
    }

    fn publish(&mut self, datagram: &Datagram) {
        let size = self.output.layout().size;
        let value = &self.newest[..size];
        let (now_ns, wall_ns) = (monotonic_ns(), realtime_ns());
        // both clocks have run at the same rate since; a change of the wall clock can only make the value
        // appear older
        let age_ns = datagram.received_ns.map_or(0, |received| wall_ns.saturating_sub(received));
        let published = match self.clock.kind() {
            ClockKind::Realtime => self.output.publish_from(value, now_ns.saturating_sub(age_ns)),
            ClockKind::Lockstep => self.output.publish(value),
        };
        match published {
            Ok(()) => self.counts.published += 1,
            Err(RawError::Content(defect)) => self.counts.refuse(defect),
            // a receive time is never in the future
            Err(
                RawError::Late
                | RawError::SourceInFuture { .. }
                | RawError::Length { .. }
                | RawError::NotSent,
            ) => self.counts.too_late += 1,
        }
    }
}

impl Counts {
    fn refuse(&mut self, defect: ContentDefect) {
        match defect {
            ContentDefect::NotFinite { .. } => self.not_finite += 1,
            ContentDefect::Count { .. } => self.count_too_large += 1,
            ContentDefect::Size { .. } => self.length += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(text: serde_json::Value) -> UdpSensorConfig {
        serde_json::from_value(text).unwrap()
    }

    fn refused(text: serde_json::Value) -> (Option<String>, String) {
        let error = UdpSensor::declare(&config(text), &mut Declare::new(None)).unwrap_err();
        (error.key, error.message)
    }

    #[test]
    fn type_and_port_suffice_on_loopback() {
        let mut declare = Declare::new(None);
        let config = config(serde_json::json!({ "type": "motorium.Wrench", "port": 7400 }));
        UdpSensor::declare(&config, &mut declare).unwrap();
        let declaration = declare.into_declaration();
        assert_eq!(declaration.ports[0].layout, Wrench::layout());
        assert!(declaration.wakes_on_descriptor);
        assert_eq!(config.socket_address().unwrap().to_string(), "127.0.0.1:7400");
    }

    #[test]
    fn invalid_configurations_are_rejected_with_their_key() {
        let key = |text| refused(text).0.unwrap_or_default();
        use serde_json::json;
        assert_eq!(key(json!({ "type": "motorium.Wrnch", "port": 1 })), "type");
        assert_eq!(key(json!({ "type": "motorium.Wrench", "port": 0 })), "port");
        assert_eq!(key(json!({ "type": "motorium.Wrench", "port": 1, "address": "localhost" })), "address");
        let from = json!({ "type": "motorium.Wrench", "port": 1, "from": ["127.0.0.1", "here:1"] });
        assert_eq!(refused(from), (Some("from[1]".into()), "\"here:1\" is not an IP address".into()));
    }

    #[test]
    fn public_address_requires_a_list_of_senders() {
        let open = serde_json::json!({ "type": "motorium.Wrench", "port": 1, "address": "0.0.0.0" });
        assert_eq!(refused(open).1, "0.0.0.0 is reachable from other machines");
        let known = serde_json::json!(
            { "type": "motorium.Wrench", "port": 1, "address": "::", "from": ["192.168.1.7", "10.0.0.1:5"] }
        );
        let senders = config(known).senders().unwrap();
        let is_known = |address: &str| senders.iter().any(|sender| sender.is(address.parse().unwrap()));
        assert!(is_known("192.168.1.7:9") && is_known("10.0.0.1:5") && is_known("[::ffff:10.0.0.1]:5"));
        assert!(!is_known("10.0.0.1:6") && !is_known("192.168.1.8:9"));
    }
}

//! The `config` table of `sensor.udp`.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use motorium::declare::ConfigError;
use motorium::nearest::suggest;
use motorium::state::{TypeLayout, built_in};
use schemars::JsonSchema;
use serde::Deserialize;

/// Maximum payload of an IPv4 datagram, bytes.
const LONGEST: usize = 65_507;

/// The `config` table of `sensor.udp`.
///
/// ```toml
/// type    = "motorium.PoseTarget"
/// port    = 7400
/// address = "0.0.0.0"
/// from    = ["192.168.1.7", "192.168.1.8:5000"]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UdpSensorConfig {
    /// Type of the values: a built-in state, such as "motorium.PoseTarget".
    #[serde(rename = "type")]
    pub type_name: String,
    /// Port on which datagrams are received.
    #[schemars(range(min = 1))]
    pub port: u16,
    /// Local address on which datagrams are received; "0.0.0.0" and "::" mean all addresses of the machine.
    /// Default "127.0.0.1": from this machine only.
    #[serde(default = "loopback")]
    pub address: String,
    /// Accepted senders, as "ADDRESS" or "ADDRESS:PORT"; datagrams from all other senders are counted and
    /// dropped. Default: any sender, if `address` is a loopback address.
    #[serde(default)]
    pub from: Vec<String>,
    /// Local users whose datagrams are accepted: "own" for the user of the graph and root, "any" for all
    /// users. With "own", the user is the owner of the sending socket, which must stay open. Default "own".
    #[serde(default)]
    pub local_users: LocalUsers,
}

/// Users of this machine whose datagrams are accepted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LocalUsers {
    /// The user of the graph, and root.
    #[default]
    Own,
    /// Every user of this machine.
    Any,
}

fn loopback() -> String {
    Ipv4Addr::LOCALHOST.to_string()
}

/// An accepted sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sender {
    pub(super) address: IpAddr,
    /// `None` for any port.
    port: Option<u16>,
}

impl Sender {
    pub(super) fn is(&self, address: SocketAddr) -> bool {
        // an IPv4 address may arrive as an IPv4-mapped IPv6 address
        self.address == address.ip().to_canonical() && self.port.is_none_or(|port| port == address.port())
    }
}

impl UdpSensorConfig {
    /// Returns the layout of the type.
    pub(super) fn layout(&self) -> Result<TypeLayout, ConfigError> {
        let layouts = built_in();
        let Some(layout) = layouts.iter().find(|layout| layout.type_name == self.type_name) else {
            let names = layouts.iter().map(|layout| layout.type_name.as_str());
            let message = format!("there is no built-in state `{}`", self.type_name);
            let advice = suggest(&self.type_name, names, "the built-in states are");
            return Err(ConfigError::key("type", message).advise(advice));
        };
        if layout.size > LONGEST {
            let message = format!(
                "`{}` has {} bytes, but a datagram has at most {LONGEST}",
                self.type_name, layout.size
            );
            return Err(ConfigError::key("type", message)
                .advise("send it through a bridge, such as `bridge.iceoryx2`"));
        }
        Ok(layout.clone())
    }

    /// Parses the address and port to receive on.
    pub(super) fn socket_address(&self) -> Result<SocketAddr, ConfigError> {
        if self.port == 0 {
            let error = ConfigError::key("port", "port 0 is not allowed, expected 1 to 65535");
            return Err(error.advise("choose a port that no other program uses, such as 7400"));
        }
        let address: IpAddr = self.address.parse().map_err(|_| {
            ConfigError::key("address", format!("\"{}\" is not an IP address", self.address)).advise(
                "write it numerically: \"127.0.0.1\", or \"0.0.0.0\" for all addresses of the machine",
            )
        })?;
        if !address.is_loopback() && self.from.is_empty() {
            return Err(ConfigError::key("address", format!("{address} is reachable from other machines"))
                .advise("list the accepted senders: `from = [\"192.168.1.7\"]`"));
        }
        Ok(SocketAddr::new(address, self.port))
    }

    /// Parses the accepted senders; an empty list accepts any.
    pub(super) fn senders(&self) -> Result<Vec<Sender>, ConfigError> {
        let senders = self.from.iter().enumerate().map(|(index, text)| {
            let alone = text.parse::<IpAddr>().map(|address| Sender { address, port: None });
            let with_port =
                || text.parse::<SocketAddr>().map(|at| Sender { address: at.ip(), port: Some(at.port()) });
            alone.or_else(|_| with_port()).map_err(|_| {
                ConfigError::key(format!("from[{index}]"), format!("\"{text}\" is not an IP address")).advise(
                    "write \"192.168.1.7\", or with a port \"192.168.1.7:5000\" or \"[fe80::1]:5000\"",
                )
            })
        });
        senders.collect()
    }
}

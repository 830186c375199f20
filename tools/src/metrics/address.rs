//! Address at which metrics are served. A port alone, such as `--metrics 9464`, only serves this machine. For
//! all other addresses, write the address and the port.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;

/// An address to serve metrics on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Address(pub(super) SocketAddr);

/// The text is not an address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is neither a port nor an address; write `9464` for port 9464 of this machine alone, \
     or a whole address such as `0.0.0.0:9464` or `[::1]:9464`"
)]
pub(crate) struct AddressError(String);

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if let Ok(port) = text.parse() {
            return Ok(Self(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port)));
        }
        text.parse().map(Self).map_err(|_| AddressError(text.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<String, AddressError> {
        text.parse::<Address>().map(|address| address.0.to_string())
    }

    #[test]
    fn port_alone_binds_to_this_machine_only() {
        assert_eq!(read("9464").as_deref(), Ok("127.0.0.1:9464"));
    }

    #[test]
    fn other_addresses_are_written_in_full() {
        for whole in ["0.0.0.0:9464", "192.168.1.7:80", "[::1]:9464"] {
            assert_eq!(read(whole).as_deref(), Ok(whole));
        }
    }

    #[test]
    fn incomplete_address_is_refused_with_the_full_form() {
        for half in ["", "0.0.0.0", ":9464", "localhost:9464", "99999", "9464/metrics"] {
            let error = read(half).unwrap_err().to_string();
            assert!(error.contains(&format!("`{half}`")) && error.contains("`0.0.0.0:9464`"), "{error}");
        }
    }
}

//! The client that a call is counted for.

use lightpath_domain::access::Caller;
use std::fmt;
use std::net::{IpAddr, Ipv6Addr};
use std::sync::Arc;

/// The client that a call is counted for: the holder of a token, or else the machine from which the call comes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Client {
    /// The holder of the token with this name.
    Token(String),
    /// A machine without a token. One machine usually has a whole /64 network of IPv6 addresses, so their last 64 bits
    /// are zero here. `None`: the address is unknown, as in tests without a connection.
    Address(Option<IpAddr>),
}

impl Client {
    /// The machine with this address.
    #[must_use]
    pub fn at(address: Option<IpAddr>) -> Self {
        Self::Address(address.map(|address| match address {
            IpAddr::V6(address) if address.to_ipv4_mapped().is_none() && !address.is_loopback() => {
                IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() >> 64 << 64))
            }
            other => other.to_canonical(),
        }))
    }

    /// The line in which statements of the client wait for the database.
    #[must_use]
    pub fn line(&self) -> Arc<str> {
        self.to_string().into()
    }

    /// The client of a call: the holder of the caller's token, or the machine if the call has no token.
    #[must_use]
    pub fn of(caller: &Caller, address: Option<IpAddr>) -> Self {
        if caller.name.is_empty() { Self::at(address) } else { Self::Token(caller.name.clone()) }
    }
}

impl fmt::Display for Client {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Token(name) => write!(f, "the token \"{name}\""),
            Self::Address(Some(address)) => write!(f, "the address {address}"),
            Self::Address(None) => f.write_str("your address"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_machine_is_one_client() {
        let at = |text: &str| Client::at(Some(text.parse().unwrap()));
        assert_eq!(at("2001:db8::1:2:3:4"), at("2001:db8::9"));
        assert_ne!(at("2001:db8::1"), at("2001:db8:0:1::1"));
        assert_eq!(at("::ffff:10.0.0.7"), at("10.0.0.7"));
        assert_ne!(at("10.0.0.7"), at("10.0.0.8"));
        assert_ne!(at("::1"), at("::2"));
    }
}

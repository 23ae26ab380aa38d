//! Where messages may be sent. Whoever may create a channel makes the service send requests;
//! without limits it could reach what only the service's machine can reach.

use std::net::{IpAddr, Ipv6Addr};

use wildmatch::WildMatch;

/// The permitted targets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TargetPolicy {
    /// Patterns of host names and addresses, with `*` and `?`; all if empty.
    pub hosts: Vec<String>,
    /// Whether private and loopback addresses are permitted.
    pub private_addresses: bool,
}

impl Default for TargetPolicy {
    fn default() -> Self {
        Self { hosts: Vec::new(), private_addresses: true }
    }
}

impl TargetPolicy {
    /// Checks a host name or address.
    ///
    /// # Errors
    /// Why it is not permitted.
    pub fn check_host(&self, host: &str) -> Result<(), String> {
        let host = host.trim_matches(['[', ']']).to_ascii_lowercase();
        let matches =
            |pattern: &String| WildMatch::new(&pattern.to_ascii_lowercase()).matches(&host);
        if !self.hosts.is_empty() && !self.hosts.iter().any(matches) {
            return Err("is not in `notifications.targets`".to_owned());
        }
        host.parse().map_or(Ok(()), |address| self.check_address(address))
    }

    /// Checks an address to connect to.
    ///
    /// # Errors
    /// Why it is not permitted.
    pub fn check_address(&self, address: IpAddr) -> Result<(), String> {
        let address = address.to_canonical();
        if is_unusable(address) {
            return Err("is a link-local, multicast or unspecified address".to_owned());
        }
        if !self.private_addresses && is_private(address) {
            return Err(
                "is a private address, and `notifications.private_addresses` is false".to_owned()
            );
        }
        Ok(())
    }
}

/// Addresses at which no receiver of messages is, but perhaps the metadata of a cloud.
fn is_unusable(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(v4) => {
            v4.is_link_local() || v4.is_multicast() || v4.is_unspecified() || v4.is_broadcast()
        }
        IpAddr::V6(v6) => v6.is_unicast_link_local() || v6.is_multicast() || v6.is_unspecified(),
    }
}

/// Loopback, private (RFC 1918, RFC 4193) and shared (RFC 6598) addresses, and those that
/// carry one of them (RFC 6052, RFC 3056).
fn is_private(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(v4) => {
            let [a, b, ..] = v4.octets();
            v4.is_loopback() || v4.is_private() || a == 0 || (a == 100 && b & 0xc0 == 64)
        }
        IpAddr::V6(v6) => {
            v6.is_loopback() || v6.is_unique_local() || embedded(v6).is_some_and(is_private)
        }
    }
}

/// The IPv4 address that a translated (64:ff9b::/96) or tunnelled (2002::/16) one carries.
fn embedded(address: Ipv6Addr) -> Option<IpAddr> {
    let octets = address.octets();
    let of = |at: usize| IpAddr::from([octets[at], octets[at + 1], octets[at + 2], octets[at + 3]]);
    match address.segments() {
        [0x64, 0xff9b, 0, 0, 0, 0, _, _] => Some(of(12)),
        [0x2002, ..] => Some(of(2)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy(hosts: &[&str], private_addresses: bool) -> TargetPolicy {
        TargetPolicy { hosts: hosts.iter().map(ToString::to_string).collect(), private_addresses }
    }

    #[test]
    fn only_the_listed_hosts_are_permitted() {
        let policy = policy(&["hooks.example.com", "*.lab.example", "10.0.0.?"], true);
        for host in ["hooks.example.com", "HOOKS.example.com", "a.lab.example", "10.0.0.7"] {
            assert_eq!(policy.check_host(host), Ok(()), "{host}");
        }
        for host in ["example.com", "hooks.example.com.evil.org", "lab.example", "10.0.0.70"] {
            assert!(policy.check_host(host).is_err(), "{host}");
        }
    }

    #[test]
    fn private_addresses_are_refused_if_so_configured() {
        let strict = policy(&[], false);
        for address in [
            "127.0.0.1",
            "10.1.2.3",
            "172.16.0.1",
            "192.168.1.1",
            "100.64.0.1",
            "0.1.2.3",
            "::1",
            "fd00::1",
            "::ffff:127.0.0.1",
            "64:ff9b::a00:1",
            "2002:c0a8:101::1",
            "[::1]",
        ] {
            assert!(strict.check_host(address).is_err(), "{address}");
            assert_eq!(policy(&[], true).check_host(address), Ok(()), "{address}");
        }
        for address in
            ["192.0.2.1", "100.128.0.1", "172.32.0.1", "2001:db8::1", "64:ff9b::c000:201"]
        {
            assert_eq!(strict.check_host(address), Ok(()), "{address}");
        }
        for address in ["169.254.169.254", "fe80::1", "0.0.0.0", "::", "224.0.0.1"] {
            assert!(policy(&[], true).check_host(address).is_err(), "{address}");
        }
    }
}

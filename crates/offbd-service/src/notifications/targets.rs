//! Where messages may be sent. Whoever may create a channel makes the service send requests;
//! without limits it could reach what only the service's machine can reach.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

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
        let carried = carried(address);
        let mut all = std::iter::once(address).chain(carried);
        if all.clone().any(is_unusable) {
            let what = "is, or carries, a link-local, multicast or unspecified address, or one of \
                        the metadata of a cloud";
            return Err(what.to_owned());
        }
        if !self.private_addresses && all.any(is_private) {
            return Err(
                "is a private address, and `notifications.private_addresses` is false".to_owned()
            );
        }
        Ok(())
    }
}

/// The addresses at which clouds tell the secrets of a machine, beside the link-local ones.
const METADATA: [IpAddr; 5] = [
    // Alibaba Cloud, Azure, and Oracle Cloud.
    IpAddr::V4(Ipv4Addr::new(100, 100, 100, 200)),
    IpAddr::V4(Ipv4Addr::new(168, 63, 129, 16)),
    IpAddr::V4(Ipv4Addr::new(192, 0, 0, 192)),
    // Amazon Web Services, and Google Cloud.
    IpAddr::V6(Ipv6Addr::new(0xfd00, 0xec2, 0, 0, 0, 0, 0, 0x254)),
    IpAddr::V6(Ipv6Addr::new(0xfd20, 0xce, 0, 0, 0, 0, 0, 0x254)),
];

/// Networks of a machine, a site or a provider, and reserved ones, by their first address and the
/// length of their prefix.
const PRIVATE_V4: [(Ipv4Addr, u32); 9] = [
    (Ipv4Addr::new(0, 0, 0, 0), 8),      // this network, RFC 791
    (Ipv4Addr::new(10, 0, 0, 0), 8),     // private, RFC 1918
    (Ipv4Addr::new(100, 64, 0, 0), 10),  // shared by customers of a provider, RFC 6598
    (Ipv4Addr::new(127, 0, 0, 0), 8),    // loopback, RFC 1122
    (Ipv4Addr::new(172, 16, 0, 0), 12),  // private, RFC 1918
    (Ipv4Addr::new(192, 0, 0, 0), 24),   // protocol assignments, RFC 6890
    (Ipv4Addr::new(192, 168, 0, 0), 16), // private, RFC 1918
    (Ipv4Addr::new(198, 18, 0, 0), 15),  // benchmarks, RFC 2544
    (Ipv4Addr::new(240, 0, 0, 0), 4),    // reserved, RFC 1112
];
const PRIVATE_V6: [(Ipv6Addr, u32); 7] = [
    (Ipv6Addr::LOCALHOST, 128),
    (Ipv6Addr::new(0x64, 0xff9b, 1, 0, 0, 0, 0, 0), 48), // translation within a site, RFC 8215
    (Ipv6Addr::new(0x100, 0, 0, 0, 0, 0, 0, 0), 64),     // discarded, RFC 6666
    (Ipv6Addr::new(0x2001, 2, 0, 0, 0, 0, 0, 0), 48),    // benchmarks, RFC 5180
    (Ipv6Addr::new(0x5f00, 0, 0, 0, 0, 0, 0, 0), 16),    // segment routing, RFC 9602
    (Ipv6Addr::new(0xfc00, 0, 0, 0, 0, 0, 0, 0), 7),     // unique local, RFC 4193
    (Ipv6Addr::new(0xfec0, 0, 0, 0, 0, 0, 0, 0), 10),    // site-local, RFC 3879
];

/// Addresses at which no receiver of messages is, but perhaps the metadata of a cloud.
fn is_unusable(address: IpAddr) -> bool {
    METADATA.contains(&address)
        || match address {
            IpAddr::V4(v4) => {
                v4.is_link_local() || v4.is_multicast() || v4.is_unspecified() || v4.is_broadcast()
            }
            IpAddr::V6(v6) => {
                v6.is_unicast_link_local() || v6.is_multicast() || v6.is_unspecified()
            }
        }
}

fn is_private(address: IpAddr) -> bool {
    match address {
        IpAddr::V4(v4) => PRIVATE_V4
            .iter()
            .any(|(network, length)| (v4.to_bits() ^ network.to_bits()) >> (32 - length) == 0),
        IpAddr::V6(v6) => PRIVATE_V6
            .iter()
            .any(|(network, length)| (v6.to_bits() ^ network.to_bits()) >> (128 - length) == 0),
    }
}

/// The IPv4 addresses to which a packet for `address` may be passed on: what a mapped,
/// compatible, translated or tunnelled IPv6 address carries.
fn carried(address: IpAddr) -> Vec<IpAddr> {
    let IpAddr::V6(v6) = address else { return Vec::new() };
    let octets = v6.octets();
    let of = |at: [usize; 4]| IpAddr::from(at.map(|i| octets[i]));
    let last = of([12, 13, 14, 15]);
    match v6.segments() {
        _ if v6.is_loopback() || v6.is_unspecified() => Vec::new(),
        // Compatible and mapped (RFC 4291), translated (RFC 2765).
        [0, 0, 0, 0, 0, 0 | 0xffff, _, _] | [0, 0, 0, 0, 0xffff, 0, _, _] => vec![last],
        // Translated, RFC 6052.
        [0x64, 0xff9b, 0, 0, 0, 0, _, _] => vec![last],
        // The same with a prefix of the site (RFC 8215) of 96, 48, 56 or 64 bits. Octets that
        // mean nothing there are zero.
        [0x64, 0xff9b, 1, ..] => {
            let all = [last, of([6, 7, 9, 10]), of([7, 9, 10, 11]), of([9, 10, 11, 12])];
            all.into_iter().filter(|address| !address.is_unspecified()).collect()
        }
        // 6to4, RFC 3056.
        [0x2002, ..] => vec![of([2, 3, 4, 5])],
        // Teredo, RFC 4380: the server, and the client with its bits inverted.
        [0x2001, 0, ..] => {
            let client = std::array::from_fn::<u8, 4, _>(|i| !octets[12 + i]);
            vec![of([4, 5, 6, 7]), IpAddr::from(client)]
        }
        _ => Vec::new(),
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
            "192.0.0.1",
            "198.18.0.1",
            "240.0.0.1",
            "fec0::1",
            "100::1",
            "::7f00:1",
            "::ffff:0:7f00:1",
            "64:ff9b:1::7f00:1",
            "64:ff9b:1::c000:201",
            "2002:7f00:1::1",
            "2001:0:c000:201::80ff:fffe",
            "2001:0:a00:1::3fff:fdfe",
        ] {
            assert!(strict.check_host(address).is_err(), "{address}");
            assert_eq!(policy(&[], true).check_host(address), Ok(()), "{address}");
        }
        for address in [
            "192.0.2.1",
            "100.128.0.1",
            "172.32.0.1",
            "2001:db8::1",
            "64:ff9b::c000:201",
            "::c000:201",
        ] {
            assert_eq!(strict.check_host(address), Ok(()), "{address}");
        }
        for address in ["169.254.169.254", "fe80::1", "0.0.0.0", "::", "224.0.0.1"] {
            assert!(policy(&[], true).check_host(address).is_err(), "{address}");
        }
    }

    #[test]
    fn metadata_of_clouds_are_refused_in_every_form() {
        let policy = policy(&[], true);
        for address in [
            "fd00:ec2::254",
            "fd20:ce::254",
            "100.100.100.200",
            "168.63.129.16",
            "192.0.0.192",
            "::ffff:169.254.169.254",
            "::169.254.169.254",
            "::ffff:0:169.254.169.254",
            "64:ff9b::169.254.169.254",
            "64:ff9b::100.100.100.200",
            // With prefixes of 96, 48, 56 and 64 bits.
            "64:ff9b:1::169.254.169.254",
            "64:ff9b:1:a9fe:a9:fe00::",
            "64:ff9b:1:12a9:fe:a9fe::",
            "64:ff9b:1:1234:a9:fea9:fe00:0",
            "2002:a9fe:a9fe::1",
            "2001:0:a9fe:a9fe::3fff:fdfe",
            "2001:0:c000:201::5601:5601",
        ] {
            assert!(policy.check_host(address).is_err(), "{address}");
        }
        for address in ["64:ff9b:1::c000:201", "2002:c000:201::1", "2001:0:c000:201::3fff:fdfe"] {
            assert_eq!(policy.check_host(address), Ok(()), "{address}");
        }
    }
}

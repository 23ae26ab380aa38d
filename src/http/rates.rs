//! How often a token, or an address without one, may ask.

use std::hash::Hash;
use std::net::{IpAddr, Ipv6Addr};
use std::num::NonZeroU32;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use governor::clock::{Clock, MonotonicClock};
use governor::state::keyed::HashMapStateStore;
use governor::state::{InMemoryState, NotKeyed};
use governor::{NotUntil, Quota, RateLimiter};

/// Tokens, and addresses, whose rate is kept at a time, each some 50 bytes. Those that
/// could ask at their full rate again are dropped first; if there are as many
/// that could not, all share the rate of one.
const MAX_KEYS: usize = 16_384;

/// Time between two looks through a full table.
const SWEEP_EVERY: Duration = Duration::from_secs(1);

/// Seconds' worth of requests that may come at once.
const BURST_S: u32 = 10;

type Instant = <MonotonicClock as Clock>::Instant;

/// Requests a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rate(pub NonZeroU32);

/// Keeps a rate for each key.
struct Limiter<K: Hash + Eq + Clone> {
    each: RateLimiter<K, HashMapStateStore<K>, MonotonicClock>,
    rest: RateLimiter<NotKeyed, InMemoryState, MonotonicClock>,
    /// When a full table was last looked through.
    swept: Mutex<Option<Instant>>,
}

impl<K: Hash + Eq + Clone> Limiter<K> {
    fn new(rate: Rate) -> Self {
        let burst = rate.0.saturating_mul(NonZeroU32::MIN.saturating_add(BURST_S - 1));
        let quota = Quota::per_second(rate.0).allow_burst(burst);
        let each = RateLimiter::hashmap_with_clock(quota, MonotonicClock);
        let rest = RateLimiter::direct_with_clock(quota, MonotonicClock);
        Self { each, rest, swept: Mutex::default() }
    }

    /// Counts a request; if it comes too early, for how long to wait.
    fn take(&self, key: &K) -> Result<(), Duration> {
        if self.each.len() >= MAX_KEYS && self.sweep_is_due(MonotonicClock.now()) {
            self.each.retain_recent();
        }
        let wait = |until: NotUntil<Instant>| until.wait_time_from(MonotonicClock.now());
        if self.each.len() >= MAX_KEYS {
            return self.rest.check().map_err(wait);
        }
        self.each.check_key(key).map_err(wait)
    }

    /// Whether a full table is to be looked through at `now`: not at every request.
    fn sweep_is_due(&self, now: Instant) -> bool {
        let mut swept = self.swept.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = swept.is_none_or(|last| now.duration_since(last) >= SWEEP_EVERY);
        if is_due {
            *swept = Some(now);
        }
        is_due
    }
}

/// The rates of tokens and of addresses.
pub struct Rates {
    tokens: Limiter<String>,
    addresses: Limiter<IpAddr>,
}

impl Rates {
    /// Rates for a token, and for an address without one.
    #[must_use]
    pub fn new(token: Rate, address: Rate) -> Self {
        Self { tokens: Limiter::new(token), addresses: Limiter::new(address) }
    }

    pub(super) fn take_token(&self, id: &str) -> Result<(), Duration> {
        self.tokens.take(&id.to_owned())
    }

    pub(super) fn take_address(&self, address: IpAddr) -> Result<(), Duration> {
        self.addresses.take(&subscriber(address))
    }
}

/// Who is behind an address: of IPv6 the first 64 bits, as a subscriber has all
/// addresses that begin with them (RFC 6177).
pub(crate) fn subscriber(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => {
            IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & (u128::MAX << 64)))
        }
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: Rate = Rate(NonZeroU32::MIN);

    #[test]
    fn after_its_burst_a_key_waits_and_others_do_not() {
        let limiter = Limiter::new(ONE);
        for _ in 0..BURST_S {
            limiter.take(&1).unwrap();
        }
        let wait = limiter.take(&1).unwrap_err();
        assert!(wait > Duration::ZERO && wait <= Duration::from_secs(1), "{wait:?}");
        limiter.take(&2).unwrap();
    }

    #[test]
    fn a_full_table_is_looked_through_once_a_second() {
        let limiter = Limiter::<u8>::new(ONE);
        let now = MonotonicClock.now();
        assert!(limiter.sweep_is_due(now));
        assert!(!limiter.sweep_is_due(now + SWEEP_EVERY / 2));
        assert!(limiter.sweep_is_due(now + SWEEP_EVERY));
    }

    #[test]
    fn what_is_kept_has_an_end() {
        let limiter = Limiter::new(ONE);
        // However slow the machine is, most have asked just now and stay.
        let taken = (0..2 * MAX_KEYS).filter(|key| limiter.take(key).is_ok()).count();
        assert!(limiter.each.len() <= MAX_KEYS);
        let shared = MAX_KEYS + BURST_S as usize;
        assert!((shared..2 * MAX_KEYS).contains(&taken), "{taken}");
    }

    #[test]
    fn an_address_is_that_of_its_subscriber() {
        let same =
            |a: &str, b: &str| subscriber(a.parse().unwrap()) == subscriber(b.parse().unwrap());
        assert!(same("2001:db8:1:2::1", "2001:db8:1:2:ffff::9"));
        assert!(!same("2001:db8:1:2::1", "2001:db8:1:3::1"));
        assert!(same("::ffff:192.0.2.1", "192.0.2.1"));
        assert!(!same("192.0.2.1", "192.0.2.2"));
    }
}

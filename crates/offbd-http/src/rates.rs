//! Rate limits per token, and per client address for requests without a valid token.

use std::hash::Hash;
use std::net::{IpAddr, Ipv6Addr};
use std::num::NonZeroU32;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use governor::clock::{Clock, MonotonicClock};
use governor::state::keyed::HashMapStateStore;
use governor::state::{InMemoryState, NotKeyed};
use governor::{NotUntil, Quota, RateLimiter};

/// Limit of tokens, and of addresses, that are tracked at a time, some 50 bytes each. Keys
/// whose burst is full again are removed first; if all keys are in use, further ones
/// share a single limit.
const MAX_KEYS: usize = 16_384;

/// Shortest interval between two sweeps of a full table.
const SWEEP_INTERVAL: Duration = Duration::from_secs(1);

/// Size of the burst, in seconds at the permitted rate.
const BURST_S: u32 = 10;

type MonotonicInstant = <MonotonicClock as Clock>::Instant;

/// A rate limit, requests per second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RateLimit(pub NonZeroU32);

/// A rate limiter for each key.
struct Limiter<K: Hash + Eq + Clone> {
    keyed: RateLimiter<K, HashMapStateStore<K>, MonotonicClock>,
    /// Shared by the keys that do not fit the table.
    shared: RateLimiter<NotKeyed, InMemoryState, MonotonicClock>,
    /// When the full table was last swept.
    swept: Mutex<Option<MonotonicInstant>>,
}

impl<K: Hash + Eq + Clone> Limiter<K> {
    fn new(rate: RateLimit) -> Self {
        let burst = rate.0.saturating_mul(NonZeroU32::MIN.saturating_add(BURST_S - 1));
        let quota = Quota::per_second(rate.0).allow_burst(burst);
        let keyed = RateLimiter::hashmap_with_clock(quota, MonotonicClock);
        let shared = RateLimiter::direct_with_clock(quota, MonotonicClock);
        Self { keyed, shared, swept: Mutex::default() }
    }

    /// Counts a request.
    ///
    /// # Errors
    /// The time to wait if the limit is exceeded.
    fn check(&self, key: &K) -> Result<(), Duration> {
        if self.keyed.len() >= MAX_KEYS && self.sweep_is_due(MonotonicClock.now()) {
            self.keyed.retain_recent();
        }
        let wait = |until: NotUntil<MonotonicInstant>| until.wait_time_from(MonotonicClock.now());
        if self.keyed.len() >= MAX_KEYS {
            return self.shared.check().map_err(wait);
        }
        self.keyed.check_key(key).map_err(wait)
    }

    /// Whether a full table is to be swept at `now`.
    fn sweep_is_due(&self, now: MonotonicInstant) -> bool {
        let mut swept = self.swept.lock().unwrap_or_else(PoisonError::into_inner);
        let is_due = swept.is_none_or(|last| now.duration_since(last) >= SWEEP_INTERVAL);
        if is_due {
            *swept = Some(now);
        }
        is_due
    }
}

/// The rate limits of tokens and of client addresses.
pub struct RateLimits {
    tokens: Limiter<String>,
    addresses: Limiter<IpAddr>,
}

impl RateLimits {
    /// Returns limiters with the rate of a token, and that of an address without a token.
    #[must_use]
    pub fn new(token: RateLimit, address: RateLimit) -> Self {
        Self { tokens: Limiter::new(token), addresses: Limiter::new(address) }
    }

    pub(super) fn check_token(&self, id: &str) -> Result<(), Duration> {
        self.tokens.check(&id.to_owned())
    }

    pub(super) fn check_address(&self, address: IpAddr) -> Result<(), Duration> {
        self.addresses.check(&subscriber(address))
    }
}

/// Returns the address that identifies a subscriber: for IPv6 the first 64 bits, because
/// a subscriber is assigned at least a /64 (RFC 6177).
pub fn subscriber(address: IpAddr) -> IpAddr {
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

    const ONE: RateLimit = RateLimit(NonZeroU32::MIN);

    #[test]
    fn after_its_burst_a_key_waits_and_others_do_not() {
        let limiter = Limiter::new(ONE);
        for _ in 0..BURST_S {
            limiter.check(&1).unwrap();
        }
        let wait = limiter.check(&1).unwrap_err();
        assert!(wait > Duration::ZERO && wait <= Duration::from_secs(1), "{wait:?}");
        limiter.check(&2).unwrap();
    }

    #[test]
    fn a_full_table_is_swept_once_a_second() {
        let limiter = Limiter::<u8>::new(ONE);
        let now = MonotonicClock.now();
        assert!(limiter.sweep_is_due(now));
        assert!(!limiter.sweep_is_due(now + SWEEP_INTERVAL / 2));
        assert!(limiter.sweep_is_due(now + SWEEP_INTERVAL));
    }

    #[test]
    fn the_table_is_bounded() {
        let limiter = Limiter::new(ONE);
        // Even on a slow machine most keys are recent and stay in the table.
        let accepted = (0..2 * MAX_KEYS).filter(|key| limiter.check(key).is_ok()).count();
        assert!(limiter.keyed.len() <= MAX_KEYS);
        let shared = MAX_KEYS + BURST_S as usize;
        assert!((shared..2 * MAX_KEYS).contains(&accepted), "{accepted}");
    }

    #[test]
    fn addresses_of_one_subscriber_share_a_limit() {
        let same =
            |a: &str, b: &str| subscriber(a.parse().unwrap()) == subscriber(b.parse().unwrap());
        assert!(same("2001:db8:1:2::1", "2001:db8:1:2:ffff::9"));
        assert!(!same("2001:db8:1:2::1", "2001:db8:1:3::1"));
        assert!(same("::ffff:192.0.2.1", "192.0.2.1"));
        assert!(!same("192.0.2.1", "192.0.2.2"));
    }
}

//! Which devices are connected, as they tell themselves.
//!
//! Whether their assets exist is read from the database beside the intake of batches, which does
//! not wait for it.

use std::collections::BTreeMap;
use std::mem::take;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{Notify, OwnedSemaphorePermit, Semaphore};

use super::count;
use offbd_http::MessageOutcome;
use offbd_service::{Route, Service};
use offbd_wire::bus::{DeviceTopic, HelloView, PresenceWord};

/// Longest greeting of a device, bytes; a longer one is refused.
const MAX_HELLO: usize = 4096;

/// Devices whose presence is known; further ones are not counted.
const MAX_ATTENDANCE: usize = 100_000;

/// Bytes of presences whose assets are still to be checked; further ones are dropped. Chosen:
/// a broker hands over those of some 40 000 devices at once after each connection.
const MAX_UNCHECKED_BYTES: usize = 16 << 20;

/// Bytes that a waiting presence takes besides the name of its asset and its greeting. Chosen: more
/// than an entry of the map of waiting presences.
const UNCHECKED_OVERHEAD: usize = 256;

/// Assets that one query checks. Chosen: their names take at most 32 KiB.
const MAX_CHECKED: usize = 256;

/// The presences of the devices of one bus.
#[derive(Clone)]
pub(super) struct Attendance {
    bus: &'static str,
    shared: Arc<Shared>,
}

struct Shared {
    devices: Mutex<Devices>,
    /// The last presence of each asset that is to be checked.
    unchecked: Mutex<BTreeMap<String, Unchecked>>,
    /// Notified when a presence arrives.
    arrived: Notify,
    room: Arc<Semaphore>,
}

/// A presence whose asset may not exist.
struct Unchecked {
    presence: PresenceWord,
    /// The last greeting, as it was sent.
    hello: Vec<u8>,
    /// Number of messages of this asset that wait; only the last presence is kept.
    n_messages: u64,
    /// Counts the bytes.
    _room: OwnedSemaphorePermit,
}

impl Attendance {
    pub(super) fn new(bus: &'static str) -> Self {
        let shared = Shared {
            devices: Mutex::default(),
            unchecked: Mutex::default(),
            arrived: Notify::new(),
            room: Arc::new(Semaphore::new(MAX_UNCHECKED_BYTES)),
        };
        Self { bus, shared: Arc::new(shared) }
    }

    /// Takes a greeting or a presence. It counts once its asset is found.
    pub(super) fn arrive(
        &self,
        service: &Service,
        asset: String,
        topic: DeviceTopic,
        payload: &[u8],
    ) {
        if service.route(&asset) != Route::Here {
            return self.count(MessageOutcome::Elsewhere, 1);
        }
        if payload.is_empty() {
            // A retained message was removed.
            return self.count(MessageOutcome::Taken, 1);
        }
        let (presence, hello) = match topic {
            DeviceTopic::State => (PresenceWord::of_bytes(payload), &[][..]),
            _ => (greeting(payload).map(|_| PresenceWord::Online), payload),
        };
        match presence {
            Some(presence) => self.wait(asset, presence, hello),
            None => {
                tracing::warn!(
                    asset,
                    topic = topic.as_str(),
                    "the message of a device is malformed"
                );
                self.count(MessageOutcome::Malformed, 1);
            }
        }
    }

    fn wait(&self, asset: String, presence: PresenceWord, hello: &[u8]) {
        let mut unchecked = lock(&self.shared.unchecked);
        let previous = unchecked.remove(&asset);
        let n_messages = 1 + previous.as_ref().map_or(0, |previous| previous.n_messages);
        let hello = match previous {
            Some(previous) if hello.is_empty() => previous.hello,
            _ => hello.to_vec(),
        };
        let bytes = u32::try_from(asset.len() + hello.len() + UNCHECKED_OVERHEAD);
        let room = self.shared.room.clone();
        let Ok(_room) = room.try_acquire_many_owned(bytes.unwrap_or(u32::MAX)) else {
            return self.count(MessageOutcome::Busy, n_messages);
        };
        unchecked.insert(asset, Unchecked { presence, hello, n_messages, _room });
        self.shared.arrived.notify_one();
    }

    /// Checks the assets of what arrives, for as long as it is polled.
    pub(super) async fn check_assets(&self, service: &Service) {
        loop {
            self.shared.arrived.notified().await;
            let mut unchecked = take(&mut *lock(&self.shared.unchecked)).into_iter();
            loop {
                let part: BTreeMap<_, _> = unchecked.by_ref().take(MAX_CHECKED).collect();
                if part.is_empty() {
                    break;
                }
                self.check(service, part).await;
            }
        }
    }

    async fn check(&self, service: &Service, mut part: BTreeMap<String, Unchecked>) {
        let names: Vec<String> = part.keys().cloned().collect();
        let found = service.existing_assets(&names).await;
        let others = match found {
            Ok(_) => MessageOutcome::UnknownAsset,
            Err(_) => MessageOutcome::Unavailable,
        };
        for asset in found.unwrap_or_default() {
            let Some(Unchecked { presence, hello, n_messages, .. }) = part.remove(&asset) else {
                continue;
            };
            if let Some(HelloView { firmware, axes, units, rate_hz }) = greeting(&hello) {
                tracing::info!(asset, firmware, ?axes, ?units, rate_hz, "a device has connected");
            }
            if lock(&self.shared.devices).set(&asset, presence) {
                tracing::info!(asset, ?presence, "a device has told its presence");
            }
            self.count(MessageOutcome::Taken, n_messages);
        }
        self.count(others, part.values().map(|one| one.n_messages).sum());
    }

    fn count(&self, outcome: MessageOutcome, n: u64) {
        count(self.bus, outcome, n);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Parses the greeting of a device, which is online then; `None` if it is malformed.
fn greeting(payload: &[u8]) -> Option<HelloView> {
    let hello = (payload.len() <= MAX_HELLO).then(|| serde_json::from_slice(payload));
    hello?.ok()
}

/// The last presence of each device. The metric is the sum over all buses.
#[derive(Default)]
struct Devices {
    by_asset: BTreeMap<String, PresenceWord>,
    n_online: u32,
}

impl Devices {
    /// Notes a presence; returns whether it differs from the one before.
    fn set(&mut self, asset: &str, presence: PresenceWord) -> bool {
        if self.by_asset.len() >= MAX_ATTENDANCE && !self.by_asset.contains_key(asset) {
            return false;
        }
        let previous = self.by_asset.insert(asset.to_owned(), presence);
        let [was_online, is_online] =
            [previous, Some(presence)].map(|one| one == Some(PresenceWord::Online));
        let gauge = metrics::gauge!("offbd_bus_devices_online");
        if is_online && !was_online {
            self.n_online += 1;
            gauge.increment(1.0);
        } else if was_online && !is_online {
            self.n_online -= 1;
            gauge.decrement(1.0);
        }
        previous != Some(presence)
    }
}

impl Drop for Devices {
    fn drop(&mut self) {
        metrics::gauge!("offbd_bus_devices_online").decrement(f64::from(self.n_online));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn presence() -> impl Strategy<Value = PresenceWord> {
        prop_oneof![Just(PresenceWord::Online), Just(PresenceWord::Offline)]
    }

    proptest! {
        #[test]
        fn the_running_count_is_the_number_of_devices_online(
            told in prop::collection::vec(("[ab][ab]?", presence()), 0..40),
        ) {
            let mut devices = Devices::default();
            for (asset, presence) in told {
                let differs = devices.by_asset.get(&asset) != Some(&presence);
                prop_assert_eq!(devices.set(&asset, presence), differs);
                prop_assert_eq!(devices.by_asset[&asset], presence);
                let online = devices.by_asset.values().filter(|one| **one == PresenceWord::Online);
                prop_assert_eq!(devices.n_online as usize, online.count());
            }
        }
    }
}

//! Which devices are connected, as they tell themselves.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use crate::service::{Service, ServiceError};
use crate::wire::bus::{DeviceTopic, HelloView, PresenceWord};

/// Longest greeting of a device, bytes; a longer one is refused.
const MAX_HELLO: usize = 4096;

/// Devices whose presence is known; further ones are not counted.
const MAX_ATTENDANCE: usize = 100_000;

/// The last presence of each device.
#[derive(Clone, Default)]
pub(super) struct Attendance {
    by_asset: Arc<Mutex<BTreeMap<String, PresenceWord>>>,
}

impl Attendance {
    /// Takes a greeting or a presence. Returns the label of the metric of messages.
    pub(super) async fn note(
        &self,
        service: &Service,
        asset: &str,
        topic: DeviceTopic,
        payload: &[u8],
    ) -> &'static str {
        if payload.is_empty() {
            // A retained message was removed.
            return "taken";
        }
        match service.asset(asset).await {
            Ok(_) => {}
            Err(ServiceError::UnknownAsset { .. }) => return "unknown_asset",
            Err(_) => return "unavailable",
        }
        let presence = match topic {
            DeviceTopic::State => PresenceWord::of_bytes(payload),
            _ => greeting(asset, payload),
        };
        let Some(presence) = presence else {
            tracing::warn!(asset, topic = topic.as_str(), "the message of a device is malformed");
            return "malformed";
        };
        self.set(asset, presence);
        "taken"
    }

    #[expect(clippy::cast_precision_loss, reason = "there are far fewer devices than 2^52")]
    fn set(&self, asset: &str, presence: PresenceWord) {
        let mut by_asset = self.by_asset.lock().unwrap_or_else(PoisonError::into_inner);
        if by_asset.len() >= MAX_ATTENDANCE && !by_asset.contains_key(asset) {
            return;
        }
        if by_asset.insert(asset.to_owned(), presence) != Some(presence) {
            tracing::info!(asset, ?presence, "a device has told its presence");
        }
        let n_online = by_asset.values().filter(|one| **one == PresenceWord::Online).count();
        metrics::gauge!("offbd_bus_devices_online").set(n_online as f64);
    }
}

/// Logs the greeting of a device, which is online then; `None` if it is malformed.
fn greeting(asset: &str, payload: &[u8]) -> Option<PresenceWord> {
    let hello = (payload.len() <= MAX_HELLO).then(|| serde_json::from_slice::<HelloView>(payload));
    let HelloView { firmware, axes, units, rate_hz } = hello?.ok()?;
    tracing::info!(asset, firmware, ?axes, ?units, rate_hz, "a device has connected");
    Some(PresenceWord::Online)
}

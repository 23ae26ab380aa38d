//! Sends notifications: by webhook, and by e-mail if the program is built with it.

#[cfg(feature = "email")]
mod email;
mod webhook;

use std::net::{IpAddr, SocketAddr};

use self::webhook::WebhookSender;
use offbd_service::{
    Clock, NotificationSettings, NotificationTransport, SendOutcome, TargetPolicy,
};
use offbd_wire::notification::{NotificationView, StoredChannel};

/// Sends by all kinds of channels.
pub(super) struct Senders {
    settings: NotificationSettings,
    webhook: WebhookSender,
}

impl Senders {
    pub(super) fn new(settings: &NotificationSettings) -> Self {
        Self { settings: settings.clone(), webhook: WebhookSender::new(&settings.targets) }
    }

    async fn attempt(&self, channel: &StoredChannel, message: &NotificationView) -> SendOutcome {
        match channel {
            StoredChannel::Webhook { url, secret, format } => {
                self.webhook.send((url, secret), *format, message, Clock::System.now()).await
            }
            #[cfg(feature = "email")]
            StoredChannel::Email(mail) => email::send(mail, message, &self.settings.targets).await,
            #[cfg(not(feature = "email"))]
            StoredChannel::Email(_) => {
                SendOutcome::Refused { reason: "this program is built without e-mail".to_owned() }
            }
        }
    }
}

impl NotificationTransport for Senders {
    async fn send(&self, channel: &StoredChannel, message: &NotificationView) -> SendOutcome {
        let attempt = self.attempt(channel, message);
        let limit = self.settings.timeout;
        let late = |_| failed(format!("no answer within {} s", limit.as_secs()));
        tokio::time::timeout(limit, attempt).await.unwrap_or_else(late)
    }
}

fn failed(reason: impl Into<String>) -> SendOutcome {
    SendOutcome::Failed { reason: reason.into(), retry_after: None }
}

/// Returns the addresses of a host that are permitted. They are checked after the look-up and
/// then connected to, so that a name cannot change in between.
///
/// # Errors
/// If there is none, why.
async fn addresses(
    host: &str,
    port: u16,
    targets: &TargetPolicy,
) -> Result<Vec<SocketAddr>, String> {
    let host = host.trim_matches(['[', ']']);
    targets.check_host(host).map_err(|reason| format!("the host {reason}"))?;
    let found: Vec<SocketAddr> = match host.parse::<IpAddr>() {
        Ok(address) => vec![(address, port).into()],
        Err(_) => {
            let unknown = |_| "the name of the host cannot be resolved".to_owned();
            tokio::net::lookup_host((host, port)).await.map_err(unknown)?.collect()
        }
    };
    let refusal = found.iter().find_map(|address| targets.check_address(address.ip()).err());
    let is_permitted = |address: &SocketAddr| targets.check_address(address.ip()).is_ok();
    let permitted: Vec<_> = found.into_iter().filter(is_permitted).collect();
    match (permitted.is_empty(), refusal) {
        (false, _) => Ok(permitted),
        (true, Some(reason)) => Err(format!("the address of the host {reason}")),
        (true, None) => Err("the host has no address".to_owned()),
    }
}

//! Makes the deliveries of one channel.

use futures_util::future::try_join_all;

use super::retry::next_attempt;
use super::{Context, NotificationTransport, SendOutcome, stored};
use crate::{ServiceError, views};
use offbd_store::{ChannelRow, DeliveryRow, NotificationWrite, Write};
use offbd_wire::notification::{NotificationView, StoredChannel};
use offbd_wire::words::DeliveryState;

/// Attempts of one channel at a time, each for another asset; further deliveries wait.
const MAX_AT_A_TIME: u32 = 4;

/// Longest reason of a failure that is stored, bytes; a longer one is truncated.
const MAX_REASON: usize = 300;

impl<T: NotificationTransport> Context<T> {
    /// Makes the deliveries of `channel` that are due, until none is.
    pub(super) async fn deliver(&self, channel: &ChannelRow) -> Result<(), ServiceError> {
        let settings = stored(channel)?;
        loop {
            let now = self.handles.clock.now();
            let due = self.handles.store.due_deliveries(&channel.id, now, MAX_AT_A_TIME).await?;
            if due.is_empty() {
                return Ok(());
            }
            try_join_all(due.into_iter().map(|row| self.attempt(channel, &settings, row))).await?;
        }
    }

    /// Makes one attempt and stores its outcome.
    async fn attempt(
        &self,
        channel: &ChannelRow,
        settings: &StoredChannel,
        row: DeliveryRow,
    ) -> Result<(), ServiceError> {
        let message: NotificationView = views::from_json(&row.body)?;
        let outcome = self.transport.send(settings, &message).await;
        let result = if outcome == SendOutcome::Delivered { "delivered" } else { "failed" };
        let kind = settings.kind().as_str();
        metrics::counter!("offbd_delivery_attempts_total", "channel" => kind, "result" => result)
            .increment(1);
        let row = self.after(row, outcome);
        if row.state == DeliveryState::GivenUp.as_str() {
            metrics::counter!("offbd_deliveries_given_up_total", "channel" => kind).increment(1);
            let (name, reason) = (&channel.name, row.error.as_deref().unwrap_or_default());
            tracing::error!(channel = name, message = row.message, reason, "delivery given up");
        }
        self.handles
            .write_as_leader(vec![Write::Notification(NotificationWrite::Attempted(row))])
            .await
    }

    /// Returns the delivery after an attempt.
    fn after(&self, row: DeliveryRow, outcome: SendOutcome) -> DeliveryRow {
        let now = self.handles.clock.now();
        let attempts = row.attempts + 1;
        let finished = |state: DeliveryState, error| DeliveryRow {
            state: state.to_string(),
            attempts,
            finished_at: Some(now),
            error,
            ..row.clone()
        };
        match outcome {
            SendOutcome::Delivered => finished(DeliveryState::Delivered, None),
            SendOutcome::Refused { reason } => {
                finished(DeliveryState::GivenUp, Some(shortened(reason)))
            }
            SendOutcome::Failed { reason, retry_after } => {
                let error = Some(shortened(reason));
                let next = next_attempt(&self.settings, attempts, row.created_at, now, retry_after);
                match next {
                    Some(due_at) => DeliveryRow { attempts, due_at, error, ..row },
                    None => finished(DeliveryState::GivenUp, error),
                }
            }
        }
    }
}

fn shortened(mut reason: String) -> String {
    while reason.len() > MAX_REASON {
        reason.pop();
    }
    reason
}

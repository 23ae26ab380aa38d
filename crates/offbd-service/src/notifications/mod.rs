//! Notifications: tells people of changes of faults, by channels that rules choose.
//!
//! 1. **Planning** (`planner`): every channel has a position among the numbered events. For
//!    the events after it, the rules (`rules`) decide which are sent; the deliveries and the
//!    new position are stored in one transaction. So every event is planned once, also if the
//!    process is killed, and its message has the same id in every attempt.
//! 2. **Delivery** (`courier`): each channel has its own task. Of each asset the first message
//!    that waits is attempted; the next one has its turn when that is delivered or given up. A
//!    failed attempt is repeated after growing delays (`retry`). A message may arrive twice,
//!    if the process is killed before the outcome is stored.
//! 3. **Reminders** (`reminders`): a rule may repeat a message as long as a fault fails and
//!    nobody has acknowledged it, or delay the first one until the fault has failed for some time.
//!
//! Nothing of this is on the way of a batch: events are read from the store, and a channel
//! that hangs delays only its own messages. How messages travel is the business of a
//! [`NotificationTransport`].

mod courier;
mod planner;
mod quiet_hours;
mod reminders;
mod retry;
mod rules;
pub(super) mod settings;
mod targets;

use std::collections::HashSet;
use std::future::Future;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{Notify, broadcast};

pub(super) use planner::{delivery, test_message};
pub use retry::NotificationSettings;
pub(super) use retry::micros;
pub use targets::TargetPolicy;

use super::mutes::Mutes;
use super::writing::{Events, Handles};
use super::{Event, Reasons, ServiceError, views};
use offbd_store::ChannelRow;
use offbd_wire::notification::{NotificationView, StoredChannel};

/// Interval at which retries and reminders are looked for.
const INTERVAL: Duration = Duration::from_secs(1);

/// Channels; at the limit a new one is refused.
pub(super) const MAX_CHANNELS: usize = 50;

/// Rules; at the limit a new one is refused.
pub(super) const MAX_RULES: usize = 500;

/// The outcome of one attempt.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SendOutcome {
    Delivered,
    /// It may succeed later, not before `retry_after`.
    Failed {
        reason: String,
        retry_after: Option<Duration>,
    },
    /// The target wants no more of it.
    Refused {
        reason: String,
    },
}

/// Sends messages.
pub trait NotificationTransport: Send + Sync + 'static {
    /// Makes one attempt, within the time limit of the settings. Neither the result nor a log
    /// may contain a secret of the channel.
    fn send(
        &self,
        channel: &StoredChannel,
        message: &NotificationView,
    ) -> impl Future<Output = SendOutcome> + Send;
}

/// The background task of notifications, before it is started.
pub struct Notifier<T> {
    context: Arc<Context<T>>,
    events: Events,
    wake: Arc<Notify>,
}

/// What planning and delivery use.
struct Context<T> {
    handles: Handles,
    mutes: Mutes,
    settings: NotificationSettings,
    transport: T,
    /// The channels whose task runs.
    busy: Mutex<HashSet<String>>,
}

impl<T: NotificationTransport> Notifier<T> {
    pub(super) fn new(
        handles: Handles,
        mutes: Mutes,
        settings: NotificationSettings,
        events: Events,
        wake: Arc<Notify>,
        transport: T,
    ) -> Self {
        let busy = Mutex::default();
        Self {
            context: Arc::new(Context { handles, mutes, settings, transport, busy }),
            events,
            wake,
        }
    }

    /// Plans and sends until the service shuts down. What is not delivered then is sent after
    /// the next start.
    pub async fn run(self) {
        let closing = self.context.handles.closing.clone();
        let _ = closing.run_until_cancelled(self.run_forever()).await;
    }

    async fn run_forever(self) {
        let mut events = None;
        let mut ticks = tokio::time::interval(INTERVAL);
        ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
        let reasons = Reasons::default();
        loop {
            tokio::select! {
                _ = ticks.tick() => {}
                () = self.wake.notified() => {}
                received = next(&mut events) => if let Err(RecvError::Closed) = received {
                    return;
                },
            }
            match self.turn().await {
                Ok(true) => {
                    reasons.clear();
                    if events.is_none() {
                        events = Some(self.events.subscribe().await);
                    }
                }
                Ok(false) => {
                    reasons.clear();
                    // Reading the events of a cluster costs something.
                    events = None;
                }
                Err(error) if reasons.is_new(&error) => {
                    tracing::warn!(%error, "notifications cannot be planned and are planned later");
                }
                Err(_) => {}
            }
        }
    }

    /// Plans what there is to plan, and starts the tasks of the channels. Returns whether there
    /// are any, and this process sends to them.
    async fn turn(&self) -> Result<bool, ServiceError> {
        let context = &self.context;
        if !context.handles.is_leader() {
            // Another node of the cluster sends.
            return Ok(false);
        }
        let channels = context.handles.store.channels().await?;
        if channels.is_empty() {
            return Ok(false);
        }
        let rules = context.rules().await?;
        for channel in &channels {
            context.plan(channel, &rules).await?;
        }
        context.remind(&rules).await?;
        for channel in channels {
            context.clone().start(channel);
        }
        Ok(true)
    }
}

/// Waits for an event, and forgets those that wait behind it. For ever without a subscription.
async fn next(events: &mut Option<broadcast::Receiver<Arc<Event>>>) -> Result<(), RecvError> {
    let Some(events) = events else { return std::future::pending().await };
    match events.recv().await {
        Ok(_) => while events.try_recv().is_ok() {},
        Err(RecvError::Lagged(_)) => {}
        Err(RecvError::Closed) => return Err(RecvError::Closed),
    }
    Ok(())
}

impl<T: NotificationTransport> Context<T> {
    /// Starts the task of a channel, unless it runs.
    fn start(self: Arc<Self>, channel: ChannelRow) {
        if !self.busy().insert(channel.id.clone()) {
            return;
        }
        tokio::spawn(async move {
            let closing = self.handles.closing.clone();
            if let Some(Err(error)) = closing.run_until_cancelled(self.deliver(&channel)).await {
                let name = &channel.name;
                tracing::warn!(channel = name, %error, "deliveries fail and are made later");
            }
            self.busy().remove(&channel.id);
        });
    }

    fn busy(&self) -> std::sync::MutexGuard<'_, HashSet<String>> {
        self.busy.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Parses the stored settings of a channel.
pub(super) fn stored(row: &ChannelRow) -> Result<StoredChannel, ServiceError> {
    views::from_json(&row.document)
}

#[cfg(test)]
mod tests;

//! Channels, rules and deliveries of notifications.

use std::collections::BTreeMap;

use uuid::Uuid;

use crate::clock::rfc3339;
use crate::notifications::test_message;
use crate::notifications::{MAX_CHANNELS, MAX_RULES, delivery, settings, stored};
use crate::{Service, ServiceError, views};
use offbd_core::vocabulary::Invalid;
use offbd_store::{ChannelRow, DeliveryRow, LAST_ID, NotificationWrite, RuleRow, Write};
use offbd_wire::notification::{
    ChannelView, DeliveryView, MadeChannelView, NewChannelView, NewRuleView, NotificationView,
    RuleView, StoredChannel,
};
use offbd_wire::service::Page;
use offbd_wire::words::DeliveryState;

/// The parameters of a query for deliveries.
#[derive(Clone, Debug, Default)]
pub struct DeliveryQuery {
    pub channel: Option<String>,
    pub state: Option<DeliveryState>,
    pub cursor: Option<String>,
}

impl Service {
    async fn change_notifications(&self, write: NotificationWrite) -> Result<(), ServiceError> {
        self.inner.handles.write_unpartitioned(Write::Notification(write)).await
    }

    async fn channel_row(&self, id: &str) -> Result<ChannelRow, ServiceError> {
        let rows = self.inner.handles.store.channels().await?;
        let found = rows.into_iter().find(|row| row.id == id);
        found.ok_or_else(|| ServiceError::UnknownChannel { id: id.to_owned() })
    }

    async fn channel_view(&self, row: ChannelRow) -> Result<ChannelView, ServiceError> {
        let store = &self.inner.handles.store;
        let count = async |state: DeliveryState| {
            let n = store.n_deliveries(&row.id, state.as_str()).await?;
            Ok::<_, ServiceError>(u64::try_from(n).unwrap_or_default())
        };
        let pending = count(DeliveryState::Pending).await?;
        let given_up = count(DeliveryState::GivenUp).await?;
        let settings = stored(&row)?;
        let kind = settings.kind();
        let (url, email) = match settings {
            StoredChannel::Webhook { url, .. } => (Some(url), None),
            StoredChannel::Email(email) => (None, Some(settings::email_view(email))),
        };
        let created_at = rfc3339(row.created_at);
        Ok(ChannelView {
            id: row.id,
            name: row.name,
            kind,
            url,
            email,
            created_at,
            pending,
            given_up,
        })
    }

    /// Returns the channels, by name, without their secrets.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn channels(&self) -> Result<Vec<ChannelView>, ServiceError> {
        let mut views = Vec::new();
        for row in self.inner.handles.store.channels().await? {
            views.push(self.channel_view(row).await?);
        }
        Ok(views)
    }

    /// Returns a channel without its secrets.
    ///
    /// # Errors
    /// [`ServiceError::UnknownChannel`].
    pub async fn channel(&self, id: &str) -> Result<ChannelView, ServiceError> {
        let row = self.channel_row(id).await?;
        self.channel_view(row).await
    }

    /// Creates a channel. The result is the only place with a new secret.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the invalid element; [`ServiceError::ChannelExists`];
    /// [`ServiceError::TooManySettings`].
    pub async fn create_channel(
        &self,
        new: NewChannelView,
    ) -> Result<MadeChannelView, ServiceError> {
        let channels = self.inner.handles.store.channels().await?;
        if channels.len() >= MAX_CHANNELS {
            return Err(ServiceError::TooManySettings { what: "channels", limit: MAX_CHANNELS });
        }
        let name = new.name.clone();
        let targets = &self.inner.limits.notifications.targets;
        let (settings, secret) = settings::channel(new, None, targets)?;
        if channels.iter().any(|row| row.name == name) {
            return Err(ServiceError::ChannelExists { name });
        }
        let row = ChannelRow {
            id: Uuid::now_v7().to_string(),
            name,
            document: views::to_json(&settings)?,
            position: 0,
            created_at: self.inner.handles.clock.now(),
        };
        self.change_notifications(NotificationWrite::CreateChannel(row.clone())).await?;
        Ok(MadeChannelView { channel: self.channel_view(row).await?, secret })
    }

    /// Replaces the settings of a channel. A secret or password that is not given stays.
    ///
    /// # Errors
    /// As for [`Self::create_channel`], and [`ServiceError::UnknownChannel`].
    pub async fn put_channel(
        &self,
        id: &str,
        new: NewChannelView,
    ) -> Result<MadeChannelView, ServiceError> {
        let row = self.channel_row(id).await?;
        let name = new.name.clone();
        let targets = &self.inner.limits.notifications.targets;
        let (settings, secret) = settings::channel(new, Some(&stored(&row)?), targets)?;
        let others = self.inner.handles.store.channels().await?;
        if others.iter().any(|other| other.name == name && other.id != id) {
            return Err(ServiceError::ChannelExists { name });
        }
        let document = views::to_json(&settings)?;
        let (id, name) = (row.id, name);
        let update = NotificationWrite::UpdateChannel { id: id.clone(), name, document };
        self.change_notifications(update).await?;
        Ok(MadeChannelView { channel: self.channel(&id).await?, secret })
    }

    /// Deletes a channel with its deliveries.
    ///
    /// # Errors
    /// [`ServiceError::UnknownChannel`]; [`ServiceError::ChannelInUse`] if a rule uses it.
    pub async fn delete_channel(&self, id: &str) -> Result<(), ServiceError> {
        let row = self.channel_row(id).await?;
        if let Some(rule) = self.rules().await?.into_iter().find(|r| r.rule.channel == id) {
            return Err(ServiceError::ChannelInUse { name: row.name, rule: rule.rule.name });
        }
        self.change_notifications(NotificationWrite::DeleteChannel { id: row.id }).await
    }

    /// Returns whether messages have links to the dashboard.
    #[must_use]
    pub fn has_public_url(&self) -> bool {
        self.inner.limits.notifications.public_url.is_some()
    }

    /// Puts a test message into the queue of a channel.
    ///
    /// # Errors
    /// [`ServiceError::UnknownChannel`].
    pub async fn test_channel(&self, id: &str) -> Result<DeliveryView, ServiceError> {
        let row = self.channel_row(id).await?;
        let now = self.inner.handles.clock.now();
        let settings = &self.inner.limits.notifications;
        let message = test_message(settings.public_url.as_deref(), now);
        let delivery = delivery(&row, (0, now), "", &message, now);
        let (channel, position) = (row.id.clone(), None);
        let deliveries = vec![delivery.clone()];
        self.change_notifications(NotificationWrite::Plan { channel, position, deliveries })
            .await?;
        self.inner.wake_notifier.notify_one();
        delivery_view(delivery, Some(row.name))
    }

    /// Returns the rules in the order of their creation.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn rules(&self) -> Result<Vec<RuleView>, ServiceError> {
        let names = self.channel_names().await?;
        let view = |row: RuleRow| {
            let rule: NewRuleView = views::from_json(&row.document)?;
            let channel_name = names.get(&rule.channel).cloned().unwrap_or_default();
            Ok(RuleView { id: row.id, channel_name, created_at: rfc3339(row.created_at), rule })
        };
        self.inner.handles.store.rules().await?.into_iter().map(view).collect()
    }

    async fn channel_names(&self) -> Result<BTreeMap<String, String>, ServiceError> {
        let rows = self.inner.handles.store.channels().await?;
        Ok(rows.into_iter().map(|row| (row.id, row.name)).collect())
    }

    /// Creates a rule.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] with the invalid element; [`ServiceError::TooManySettings`].
    pub async fn create_rule(&self, rule: NewRuleView) -> Result<RuleView, ServiceError> {
        if self.inner.handles.store.rules().await?.len() >= MAX_RULES {
            return Err(ServiceError::TooManySettings { what: "rules", limit: MAX_RULES });
        }
        let (id, created_at) = (Uuid::now_v7().to_string(), self.inner.handles.clock.now());
        self.put_rule_row(id, created_at, rule).await
    }

    /// Replaces a rule.
    ///
    /// # Errors
    /// [`ServiceError::UnknownRule`]; [`ServiceError::Invalid`] with the invalid element.
    pub async fn put_rule(&self, id: &str, rule: NewRuleView) -> Result<RuleView, ServiceError> {
        let row = self.rule_row(id).await?;
        self.put_rule_row(row.id, row.created_at, rule).await
    }

    async fn rule_row(&self, id: &str) -> Result<RuleRow, ServiceError> {
        let rows = self.inner.handles.store.rules().await?;
        let found = rows.into_iter().find(|row| row.id == id);
        found.ok_or_else(|| ServiceError::UnknownRule { id: id.to_owned() })
    }

    async fn put_rule_row(
        &self,
        id: String,
        created_at: i64,
        rule: NewRuleView,
    ) -> Result<RuleView, ServiceError> {
        settings::check_rule(&rule)?;
        let Some(channel_name) = self.channel_names().await?.remove(&rule.channel) else {
            return Err(Invalid::new("/channel", "is not the id of a channel").into());
        };
        let (channel, document) = (rule.channel.clone(), views::to_json(&rule)?);
        let row = RuleRow { id: id.clone(), channel, document, created_at };
        self.change_notifications(NotificationWrite::PutRule(row)).await?;
        Ok(RuleView { id, channel_name, created_at: rfc3339(created_at), rule })
    }

    /// Deletes a rule, with its reminders.
    ///
    /// # Errors
    /// [`ServiceError::UnknownRule`].
    pub async fn delete_rule(&self, id: &str) -> Result<(), ServiceError> {
        let row = self.rule_row(id).await?;
        self.change_notifications(NotificationWrite::DeleteRule { id: row.id }).await
    }

    /// Returns a page of deliveries, the latest first.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn deliveries(
        &self,
        query: DeliveryQuery,
        limit: u32,
    ) -> Result<Page<DeliveryView>, ServiceError> {
        let before: Option<String> = query.cursor.as_deref().map(views::cursor).transpose()?;
        let before = before.as_deref().unwrap_or(LAST_ID);
        let state = query.state.map(DeliveryState::as_str);
        let store = &self.inner.handles.store;
        let rows = store.deliveries(query.channel.as_deref(), state, before, limit + 1).await?;
        let names = self.channel_names().await?;
        let view = |row: DeliveryRow| {
            let name = names.get(&row.channel).cloned();
            delivery_view(row, name)
        };
        views::page(rows, limit, |row| row.id.clone(), view)
    }

    /// Returns a delivery.
    ///
    /// # Errors
    /// [`ServiceError::UnknownDelivery`].
    pub async fn delivery(&self, id: &str) -> Result<DeliveryView, ServiceError> {
        let row = self.inner.handles.store.delivery(id).await?;
        let row = row.ok_or_else(|| ServiceError::UnknownDelivery { id: id.to_owned() })?;
        let name = self.channel_names().await?.remove(&row.channel);
        delivery_view(row, name)
    }
}

fn delivery_view(
    row: DeliveryRow,
    channel_name: Option<String>,
) -> Result<DeliveryView, ServiceError> {
    let message: NotificationView = views::from_json(&row.body)?;
    let state: DeliveryState = views::word(&row.state)?;
    Ok(DeliveryView {
        id: row.id,
        channel: row.channel,
        channel_name,
        message_id: row.message,
        asset: Some(row.asset).filter(|asset| !asset.is_empty()),
        summary: message.data.summary,
        state,
        attempts: u32::try_from(row.attempts).unwrap_or(u32::MAX),
        created_at: rfc3339(row.created_at),
        next_attempt_at: (state == DeliveryState::Pending).then(|| rfc3339(row.due_at)),
        finished_at: row.finished_at.map(rfc3339),
        error: row.error,
    })
}

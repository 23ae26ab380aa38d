//! Channels, rules and deliveries of notifications.

use std::collections::BTreeMap;

use uuid::Uuid;

use crate::clock::rfc3339;
use crate::notifications::test_message;
use crate::notifications::{MAX_CHANNELS, MAX_RULES, delivery, settings, stored};
use crate::{EntityTag, Expected, Service, ServiceError, views};
use offbd_core::vocabulary::Invalid;
use offbd_store::{
    ChannelRow, DeliveryRow, EditWrite, Expectation, LAST_ID, NotificationWrite, RuleRow, Write,
};
use offbd_wire::notification::{
    ChannelView, DeliveryView, EmailView, MadeChannelView, NewChannelView, NewRuleView,
    NotificationView, RuleView, StoredChannel,
};
use offbd_wire::service::Page;
use offbd_wire::words::{ChannelKind, DeliveryState, WebhookFormat};

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

    /// Makes a change if the request may replace any edition, or if what it replaces is still
    /// `unchanged`; returns whether it is.
    async fn edit_notifications(
        &self,
        expected: &Expected,
        unchanged: Expectation,
        write: NotificationWrite,
    ) -> Result<bool, ServiceError> {
        if expected.is_particular() {
            let edit = EditWrite::Notification(write);
            return self.inner.handles.edit(None, unchanged, edit).await;
        }
        self.change_notifications(write).await?;
        Ok(true)
    }

    /// Returns the error of an edit of a channel that another one has preceded.
    async fn changed_channel(&self, id: &str) -> ServiceError {
        changed(self.channel_row(id).await.and_then(|row| channel_tag(&row)))
    }

    /// Returns the error of an edit of a rule that another one has preceded.
    async fn changed_rule(&self, id: &str) -> ServiceError {
        changed(self.rule_row(id).await.and_then(|row| rule_tag(&views::from_json(&row.document)?)))
    }

    async fn channel_row(&self, id: &str) -> Result<ChannelRow, ServiceError> {
        let rows = self.inner.handles.store.channels().await?;
        let found = rows.into_iter().find(|row| row.id == id);
        found.ok_or_else(|| ServiceError::UnknownChannel { id: id.to_owned() })
    }

    async fn channel_view(&self, row: ChannelRow) -> Result<ChannelView, ServiceError> {
        let etag = channel_tag(&row)?.to_string();
        let store = &self.inner.handles.store;
        let count = async |state: DeliveryState| {
            let n = store.n_deliveries(&row.id, state.as_str()).await?;
            Ok::<_, ServiceError>(u64::try_from(n).unwrap_or_default())
        };
        let pending = count(DeliveryState::Pending).await?;
        let given_up = count(DeliveryState::GivenUp).await?;
        let (kind, webhook, email) = shown(stored(&row)?);
        let (url, format) = webhook.unzip();
        let created_at = rfc3339(row.created_at);
        Ok(ChannelView {
            id: row.id,
            etag,
            name: row.name,
            kind,
            url,
            format,
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
    /// As for [`Self::create_channel`], and [`ServiceError::UnknownChannel`];
    /// [`ServiceError::Changed`] if the present settings are not the expected ones.
    pub async fn put_channel(
        &self,
        id: &str,
        new: NewChannelView,
        expected: &Expected,
    ) -> Result<MadeChannelView, ServiceError> {
        let row = self.channel_row(id).await?;
        expected.check(Some(&channel_tag(&row)?))?;
        let name = new.name.clone();
        let targets = &self.inner.limits.notifications.targets;
        let (settings, secret) = settings::channel(new, Some(&stored(&row)?), targets)?;
        let others = self.inner.handles.store.channels().await?;
        if others.iter().any(|other| other.name == name && other.id != id) {
            return Err(ServiceError::ChannelExists { name });
        }
        let updated = ChannelRow { name, document: views::to_json(&settings)?, ..row.clone() };
        let (name, document) = (updated.name.clone(), updated.document.clone());
        let update = NotificationWrite::UpdateChannel { id: row.id.clone(), name, document };
        if !self.edit_notifications(expected, unchanged_channel(row), update).await? {
            return Err(self.changed_channel(id).await);
        }
        Ok(MadeChannelView { channel: self.channel_view(updated).await?, secret })
    }

    /// Deletes a channel with its deliveries.
    ///
    /// # Errors
    /// [`ServiceError::UnknownChannel`]; [`ServiceError::ChannelInUse`] if a rule uses it;
    /// [`ServiceError::Changed`] if its settings are not the expected ones.
    pub async fn delete_channel(&self, id: &str, expected: &Expected) -> Result<(), ServiceError> {
        let row = self.channel_row(id).await?;
        expected.check(Some(&channel_tag(&row)?))?;
        if let Some(rule) = self.rules().await?.into_iter().find(|r| r.rule.channel == id) {
            return Err(ServiceError::ChannelInUse { name: row.name, rule: rule.rule.name });
        }
        let delete = NotificationWrite::DeleteChannel { id: row.id.clone() };
        if !self.edit_notifications(expected, unchanged_channel(row), delete).await? {
            return Err(self.changed_channel(id).await);
        }
        Ok(())
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
        let rows = self.inner.handles.store.rules().await?;
        rows.into_iter().map(|row| rule_view(row, &names)).collect()
    }

    /// Returns a rule.
    ///
    /// # Errors
    /// [`ServiceError::UnknownRule`].
    pub async fn rule(&self, id: &str) -> Result<RuleView, ServiceError> {
        let names = self.channel_names().await?;
        rule_view(self.rule_row(id).await?, &names)
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
        let (row, names) = self.new_rule_row(id, created_at, &rule).await?;
        self.change_notifications(NotificationWrite::PutRule(row.clone())).await?;
        rule_view(row, &names)
    }

    /// Replaces a rule.
    ///
    /// # Errors
    /// [`ServiceError::UnknownRule`]; [`ServiceError::Invalid`] with the invalid element;
    /// [`ServiceError::Changed`] if the present rule is not the expected one.
    pub async fn put_rule(
        &self,
        id: &str,
        rule: NewRuleView,
        expected: &Expected,
    ) -> Result<RuleView, ServiceError> {
        let found = self.rule_row(id).await?;
        expected.check(Some(&rule_tag(&views::from_json(&found.document)?)?))?;
        let (row, names) = self.new_rule_row(found.id.clone(), found.created_at, &rule).await?;
        let put = NotificationWrite::PutRule(row.clone());
        if !self.edit_notifications(expected, unchanged_rule(found), put).await? {
            return Err(self.changed_rule(id).await);
        }
        rule_view(row, &names)
    }

    async fn rule_row(&self, id: &str) -> Result<RuleRow, ServiceError> {
        let rows = self.inner.handles.store.rules().await?;
        let found = rows.into_iter().find(|row| row.id == id);
        found.ok_or_else(|| ServiceError::UnknownRule { id: id.to_owned() })
    }

    /// Returns the row of a rule that is valid, and the names of the channels.
    async fn new_rule_row(
        &self,
        id: String,
        created_at: i64,
        rule: &NewRuleView,
    ) -> Result<(RuleRow, BTreeMap<String, String>), ServiceError> {
        settings::check_rule(rule)?;
        let names = self.channel_names().await?;
        if !names.contains_key(&rule.channel) {
            return Err(Invalid::new("/channel", "is not the id of a channel").into());
        }
        let (channel, document) = (rule.channel.clone(), views::to_json(rule)?);
        Ok((RuleRow { id, channel, document, created_at }, names))
    }

    /// Deletes a rule, with its reminders.
    ///
    /// # Errors
    /// [`ServiceError::UnknownRule`]; [`ServiceError::Changed`] if it is not the expected one.
    pub async fn delete_rule(&self, id: &str, expected: &Expected) -> Result<(), ServiceError> {
        let row = self.rule_row(id).await?;
        expected.check(Some(&rule_tag(&views::from_json(&row.document)?)?))?;
        let delete = NotificationWrite::DeleteRule { id: row.id.clone() };
        if !self.edit_notifications(expected, unchanged_rule(row), delete).await? {
            return Err(self.changed_rule(id).await);
        }
        Ok(())
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

fn changed(now: Result<EntityTag, ServiceError>) -> ServiceError {
    now.map_or_else(|error| error, |now| ServiceError::Changed { now: Some(now) })
}

fn unchanged_channel(row: ChannelRow) -> Expectation {
    Expectation::Channel { id: row.id, name: row.name, document: row.document }
}

fn unchanged_rule(row: RuleRow) -> Expectation {
    Expectation::Rule { id: row.id, document: row.document }
}

/// The kind of a channel, and URL and format of its webhook or the settings of its e-mail.
type ShownChannel = (ChannelKind, Option<(String, WebhookFormat)>, Option<EmailView>);

/// Returns the settings of a channel without its secrets.
fn shown(settings: StoredChannel) -> ShownChannel {
    let kind = settings.kind();
    match settings {
        StoredChannel::Webhook { url, format, .. } => (kind, Some((url, format)), None),
        StoredChannel::Email(email) => (kind, None, Some(settings::email_view(email))),
    }
}

/// Returns the tag of a channel's settings. A secret has no part in it: one that a change does not
/// give stays, so that no change overwrites it unseen.
fn channel_tag(row: &ChannelRow) -> Result<EntityTag, ServiceError> {
    EntityTag::of(&(&row.name, shown(stored(row)?)))
}

fn rule_tag(rule: &NewRuleView) -> Result<EntityTag, ServiceError> {
    EntityTag::of(rule)
}

fn rule_view(row: RuleRow, names: &BTreeMap<String, String>) -> Result<RuleView, ServiceError> {
    let rule: NewRuleView = views::from_json(&row.document)?;
    let channel_name = names.get(&rule.channel).cloned().unwrap_or_default();
    let (etag, created_at) = (rule_tag(&rule)?.to_string(), rfc3339(row.created_at));
    Ok(RuleView { id: row.id, etag, channel_name, created_at, rule })
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

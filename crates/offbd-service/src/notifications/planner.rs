//! Turns events into deliveries.

use std::collections::BTreeSet;

use serde_json::Value;
use uuid::Uuid;

use super::rules::{ActiveRule, AlarmEvent};
use super::{Context, NotificationTransport};
use crate::clock::rfc3339;
use crate::writing;
use crate::{NotificationSettings, ServiceError, views};
use offbd_store::{
    ChannelRow, DeliveryRow, Micros, NotificationWrite, PlannedEventRow, ReminderRow, TagsByAsset,
    Write,
};
use offbd_wire::advice;
use offbd_wire::notification::{NotificationDataView, NotificationView};
use offbd_wire::words::{AlarmCodeWord, DeliveryState};

/// Events read from the store per query.
const PAGE: u32 = 256;

/// Deliveries of a channel that are not finished; at the limit its further events wait in the
/// store.
const MAX_PENDING: i64 = 10_000;

/// The rules of each channel.
pub(super) type Rules = Vec<ActiveRule>;

impl<T: NotificationTransport> Context<T> {
    pub(super) async fn rules(&self) -> Result<Rules, ServiceError> {
        let rows = self.handles.store.rules().await?;
        let rule = |row: offbd_store::RuleRow| {
            Ok(ActiveRule::new(row.id, views::from_json(&row.document)?))
        };
        rows.into_iter().map(rule).collect()
    }

    /// Plans the deliveries of all events that the channel has not seen.
    pub(super) async fn plan(
        &self,
        channel: &ChannelRow,
        rules: &Rules,
    ) -> Result<(), ServiceError> {
        let store = &self.handles.store;
        let rules: Vec<_> = rules.iter().filter(|rule| rule.rule.channel == channel.id).collect();
        let mut position = channel.position;
        loop {
            let events = store.events_to_plan(position, PAGE).await?;
            let Some(last) = events.last() else { return Ok(()) };
            let pending = store.n_deliveries(&channel.id, DeliveryState::Pending.as_str()).await?;
            if pending >= MAX_PENDING {
                return Ok(());
            }
            position = last.id;
            let is_last = events.len() < PAGE as usize;
            if !self.handles.ownership.is_whole() {
                // Other nodes mute monitors too.
                self.mutes.load(store.mutes(self.handles.clock.now()).await?);
            }
            let tags = self.tags(&rules, &events).await?;
            self.handles.write_as_leader(self.planned(channel, &rules, &tags, events)).await?;
            if is_last {
                return Ok(());
            }
        }
    }

    /// Returns the tags of the assets of `events`; none if no rule asks for a tag.
    async fn tags(
        &self,
        rules: &[&ActiveRule],
        events: &[PlannedEventRow],
    ) -> Result<TagsByAsset, ServiceError> {
        if rules.iter().all(|rule| rule.rule.tag.is_none()) {
            return Ok(TagsByAsset::new());
        }
        let assets: BTreeSet<&str> = events.iter().map(|event| event.asset.as_str()).collect();
        Ok(self.handles.store.tags_of(assets).await?)
    }

    /// Returns the deliveries and reminders of events, with the new position of the channel.
    fn planned(
        &self,
        channel: &ChannelRow,
        rules: &[&ActiveRule],
        tags: &TagsByAsset,
        events: Vec<PlannedEventRow>,
    ) -> Vec<Write> {
        let now = self.handles.clock.now();
        let (position, mut deliveries) = (events.last().map(|event| event.id), Vec::new());
        let mut reminders = Vec::new();
        let mut events = events.into_iter().peekable();
        while let Some(row) = events.next() {
            let Ok(document) = serde_json::from_str::<Value>(&row.document) else { continue };
            let Some(event) = AlarmEvent::of(&document) else { continue };
            if events.peek().is_some_and(|next| is_named_by(&row, &document, next)) {
                continue;
            }
            let is_concerned = |rule: &&&ActiveRule| rule.concerns(&row.asset, event.code, tags);
            let concerned: Vec<_> = rules.iter().filter(is_concerned).collect();
            let is_muted = self.mutes.of(&row.asset, event.code, now).is_some();
            let told: Vec<_> = concerned.iter().filter(|rule| rule.tells(event.change)).collect();
            let message = || message(&self.settings, &row, event);
            if !is_muted && told.iter().any(|rule| rule.silence(now).is_none()) {
                deliveries.push(delivery(channel, (row.id, 0), &row.asset, &message(), now));
            }
            for rule in concerned {
                let told = !is_muted && rule.tells(event.change);
                reminders.extend(reminder(rule, &row, event, told, now, message));
            }
        }
        let plan = NotificationWrite::Plan { channel: channel.id.clone(), position, deliveries };
        std::iter::once(plan).chain(reminders).map(Write::Notification).collect()
    }
}

/// Returns whether `next` only adds the kind to the confirmed fault of `row`: both are one message.
fn is_named_by(row: &PlannedEventRow, document: &Value, next: &PlannedEventRow) -> bool {
    let Ok(named) = serde_json::from_str::<Value>(&next.document) else { return false };
    let is_same = |key: &str| document.get(key) == named.get(key);
    row.asset == next.asset
        && row.session == next.session
        && ["code", "status", "status_byte", "onset_s"].into_iter().all(is_same)
        && document.get("kind").is_none_or(Value::is_null)
        && named.get("kind").is_some_and(Value::is_string)
}

/// Returns the change of a rule's reminder that an event causes: a failure of which the rule
/// tells begins it, at the end of a silence; a test that does not fail ends it.
fn reminder(
    rule: &ActiveRule,
    row: &PlannedEventRow,
    event: AlarmEvent,
    told: bool,
    now: Micros,
    message: impl Fn() -> NotificationView,
) -> Option<NotificationWrite> {
    let repeat = rule.repeat()?;
    let (asset, code) = (row.asset.clone(), event.code.to_string());
    if !event.fails() {
        return Some(NotificationWrite::DeleteReminder { rule: rule.id.clone(), asset, code });
    }
    let due_at = rule.silence(now).unwrap_or(now + repeat);
    told.then(|| {
        NotificationWrite::PutReminder(ReminderRow {
            rule: rule.id.clone(),
            asset,
            code,
            event: row.id,
            n: 0,
            body: body(&message()),
            due_at,
        })
    })
}

/// Returns the message of an event. Its id depends only on the event.
fn message(
    settings: &NotificationSettings,
    row: &PlannedEventRow,
    event: AlarmEvent,
) -> NotificationView {
    let line = writing::line(&row.asset, row.session.as_deref(), &row.document);
    let line: Value = serde_json::from_str(&line).unwrap_or_default();
    let summary = line.get("summary").and_then(Value::as_str).unwrap_or_default();
    let base = settings.public_url.as_deref();
    let asset = &row.asset;
    let link = base.map(|base| match event.code {
        AlarmCodeWord::CommunicationLost => format!("{base}/rigs/{asset}"),
        code => format!("{base}/rigs/{asset}/faults/{code}"),
    });
    let advice = if event.fails() { advice::checks(event.code, event.kind) } else { &[] };
    NotificationView {
        specversion: "1.0".to_owned(),
        id: format!("evt_{}", row.id),
        source: format!("{}/api/v1/assets/{asset}", base.unwrap_or_default()),
        kind: format!("org.offbd.fault.{}.v1", event.change),
        subject: event.code.to_string(),
        time: rfc3339(row.at),
        datacontenttype: "application/json".to_owned(),
        data: NotificationDataView {
            asset: asset.clone(),
            summary: format!("{asset}: {summary}"),
            link,
            advice: advice.iter().map(|&check| check.to_owned()).collect(),
            event: line,
        },
    }
}

/// Returns the message of a test.
pub(crate) fn test_message(public_url: Option<&str>, now: Micros) -> NotificationView {
    NotificationView {
        specversion: "1.0".to_owned(),
        id: format!("test_{now}"),
        source: format!("{}/api/v1", public_url.unwrap_or_default()),
        kind: "org.offbd.test.v1".to_owned(),
        subject: "test".to_owned(),
        time: rfc3339(now),
        datacontenttype: "application/json".to_owned(),
        data: NotificationDataView {
            asset: String::new(),
            summary: "This is a test of a channel of offbd.".to_owned(),
            link: public_url.map(str::to_owned),
            advice: Vec::new(),
            event: Value::Null,
        },
    }
}

pub(super) fn body(message: &NotificationView) -> String {
    serde_json::to_string(message).unwrap_or_default()
}

/// Returns a delivery of `message`, due at once; `key` is the id of the event and the number
/// of the message.
pub(crate) fn delivery(
    channel: &ChannelRow,
    key: (i64, i64),
    asset: &str,
    message: &NotificationView,
    now: Micros,
) -> DeliveryRow {
    DeliveryRow {
        id: Uuid::now_v7().to_string(),
        channel: channel.id.clone(),
        event: key.0,
        n: key.1,
        asset: asset.to_owned(),
        message: message.id.clone(),
        state: DeliveryState::Pending.to_string(),
        body: body(message),
        attempts: 0,
        created_at: now,
        due_at: now,
        finished_at: None,
        error: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_confirmation_and_its_kind_are_one_message() {
        let document = |kind: Option<&str>, byte: &str| {
            json!({ "code": "x_servo", "status": "confirmed", "status_byte": byte,
                "onset_s": 1.5, "kind": kind })
        };
        let row = |asset: &str, document: Value| PlannedEventRow {
            id: 1,
            asset: asset.to_owned(),
            session: Some("s".to_owned()),
            at: 0,
            document: document.to_string(),
        };
        let unnamed = document(None, "2F");
        let is_named_by =
            |next: PlannedEventRow| is_named_by(&row("a", unnamed.clone()), &unnamed, &next);
        assert!(is_named_by(row("a", document(Some("dead"), "2F"))));
        assert!(!is_named_by(row("a", document(None, "2F"))), "no kind");
        assert!(!is_named_by(row("a", document(Some("dead"), "2E"))), "it passes again");
        assert!(!is_named_by(row("b", document(Some("dead"), "2F"))), "another rig");
    }
}

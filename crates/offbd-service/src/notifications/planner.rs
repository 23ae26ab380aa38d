//! Turns events into deliveries.

use std::collections::{BTreeMap, BTreeSet};

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
use offbd_wire::words::{AlarmChangeWord, AlarmCodeWord, DeliveryState};

/// Events read from the store per query.
const PAGE: u32 = 256;

/// Deliveries of a channel that are not finished; at the limit its further events wait in the
/// store.
const MAX_PENDING: i64 = 10_000;

/// Time for which the message of a fault that is confirmed waits for its kind, µs. Chosen: five kinds of
/// simulated servo faults came 0.3 to 3.1 s after the confirmation, and nobody acts sooner.
const KIND_WAIT: Micros = 5_000_000;

/// The number of a reminder whose first message has not been sent yet.
pub(super) const NOT_TOLD: i64 = -1;

/// When the first message of a delayed fault is due, by rule, asset and code.
type Waiting = BTreeMap<(String, String, String), Micros>;

/// The event of which each of some events is an update.
type Updates = BTreeMap<i64, i64>;

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
            let mut events = store.events_to_plan(position, PAGE).await?;
            let is_page = events.len() == PAGE as usize;
            events.truncate(n_ready(&events, self.handles.clock.now()));
            let Some(last) = events.last() else { return Ok(()) };
            let pending = store.n_deliveries(&channel.id, DeliveryState::Pending.as_str()).await?;
            if pending >= MAX_PENDING {
                return Ok(());
            }
            let before = std::mem::replace(&mut position, last.id);
            let is_last = !is_page || events.len() < PAGE as usize;
            if !self.handles.ownership.is_whole() {
                // Other nodes mute monitors too.
                self.mutes.load(store.mutes(self.handles.clock.now()).await?);
            }
            let tags = self.tags(&rules, &events).await?;
            let waiting = self.waiting(&rules).await?;
            let updates = self.updates(before, &events).await?;
            let planned = self.planned(channel, &rules, (&tags, &updates), waiting, events);
            self.handles.write_as_leader(planned).await?;
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

    /// Returns the faults whose first message is delayed.
    async fn waiting(&self, rules: &[&ActiveRule]) -> Result<Waiting, ServiceError> {
        if !rules.iter().any(|rule| rule.may_wait()) {
            return Ok(Waiting::new());
        }
        let rows = self.handles.store.reminders_at(NOT_TOLD).await?;
        Ok(rows.into_iter().map(|row| ((row.rule, row.asset, row.code), row.due_at)).collect())
    }

    /// Returns the events that add a kind to one up to the position `before`, which has its
    /// message already.
    async fn updates(
        &self,
        before: i64,
        events: &[PlannedEventRow],
    ) -> Result<Updates, ServiceError> {
        let mut updates = Updates::new();
        for row in events {
            let named = ConfirmedFault::of(row).filter(|fault| fault.is_named);
            let (Some(named), Some(session)) = (named, &row.session) else { continue };
            let (asset, code, mut at) = (&row.asset, named.code.as_str(), row.id);
            while let Some(earlier) =
                self.handles.store.transition_before(asset, session, code, at).await?
                && ConfirmedFault::of(&earlier).is_some_and(|fault| fault.is_named_by(&named))
            {
                // Of several that wait for their message, the last one has it.
                at = earlier.id;
                if at <= before {
                    updates.insert(row.id, at);
                    break;
                }
            }
        }
        Ok(updates)
    }

    /// Returns the deliveries and reminders of events, with the new position of the channel.
    fn planned(
        &self,
        channel: &ChannelRow,
        rules: &[&ActiveRule],
        (tags, updates): (&TagsByAsset, &Updates),
        mut waiting: Waiting,
        events: Vec<PlannedEventRow>,
    ) -> Vec<Write> {
        let now = self.handles.clock.now();
        let (position, mut deliveries) = (events.last().map(|event| event.id), Vec::new());
        let mut reminders = Vec::new();
        for (i, row) in events.iter().enumerate() {
            let Ok(document) = serde_json::from_str::<Value>(&row.document) else { continue };
            let Some(event) = AlarmEvent::of(&document) else { continue };
            if is_named_later(row, &events[i + 1..]) {
                continue;
            }
            let is_concerned = |rule: &&&ActiveRule| rule.concerns(&row.asset, event.code, tags);
            let concerned: Vec<_> = rules.iter().filter(is_concerned).collect();
            let is_muted = self.mutes.of(&row.asset, event.code, now).is_some();
            let message = || message(&self.settings, row, event, updates.get(&row.id).copied());
            let mut is_told_now = false;
            for rule in concerned {
                let told = !is_muted && rule.tells(event.change);
                let key = (rule.id.clone(), row.asset.clone(), event.code.to_string());
                // The end of a fault without a message has no message either.
                let was_told = event.fails() || waiting.remove(&key).is_none();
                // A later kind or status does not begin the delay again.
                let due_at = rule.first_due(row.at, now).filter(|_| event.fails() && told);
                let due_at = due_at.map(|due_at| *waiting.entry(key).or_insert(due_at));
                is_told_now |= told && was_told && due_at.is_none() && rule.silence(now).is_none();
                reminders.extend(reminder(rule, row, event, told, (now, due_at), message));
            }
            if is_told_now {
                deliveries.push(delivery(channel, (row.id, 0), &row.asset, &message(), now));
            }
        }
        let plan = NotificationWrite::Plan { channel: channel.id.clone(), position, deliveries };
        std::iter::once(plan).chain(reminders).map(Write::Notification).collect()
    }
}

/// A fault that an event confirms.
struct ConfirmedFault {
    code: AlarmCodeWord,
    /// Session, status byte and onset.
    identity: (Option<String>, Value, Value),
    is_named: bool,
}

impl ConfirmedFault {
    fn of(row: &PlannedEventRow) -> Option<Self> {
        let mut document: Value = serde_json::from_str(&row.document).ok()?;
        let AlarmEvent { code, kind, change } = AlarmEvent::of(&document)?;
        let is_fault = code != AlarmCodeWord::CommunicationLost;
        (is_fault && change == AlarmChangeWord::Confirmed).then(|| Self {
            code,
            identity: (
                row.session.clone(),
                document["status_byte"].take(),
                document["onset_s"].take(),
            ),
            is_named: kind.is_some(),
        })
    }

    /// Whether `later`, of the same asset, only adds a kind to it, or is surer of its kind.
    fn is_named_by(&self, later: &Self) -> bool {
        self.code == later.code && self.identity == later.identity && later.is_named
    }
}

/// Returns whether one of the `later` events only adds a kind to the confirmed fault of `row`:
/// both are one message.
fn is_named_later(row: &PlannedEventRow, later: &[PlannedEventRow]) -> bool {
    let Some(fault) = ConfirmedFault::of(row) else { return false };
    later
        .iter()
        .filter(|next| next.asset == row.asset)
        .filter_map(ConfirmedFault::of)
        .any(|next| fault.is_named_by(&next))
}

/// Returns how many of the first events can be planned at `now`: those before the first that waits
/// for its kind.
fn n_ready(events: &[PlannedEventRow], now: Micros) -> usize {
    let waits = |(i, row): &(usize, &PlannedEventRow)| {
        (0..KIND_WAIT).contains(&(now - row.at))
            && ConfirmedFault::of(row).is_some_and(|fault| !fault.is_named)
            && !is_named_later(row, &events[i + 1..])
    };
    events.iter().enumerate().find(waits).map_or(events.len(), |(i, _)| i)
}

/// Returns the change of a rule's reminder that an event causes: a failure of which the rule
/// tells begins it, at the end of a silence; a test that does not fail ends it. The first message of
/// a delayed failure is sent at `due_at`.
fn reminder(
    rule: &ActiveRule,
    row: &PlannedEventRow,
    event: AlarmEvent,
    told: bool,
    (now, due_at): (Micros, Option<Micros>),
    message: impl Fn() -> NotificationView,
) -> Option<NotificationWrite> {
    if !rule.may_wait() && rule.repeat().is_none() {
        return None;
    }
    let (asset, code) = (row.asset.clone(), event.code.to_string());
    if !event.fails() {
        return Some(NotificationWrite::DeleteReminder { rule: rule.id.clone(), asset, code });
    }
    let silence = rule.silence(now);
    let (n, due_at) = match due_at {
        Some(due_at) => (NOT_TOLD, due_at.max(silence.unwrap_or(due_at))),
        None => (0, silence.unwrap_or(now + rule.repeat()?)),
    };
    told.then(|| {
        NotificationWrite::PutReminder(ReminderRow {
            rule: rule.id.clone(),
            asset,
            code,
            event: row.id,
            n,
            body: body(&message()),
            due_at,
        })
    })
}

/// Returns the message of an event, which may be an update of an earlier one. Its id depends only on
/// the event.
fn message(
    settings: &NotificationSettings,
    row: &PlannedEventRow,
    event: AlarmEvent,
    updates: Option<i64>,
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
    let change = if updates.is_some() { "updated" } else { event.change.as_str() };
    NotificationView {
        specversion: "1.0".to_owned(),
        id: format!("evt_{}", row.id),
        source: format!("{}/api/v1/assets/{asset}", base.unwrap_or_default()),
        kind: format!("org.offbd.fault.{change}.v1"),
        subject: event.code.to_string(),
        time: rfc3339(row.at),
        datacontenttype: "application/json".to_owned(),
        data: NotificationDataView {
            asset: asset.clone(),
            summary: format!("{asset}: {summary}"),
            link,
            advice: advice.iter().map(|&check| check.to_owned()).collect(),
            updates: updates.map(|id| format!("evt_{id}")),
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
            updates: None,
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

    fn row(id: i64, asset: &str, kind: Option<&str>, byte: &str) -> PlannedEventRow {
        let document = json!({ "code": "x_servo", "status": "confirmed", "status_byte": byte,
            "onset_s": 1.5, "kind": kind });
        PlannedEventRow {
            id,
            asset: asset.to_owned(),
            session: Some("s".to_owned()),
            at: id * 1_000_000,
            document: document.to_string(),
        }
    }

    #[test]
    fn a_confirmation_and_its_kind_are_one_message() {
        let is_named = |later: PlannedEventRow| {
            is_named_later(&row(1, "a", None, "2F"), &[row(2, "b", None, "2F"), later])
        };
        assert!(is_named(row(3, "a", Some("dead"), "2F")));
        assert!(!is_named(row(3, "a", None, "2F")), "no kind");
        assert!(!is_named(row(3, "a", Some("dead"), "2E")), "it passes again");
        assert!(!is_named(row(3, "b", Some("dead"), "2F")), "another rig");
    }

    #[test]
    fn a_confirmation_waits_for_its_kind_but_not_for_long() {
        let unnamed = row(5, "a", None, "2F");
        let events = [row(4, "b", Some("dead"), "2F"), unnamed, row(6, "c", Some("held"), "2F")];
        assert_eq!(n_ready(&events, 6_000_000), 1, "it may be named");
        assert_eq!(n_ready(&events, 10_000_000), 3, "it has waited");
        let named = [row(5, "a", None, "2F"), row(6, "a", Some("dead"), "2F")];
        assert_eq!(n_ready(&named, 6_000_000), 2, "it is named");
    }
}

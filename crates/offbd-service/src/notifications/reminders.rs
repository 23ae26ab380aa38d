//! Repeats the message of a fault that still fails and that nobody has acknowledged, and sends the
//! first message of one that has failed for the delay of its rule.

use super::planner::{NOT_TOLD, Rules, delivery};
use super::rules::ActiveRule;
use super::{Context, NotificationTransport, planner};
use crate::clock::rfc3339;
use crate::{ServiceError, views};
use offbd_store::{ChannelRow, Micros, NotificationWrite, ReminderRow, Write};
use offbd_wire::notification::NotificationView;
use offbd_wire::words::AlarmCodeWord;

/// Reminders that are handled in one turn; the others have their turn a second later.
const MAX_REMINDERS: u32 = 256;

/// Pause after which a first message that is due finds out whether its fault is still muted, µs.
/// Chosen.
const MUTED_PAUSE: Micros = 60_000_000;

impl<T: NotificationTransport> Context<T> {
    /// Handles the reminders that are due.
    pub(super) async fn remind(&self, rules: &Rules) -> Result<(), ServiceError> {
        let now = self.handles.clock.now();
        let due = self.handles.store.due_reminders(now, MAX_REMINDERS).await?;
        if due.is_empty() {
            return Ok(());
        }
        let channels = self.handles.store.channels().await?;
        for row in due {
            let rule = rules.iter().find(|rule| rule.id == row.rule);
            let channel = rule.and_then(|rule| channels.iter().find(|c| c.id == rule.rule.channel));
            let writes = self.reminded(row, rule.zip(channel), now).await?;
            self.handles.write_as_leader(writes).await?;
        }
        Ok(())
    }

    /// Returns what a reminder that is due at `now` causes.
    async fn reminded(
        &self,
        row: ReminderRow,
        found: Option<(&ActiveRule, &ChannelRow)>,
        now: Micros,
    ) -> Result<Vec<Write>, ServiceError> {
        let code: Option<AlarmCodeWord> = row.code.parse().ok();
        let is_first = row.n == NOT_TOLD;
        let pause = |rule: &ActiveRule| if is_first { Some(MUTED_PAUSE) } else { rule.repeat() };
        let wanted = found.and_then(|(rule, channel)| Some((rule, channel, pause(rule)?, code?)));
        let Some((rule, channel, pause, code)) = wanted else { return Ok(vec![end(row)]) };
        let tags = self.handles.store.tags_of([row.asset.as_str()]).await?;
        if !rule.concerns(&row.asset, code, &tags) || !self.is_open(&row.asset, code).await? {
            return Ok(vec![end(row)]);
        }
        let later = |due_at| ReminderRow { due_at, ..row.clone() };
        let put = |row| Write::Notification(NotificationWrite::PutReminder(row));
        if let Some(until) = rule.silence(now) {
            return Ok(vec![put(later(until))]);
        }
        if self.mutes.of(&row.asset, code, now).is_some() {
            return Ok(vec![put(later(now + pause))]);
        }
        let first: NotificationView = views::from_json(&row.body)?;
        let n = row.n + 1;
        let message = if is_first { first.clone() } else { first.reminder(n, rfc3339(now)) };
        let deliveries = vec![delivery(channel, (row.event, n), &row.asset, &message, now)];
        let plan =
            NotificationWrite::Plan { channel: channel.id.clone(), position: None, deliveries };
        let next = match rule.repeat() {
            Some(repeat) => {
                put(ReminderRow { n, due_at: now + repeat, body: planner::body(&first), ..row })
            }
            None => end(row),
        };
        Ok(vec![Write::Notification(plan), next])
    }

    /// Whether the fault fails and nobody has acknowledged it.
    async fn is_open(&self, asset: &str, code: AlarmCodeWord) -> Result<bool, ServiceError> {
        let store = &self.handles.store;
        let Some(fault) = code.fault_code() else {
            let lost = store.lost_communications(Some(asset)).await?;
            return Ok(lost.first().is_some_and(|row| row.acknowledged_at.is_none()));
        };
        let Some(row) = store.fault(asset, fault.as_str()).await? else { return Ok(false) };
        let record = views::fault(row)?.record;
        Ok(record.status_bits.test_failed && !record.acknowledged)
    }
}

fn end(row: ReminderRow) -> Write {
    let ReminderRow { rule, asset, code, .. } = row;
    Write::Notification(NotificationWrite::DeleteReminder { rule, asset, code })
}

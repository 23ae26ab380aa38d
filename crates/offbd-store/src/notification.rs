//! Tables of channels, rules, deliveries and reminders.

use std::fmt;

use sqlx::AnyConnection;

use super::execute::execute;
use super::from_row::from_row;
use super::query_builder::QueryBuilder;
use super::{Micros, Store, StoreError};

/// Where notifications go.
#[derive(Clone, PartialEq, Eq)]
pub struct ChannelRow {
    pub id: String,
    pub name: String,
    /// The settings, with their secrets (JSON).
    pub document: String,
    /// Id of the last event of which the deliveries are planned.
    pub position: i64,
    pub created_at: Micros,
}

from_row!(ChannelRow { id, name, document, position, created_at });

/// Without the settings, which contain secrets.
impl fmt::Debug for ChannelRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { id, name, position, .. } = self;
        write!(f, "ChannelRow({id}, {name}, after event {position})")
    }
}

/// Which changes are sent to a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RuleRow {
    pub id: String,
    pub channel: String,
    pub document: String,
    pub created_at: Micros,
}

from_row!(RuleRow { id, channel, document, created_at });

/// A message to a channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeliveryRow {
    pub id: String,
    pub channel: String,
    /// Id of the event; 0 for a test.
    pub event: i64,
    /// 0 for the event itself, from 1 on for its reminders.
    pub n: i64,
    pub asset: String,
    /// Id of the message, the same in every attempt.
    pub message: String,
    pub state: String,
    pub body: String,
    pub attempts: i64,
    pub created_at: Micros,
    pub due_at: Micros,
    pub finished_at: Option<Micros>,
    pub error: Option<String>,
}

from_row!(DeliveryRow {
    id,
    channel,
    event,
    n,
    asset,
    message,
    state,
    body,
    attempts,
    created_at,
    due_at,
    finished_at,
    error
});

/// A fault of which a rule reminds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReminderRow {
    pub rule: String,
    pub asset: String,
    pub code: String,
    pub event: i64,
    /// Number of the last message of the event.
    pub n: i64,
    pub body: String,
    pub due_at: Micros,
}

from_row!(ReminderRow { rule, asset, code, event, n, body, due_at });

/// An event, of which deliveries are to be planned.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlannedEventRow {
    pub id: i64,
    pub asset: String,
    pub session: Option<String>,
    pub at: Micros,
    pub document: String,
}

from_row!(PlannedEventRow { id, asset, session, at, document });

/// Finished deliveries that are kept for each channel; the oldest are deleted.
const MAX_FINISHED: i64 = 1000;

/// A change of channels, rules, deliveries or reminders.
#[derive(Clone, Debug)]
pub enum NotificationWrite {
    /// Creates a channel, which starts after the latest event.
    CreateChannel(ChannelRow),
    UpdateChannel {
        id: String,
        name: String,
        document: String,
    },
    /// Deletes a channel. It is a conflict if a rule uses it.
    DeleteChannel {
        id: String,
    },
    PutRule(RuleRow),
    DeleteRule {
        id: String,
    },
    /// Adds deliveries to a channel and, if `position` is given, moves the channel to this
    /// event. Nothing happens if the channel has been deleted, and a delivery that exists
    /// already is not added again.
    Plan {
        channel: String,
        position: Option<i64>,
        deliveries: Vec<DeliveryRow>,
    },
    PutReminder(ReminderRow),
    DeleteReminder {
        rule: String,
        asset: String,
        code: String,
    },
    /// Stores the outcome of an attempt.
    Attempted(DeliveryRow),
}

impl NotificationWrite {
    pub(super) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        match self {
            Self::CreateChannel(row) => create_channel(db, row).await,
            Self::UpdateChannel { id, name, document } => {
                execute!(
                    db, "UPDATE channel SET name = $2, document = $3 WHERE id = $1";
                    id, name, document
                )
            }
            Self::DeleteChannel { id } => delete(db, "DELETE FROM channel WHERE id = $1", id).await,
            Self::PutRule(row) => put_rule(db, row).await,
            Self::DeleteRule { id } => delete(db, "DELETE FROM rule WHERE id = $1", id).await,
            Self::Plan { channel, position, deliveries } => {
                plan(db, channel, *position, deliveries).await
            }
            Self::PutReminder(row) => put_reminder(db, row).await,
            Self::DeleteReminder { rule, asset, code } => {
                execute!(
                    db, "DELETE FROM reminder WHERE rule = $1 AND asset = $2 AND code = $3";
                    rule, asset, code
                )
            }
            Self::Attempted(row) => attempted(db, row).await,
        }
    }
}

async fn delete(db: &mut AnyConnection, sql: &'static str, id: &str) -> Result<(), StoreError> {
    execute!(db, sql; id)
}

async fn create_channel(db: &mut AnyConnection, row: &ChannelRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO channel (id, name, document, position, created_at)
         SELECT $1, $2, $3, value, $4 FROM counter WHERE name = 'event'";
        &row.id, &row.name, &row.document, row.created_at
    )
}

async fn put_rule(db: &mut AnyConnection, row: &RuleRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO rule (id, channel, document, created_at) VALUES ($1, $2, $3, $4)
         ON CONFLICT (id) DO UPDATE SET channel = excluded.channel,
         document = excluded.document";
        &row.id, &row.channel, &row.document, row.created_at
    )
}

async fn plan(
    db: &mut AnyConnection,
    channel: &str,
    position: Option<i64>,
    deliveries: &[DeliveryRow],
) -> Result<(), StoreError> {
    let moved = sqlx::query(
        "UPDATE channel SET position = CASE WHEN position < $2 THEN $2 ELSE position END
         WHERE id = $1",
    )
    .bind(channel)
    .bind(position.unwrap_or_default())
    .execute(&mut *db)
    .await?;
    if moved.rows_affected() == 0 {
        return Ok(());
    }
    for row in deliveries {
        insert_delivery(db, row).await?;
    }
    Ok(())
}

async fn insert_delivery(db: &mut AnyConnection, row: &DeliveryRow) -> Result<(), StoreError> {
    execute!(
        db, "INSERT INTO delivery (id, channel, event, n, asset, message, state, body, attempts,
         created_at, due_at) VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11)
         ON CONFLICT (channel, event, n) DO NOTHING";
        &row.id, &row.channel, row.event, row.n, &row.asset, &row.message, &row.state, &row.body,
        row.attempts, row.created_at, row.due_at
    )
}

async fn put_reminder(db: &mut AnyConnection, row: &ReminderRow) -> Result<(), StoreError> {
    // Rule and asset may have been deleted meanwhile.
    execute!(
        db, "INSERT INTO reminder (rule, asset, code, event, n, body, due_at)
         SELECT rule.id, asset.name, $3, $4, $5, $6, $7 FROM rule, asset
         WHERE rule.id = $1 AND asset.name = $2
         ON CONFLICT (rule, asset, code) DO UPDATE SET event = excluded.event, n = excluded.n,
         body = excluded.body, due_at = excluded.due_at";
        &row.rule, &row.asset, &row.code, row.event, row.n, &row.body, row.due_at
    )
}

async fn attempted(db: &mut AnyConnection, row: &DeliveryRow) -> Result<(), StoreError> {
    execute!(
        &mut *db, "UPDATE delivery SET state = $2, attempts = $3, due_at = $4, finished_at = $5,
         error = $6
         WHERE id = $1";
        &row.id, &row.state, row.attempts, row.due_at, row.finished_at, &row.error
    )?;
    if row.finished_at.is_some() {
        execute!(
            db, "DELETE FROM delivery WHERE channel = $1 AND state = $2 AND id <=
             (SELECT id FROM delivery WHERE channel = $1 AND state = $2
              ORDER BY id DESC LIMIT 1 OFFSET $3)";
            &row.channel, &row.state, MAX_FINISHED
        )?;
    }
    Ok(())
}

impl Store {
    /// The channels, by name.
    ///
    /// # Errors
    /// [`StoreError`] if the database fails; so do all queries here.
    pub async fn channels(&self) -> Result<Vec<ChannelRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM channel ORDER BY name").fetch_all(&self.pool).await?)
    }

    /// The rules, in the order of their creation.
    pub async fn rules(&self) -> Result<Vec<RuleRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM rule ORDER BY id").fetch_all(&self.pool).await?)
    }

    /// The number of deliveries of a channel in `state`.
    pub async fn n_deliveries(&self, channel: &str, state: &str) -> Result<i64, StoreError> {
        let sql = "SELECT COUNT(*) FROM delivery WHERE channel = $1 AND state = $2";
        Ok(sqlx::query_scalar(sql).bind(channel).bind(state).fetch_one(&self.pool).await?)
    }

    /// Events with an id above `after`, with their times.
    pub async fn events_to_plan(
        &self,
        after: i64,
        limit: u32,
    ) -> Result<Vec<PlannedEventRow>, StoreError> {
        let mut query = QueryBuilder::new("");
        for select in [
            "SELECT id, asset, session, at, document FROM transition WHERE id > ",
            " UNION ALL SELECT id, asset, session, at, event FROM action
             WHERE event IS NOT NULL AND id > ",
            " UNION ALL SELECT id, asset, session, at, document FROM communication_change
             WHERE id > ",
        ] {
            query.push(select).bind(after)?;
        }
        query.push(" ORDER BY id LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }

    /// The last transition of a code in a session before the event `before`.
    ///
    /// # Errors
    /// [`StoreError`] if the store cannot be read.
    pub async fn transition_before(
        &self,
        asset: &str,
        session: &str,
        code: &str,
        before: i64,
    ) -> Result<Option<PlannedEventRow>, StoreError> {
        let sql = "SELECT id, asset, session, at, document FROM transition
             WHERE asset = $1 AND session = $2 AND code = $3 AND id < $4 ORDER BY id DESC LIMIT 1";
        let query = sqlx::query_as(sql).bind(asset).bind(session).bind(code).bind(before);
        Ok(query.fetch_optional(&self.pool).await?)
    }

    /// The deliveries of a channel whose turn has come at `now`: of each asset the first that
    /// is pending, if it is due.
    pub async fn due_deliveries(
        &self,
        channel: &str,
        now: Micros,
        limit: u32,
    ) -> Result<Vec<DeliveryRow>, StoreError> {
        Ok(sqlx::query_as(
            "SELECT * FROM delivery WHERE channel = $1 AND state = 'pending' AND due_at <= $2
             AND NOT EXISTS (SELECT 1 FROM delivery earlier
                 WHERE earlier.channel = $1 AND earlier.state = 'pending'
                 AND earlier.asset = delivery.asset
                 AND (earlier.event, earlier.n) < (delivery.event, delivery.n))
             ORDER BY event, n LIMIT $3",
        )
        .bind(channel)
        .bind(now)
        .bind(i64::from(limit))
        .fetch_all(&self.pool)
        .await?)
    }

    /// The reminders with the number `n`.
    pub async fn reminders_at(&self, n: i64) -> Result<Vec<ReminderRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM reminder WHERE n = $1")
            .bind(n)
            .fetch_all(&self.pool)
            .await?)
    }

    /// The reminders that are due at `now`.
    pub async fn due_reminders(
        &self,
        now: Micros,
        limit: u32,
    ) -> Result<Vec<ReminderRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM reminder WHERE due_at <= $1 ORDER BY due_at LIMIT $2")
            .bind(now)
            .bind(i64::from(limit))
            .fetch_all(&self.pool)
            .await?)
    }

    /// The delivery `id`.
    pub async fn delivery(&self, id: &str) -> Result<Option<DeliveryRow>, StoreError> {
        Ok(sqlx::query_as("SELECT * FROM delivery WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.pool)
            .await?)
    }

    /// Deliveries with an id below `before`, the latest first.
    pub async fn deliveries(
        &self,
        channel: Option<&str>,
        state: Option<&str>,
        before: &str,
        limit: u32,
    ) -> Result<Vec<DeliveryRow>, StoreError> {
        let mut query = QueryBuilder::new("SELECT * FROM delivery WHERE id < ");
        query.bind(before)?;
        if let Some(channel) = channel {
            query.push(" AND channel = ").bind(channel)?;
        }
        if let Some(state) = state {
            query.push(" AND state = ").bind(state)?;
        }
        query.push(" ORDER BY id DESC LIMIT ").bind(i64::from(limit))?;
        Ok(query.rows().fetch_all(&self.pool).await?)
    }
}

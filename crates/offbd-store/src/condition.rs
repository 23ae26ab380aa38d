//! Changes that are made only if what they replace is still as it was read.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use sqlx::AnyConnection;

use super::alarm::{AlarmWrite, NoteRow};
use super::notification::NotificationWrite;
use super::{StoreError, tag};

/// What must still be stored when a change is made.
#[derive(Clone, Debug)]
pub enum Expectation {
    Rule {
        id: String,
        document: String,
    },
    Channel {
        id: String,
        name: String,
        document: String,
    },
    /// The tags of an asset, in alphabetical order.
    Tags {
        asset: String,
        tags: Vec<String>,
    },
    /// The owner's note on a fault code; `None` if there is none.
    Note {
        code: String,
        found: Option<NoteRow>,
    },
}

/// A change that may have a condition.
#[derive(Clone, Debug)]
pub enum EditWrite {
    Notification(NotificationWrite),
    Alarm(AlarmWrite),
    /// Replaces the tags of an asset.
    Tags {
        asset: String,
        tags: Vec<String>,
    },
}

/// A change that is made only if what it replaces is still as it was read. Both happen in one
/// transaction, in which no other writer changes it.
#[derive(Clone, Debug)]
pub struct ConditionalWrite {
    pub expected: Expectation,
    pub edit: EditWrite,
    refused: Arc<AtomicBool>,
}

impl ConditionalWrite {
    /// Returns the change, and what tells after the commit whether it was refused.
    #[must_use]
    pub fn new(expected: Expectation, edit: EditWrite) -> (Self, Refusal) {
        let refused = Arc::default();
        let refusal = Refusal(Arc::clone(&refused));
        (Self { expected, edit, refused }, refusal)
    }

    pub(super) async fn apply(&self, db: &mut AnyConnection) -> Result<(), StoreError> {
        let is_unchanged = self.expected.holds(db).await?;
        // Also when it holds: the transaction may be a second attempt.
        self.refused.store(!is_unchanged, Ordering::SeqCst);
        match &self.edit {
            _ if !is_unchanged => Ok(()),
            EditWrite::Notification(write) => write.apply(db).await,
            EditWrite::Alarm(write) => write.apply(db).await,
            EditWrite::Tags { asset, tags } => tag::put(db, asset, tags).await,
        }
    }
}

/// Whether a [`ConditionalWrite`] was refused.
#[derive(Debug)]
pub struct Refusal(Arc<AtomicBool>);

impl Refusal {
    /// Returns whether the change was not made. Known once its transaction is committed.
    #[must_use]
    pub fn is_refused(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

impl Expectation {
    /// Returns whether it is stored now, and locks the row against the writers of other nodes
    /// until the end of the transaction. The tags of an asset have one writer at a time.
    async fn holds(&self, db: &mut AnyConnection) -> Result<bool, StoreError> {
        let update = match self {
            Self::Rule { id, document } => {
                sqlx::query("UPDATE rule SET document = document WHERE id = $1 AND document = $2")
                    .bind(id)
                    .bind(document)
            }
            Self::Channel { id, name, document } => sqlx::query(
                "UPDATE channel SET document = document
                 WHERE id = $1 AND document = $2 AND name = $3",
            )
            .bind(id)
            .bind(document)
            .bind(name),
            Self::Note { found: Some(row), .. } => sqlx::query(
                "UPDATE note SET text = text
                 WHERE code = $1 AND text = $2 AND actor = $3 AND at = $4",
            )
            .bind(&row.code)
            .bind(&row.text)
            .bind(&row.actor)
            .bind(row.at),
            // The change replaces this row, or removes it. No other node can insert one meanwhile.
            Self::Note { code, found: None } => sqlx::query(
                "INSERT INTO note (code, text, actor, at) VALUES ($1, '', '', 0)
                 ON CONFLICT (code) DO NOTHING",
            )
            .bind(code),
            Self::Tags { asset, tags } => return Ok(tag::of(db, asset).await? == *tags),
        };
        Ok(update.execute(db).await?.rows_affected() > 0)
    }
}

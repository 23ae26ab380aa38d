//! The mutes in force, in memory beside the store, because every state of a rig shows them.
//!
//! A mute changes what people are told, not what is recorded: the monitor goes on, the fault
//! memory and the history keep what it finds, and a recording gets the same verdict. While a
//! mute lasts, the code is shown as not tested and no notification of it is sent. It ends by
//! itself.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::clock::rfc3339;
use super::{EntityTag, ServiceError};
use offbd_store::{Micros, MuteRow};
use offbd_wire::alarm::MuteView;
use offbd_wire::words::AlarmCodeWord;

/// The mutes by asset and code; at most one for each code of each asset, so that the number
/// of assets bounds them.
#[derive(Clone, Debug, Default)]
pub(super) struct Mutes {
    by_asset: Arc<Mutex<BTreeMap<String, BTreeMap<AlarmCodeWord, MuteRow>>>>,
    /// Held while a mute is changed in the store and here, so that both agree.
    changing: Arc<tokio::sync::Mutex<()>>,
}

impl Mutes {
    /// Waits until nobody else changes a mute.
    pub(super) async fn begin_change(&self) -> tokio::sync::MutexGuard<'_, ()> {
        self.changing.lock().await
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, BTreeMap<AlarmCodeWord, MuteRow>>> {
        self.by_asset.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds the rows of the store; one with a code that this version does not know is left
    /// out.
    pub(super) fn load(&self, rows: Vec<MuteRow>) {
        for row in rows {
            if let Ok(code) = row.code.parse() {
                self.set(code, row);
            }
        }
    }

    pub(super) fn set(&self, code: AlarmCodeWord, row: MuteRow) {
        self.lock().entry(row.asset.clone()).or_default().insert(code, row);
    }

    pub(super) fn remove(&self, asset: &str, code: AlarmCodeWord) {
        if let Some(codes) = self.lock().get_mut(asset) {
            codes.remove(&code);
        }
    }

    pub(super) fn remove_asset(&self, asset: &str) {
        self.lock().remove(asset);
    }

    /// Returns the mute of `code` of `asset` that is in force at `now`.
    pub(super) fn of(&self, asset: &str, code: AlarmCodeWord, now: Micros) -> Option<MuteView> {
        let all = self.lock();
        let row = all.get(asset)?.get(&code)?;
        (row.until > now).then(|| view(code, row))
    }

    /// Returns the entity tag of the mute of `code` of `asset` that is in force at `now`.
    pub(super) fn tag_of(
        &self,
        asset: &str,
        code: AlarmCodeWord,
        now: Micros,
    ) -> Result<Option<EntityTag>, ServiceError> {
        let all = self.lock();
        let row = all.get(asset).and_then(|codes| codes.get(&code));
        row.filter(|row| row.until > now).map(tag).transpose()
    }

    /// Returns the mutes of `asset` that are in force at `now`, in the order of their codes.
    pub(super) fn of_asset(&self, asset: &str, now: Micros) -> Vec<MuteView> {
        let mut all = self.lock();
        let Some(codes) = all.get_mut(asset) else { return Vec::new() };
        codes.retain(|_, row| row.until > now);
        codes.iter().map(|(code, row)| view(*code, row)).collect()
    }
}

fn view(code: AlarmCodeWord, row: &MuteRow) -> MuteView {
    MuteView {
        etag: tag(row).map_or_else(|_| String::new(), |tag| tag.to_string()),
        asset: row.asset.clone(),
        code,
        by: row.actor.clone(),
        reason: row.reason.clone(),
        at: rfc3339(row.at),
        until: rfc3339(row.until),
    }
}

fn tag(row: &MuteRow) -> Result<EntityTag, ServiceError> {
    EntityTag::of(&(&row.actor, &row.reason, row.at, row.until))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mute_ends_by_itself() {
        let mutes = Mutes::default();
        let row = |code: &str, until| MuteRow {
            asset: "a".into(),
            code: code.into(),
            actor: "ann".into(),
            reason: "new horn".into(),
            at: 0,
            until,
        };
        mutes.load(vec![row("x_servo", 10), row("sensor", 20), row("from_the_future", 20)]);
        assert_eq!(mutes.of_asset("a", 5).len(), 2);
        assert_eq!(mutes.of("a", AlarmCodeWord::XServo, 9).unwrap().by, "ann");
        assert_eq!(mutes.of("a", AlarmCodeWord::XServo, 10), None);
        assert_eq!(mutes.of("b", AlarmCodeWord::XServo, 9), None);
        assert_eq!(mutes.of_asset("a", 10).len(), 1);
        mutes.remove("a", AlarmCodeWord::Sensor);
        assert_eq!(mutes.of_asset("a", 10), []);
    }
}

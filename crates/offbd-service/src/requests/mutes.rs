//! Mutes of monitors.

use crate::clock::{parse_timestamp, rfc3339};
use crate::{Expected, Service, ServiceError};
use offbd_core::vocabulary::Invalid;
use offbd_store::{AlarmWrite, MuteRow, Write};
use offbd_wire::alarm::{MuteView, NewMuteView};
use offbd_wire::service::{MonitorView, StateView};
use offbd_wire::words::AlarmCodeWord;

/// Longest reason of a mute, bytes; a longer one is refused.
const MAX_MUTE_REASON: usize = 200;

/// Longest mute, µs: a year. A longer one is refused.
const MAX_MUTE: i64 = 366 * 86_400 * 1_000_000;

pub(super) fn alarm_code(word: &str) -> Result<AlarmCodeWord, ServiceError> {
    word.parse().map_err(ServiceError::UnknownCode)
}

impl Service {
    /// Mutes a monitor of an asset, or changes its mute.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`]; [`ServiceError::UnknownCode`];
    /// [`ServiceError::Invalid`] with the invalid element;
    /// [`ServiceError::Changed`] if the present mute is not the expected one.
    pub async fn mute(
        &self,
        asset: &str,
        word: &str,
        new: NewMuteView,
        actor: String,
        expected: &Expected,
    ) -> Result<MuteView, ServiceError> {
        let code = alarm_code(word)?;
        self.check_known(asset).await?;
        let now = self.inner.handles.clock.now();
        let NewMuteView { reason, until } = new;
        let is_permitted = (1..=MAX_MUTE_REASON).contains(&reason.len());
        if !is_permitted || reason.chars().any(char::is_control) {
            let must = format!("must be 1 to {MAX_MUTE_REASON} bytes without control characters");
            return Err(Invalid::new("/reason", must).into());
        }
        let until = parse_timestamp(&until).map_err(|error| Invalid::new("/until", error))?;
        if !(now + 1..=now + MAX_MUTE).contains(&until) {
            let must = format!("must be after {} and within a year", rfc3339(now));
            return Err(Invalid::new("/until", must).into());
        }
        let _changing = self.inner.mutes.begin_change().await;
        expected.check(self.inner.mutes.tag_of(asset, code, now)?.as_ref())?;
        let (asset, code_word) = (asset.to_owned(), code.to_string());
        let row = MuteRow { asset, code: code_word, actor, reason, at: now, until };
        let write = Write::Alarm(AlarmWrite::Mute(row.clone()));
        self.inner.handles.write(&row.asset, vec![write]).await?;
        let asset = row.asset.clone();
        self.inner.mutes.set(code, row);
        let stopped = || ServiceError::Unavailable { what: "the mute has ended already" };
        self.inner.mutes.of(&asset, code, now).ok_or_else(stopped)
    }

    /// Ends the mute of a monitor; has no effect without one.
    ///
    /// # Errors
    /// As for [`Self::mute`].
    pub async fn unmute(
        &self,
        asset: &str,
        word: &str,
        expected: &Expected,
    ) -> Result<(), ServiceError> {
        let code = alarm_code(word)?;
        self.check_known(asset).await?;
        let _changing = self.inner.mutes.begin_change().await;
        let now = self.inner.handles.clock.now();
        expected.check(self.inner.mutes.tag_of(asset, code, now)?.as_ref())?;
        let write = AlarmWrite::Unmute { asset: asset.to_owned(), code: code.to_string() };
        self.inner.handles.write(asset, vec![Write::Alarm(write)]).await?;
        self.inner.mutes.remove(asset, code);
        Ok(())
    }

    /// Returns the mutes of an asset that are in force.
    ///
    /// # Errors
    /// [`ServiceError::UnknownAsset`].
    pub async fn mutes(&self, asset: &str) -> Result<Vec<MuteView>, ServiceError> {
        self.check_known(asset).await?;
        Ok(self.mutes_of(asset))
    }

    /// The mutes of an asset that are in force now.
    pub(super) fn mutes_of(&self, asset: &str) -> Vec<MuteView> {
        self.inner.mutes.of_asset(asset, self.inner.handles.clock.now())
    }

    /// Shows the mutes of `asset` that are in force now at its monitors.
    pub(super) fn show_mutes(&self, asset: &str, monitors: &mut [MonitorView]) {
        let mutes = self.mutes_of(asset);
        for monitor in monitors {
            let code = AlarmCodeWord::from(monitor.code);
            monitor.muted = mutes.iter().find(|mute| mute.code == code).cloned().map(Box::new);
        }
    }

    /// Returns the state with the mutes of its asset that are in force now.
    #[must_use]
    pub fn with_mutes(&self, mut state: StateView) -> StateView {
        self.show_mutes(&state.asset, &mut state.monitors);
        state
    }
}

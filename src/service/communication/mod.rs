//! Finds rigs whose data stay away although their session is open. This is a condition of the
//! service, by its wall clock; no engine knows it, and no verdict depends on it.
//!
//! A rig is waited for while it has an open session with samples. A session that is ended, by
//! its device or a person, says that no more data are to come.

mod link;

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

pub use link::CommunicationSettings;

use self::link::{Link, LinkChange};
use super::asset::Presences;
use super::clock::rfc3339;
use super::notifications::micros;
use super::writing::Handles;
use super::{ServiceError, views};
use crate::store::{CommunicationChange, Micros, OpenLink, Write};
use crate::wire::alarm::CommunicationView;
use crate::wire::words::{AlarmChangeWord, AlarmCodeWord};

/// Interval between two looks.
const INTERVAL: Duration = Duration::from_secs(1);

/// Time between two looks from which on the clock has jumped or the process has slept, so that
/// rigs had no chance to be heard.
const JUMP: Duration = Duration::from_secs(10);

/// Looks for rigs whose data stay away.
pub(super) struct CommunicationWatch {
    handles: Handles,
    presences: Presences,
    settings: CommunicationSettings,
    links: BTreeMap<String, Link>,
    last_look: Option<Micros>,
}

impl CommunicationWatch {
    pub(super) const fn new(
        handles: Handles,
        presences: Presences,
        settings: CommunicationSettings,
    ) -> Self {
        Self { handles, presences, settings, links: BTreeMap::new(), last_look: None }
    }

    /// Looks every [`INTERVAL`] until the service shuts down.
    pub(super) async fn run(mut self) {
        let closing = self.handles.closing.clone();
        let forever = async {
            let mut ticks = tokio::time::interval(INTERVAL);
            ticks.set_missed_tick_behavior(tokio::time::MissedTickBehavior::Delay);
            loop {
                ticks.tick().await;
                if let Err(error) = self.look(self.handles.clock.now()).await {
                    tracing::warn!(%error, "cannot look for lost communication; tried again");
                }
            }
        };
        let _: Option<()> = closing.run_until_cancelled(forever).await;
    }

    /// Looks at all rigs at `now` and stores what has changed.
    async fn look(&mut self, now: Micros) -> Result<(), ServiceError> {
        let store = &self.handles.store;
        let open = store.open_links().await?;
        let lost = store.communications(None, None, true).await?;
        let was_lost: BTreeMap<_, _> = lost.into_iter().map(|row| (row.asset, row.since)).collect();
        self.wait_anew_after_jump(now);
        let mut changes = Vec::new();
        let ownership = &self.handles.ownership;
        for rig in open.iter().filter(|rig| ownership.owns(&rig.asset)) {
            let is_lost = was_lost.contains_key(&rig.asset);
            let arrival = self.presences.of(&rig.asset).map(|presence| presence.seen_at);
            let link =
                self.links.entry(rig.asset.clone()).or_insert_with(|| Link::new(now, is_lost));
            if let Some(change) = link.advance(now, arrival, &self.settings) {
                let since = was_lost.get(&rig.asset).copied().unwrap_or(link.seen_at);
                changes.push((rig.asset.clone(), changed(rig, change, since, now)?));
            }
        }
        let expected: BTreeSet<_> = open.iter().map(|rig| rig.asset.as_str()).collect();
        self.links.retain(|asset, _| expected.contains(asset.as_str()));
        for (asset, since) in
            was_lost.iter().filter(|(asset, _)| !expected.contains(asset.as_str()))
        {
            if ownership.owns(asset) {
                changes.push((asset.clone(), ended(asset, *since, now)?));
            }
        }
        let n_lost = self.links.values().filter(|link| link.is_lost()).count();
        metrics::gauge!("offbd_communication_lost").set(n_lost as f64);
        for (asset, change) in changes {
            if let Err(error) = self.handles.write(&asset, vec![change]).await {
                // Found again by the next look.
                self.links.clear();
                return Err(error);
            }
        }
        Ok(())
    }

    fn wait_anew_after_jump(&mut self, now: Micros) {
        let elapsed = self.last_look.map_or(0, |last| now - last);
        if !(0..micros(JUMP)).contains(&elapsed) {
            self.links.values_mut().for_each(|link| link.wait_from(now));
        }
        self.last_look = Some(now);
    }
}

/// Returns the change of a rig with an open session.
fn changed(
    rig: &OpenLink,
    change: LinkChange,
    since: Micros,
    now: Micros,
) -> Result<Write, ServiceError> {
    let last = rfc3339(since);
    let summary = match change {
        LinkChange::Lost => format!("no data arrive although a session is open; last heard {last}"),
        LinkChange::Back => format!("data arrive again; they had stayed away since {last}"),
    };
    let session = Some((rig.session.clone(), rig.session_name.clone()));
    write(&rig.asset, session, change == LinkChange::Lost, (since, now), summary)
}

/// Returns the change of a lost rig whose session has ended.
fn ended(asset: &str, since: Micros, now: Micros) -> Result<Write, ServiceError> {
    let summary = "the session has ended, so that no data are expected".to_owned();
    write(asset, None, false, (since, now), summary)
}

fn write(
    asset: &str,
    session: Option<(String, String)>,
    is_lost: bool,
    (since, at): (Micros, Micros),
    summary: String,
) -> Result<Write, ServiceError> {
    let (session, name) = session.unzip();
    let status = if is_lost { AlarmChangeWord::Confirmed } else { AlarmChangeWord::Passed };
    tracing::info!(asset, is_lost, "communication has changed");
    let document = views::to_json(&CommunicationView {
        line: "communication".to_owned(),
        session: name,
        code: AlarmCodeWord::CommunicationLost,
        status,
        since: rfc3339(since),
        summary,
    })?;
    let asset = asset.to_owned();
    Ok(Write::Communication(CommunicationChange {
        id: 0,
        asset,
        session,
        is_lost,
        since,
        at,
        document,
    }))
}

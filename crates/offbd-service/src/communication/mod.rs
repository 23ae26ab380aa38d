//! Finds rigs whose data stay away although their session is open. This is a condition of the
//! service, by its wall clock; no engine knows it, and no verdict depends on it.
//!
//! The service waits for a rig that has an open session with samples. A session that is ended, by
//! its device or a person, says that no more data are to come.

mod link;

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

pub use link::CommunicationSettings;

use self::link::{Link, LinkChange};
use super::asset::Presences;
use super::clock::rfc3339;
use super::notifications::micros;
use super::writing::Handles;
use super::{Reasons, ServiceError, views};
use offbd_store::{CommunicationChange, Micros, OpenLink, Write};
use offbd_wire::alarm::CommunicationView;
use offbd_wire::words::{AlarmChangeWord, AlarmCodeWord};

/// Shortest and longest pause between two looks. The shortest is half of the shortest silence
/// that can be configured; the longest is half of [`JUMP`].
const SHORTEST_PAUSE: Duration = Duration::from_millis(500);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// The pause after a look, as a multiple of its duration: with very many rigs, looking takes a
/// twentieth of the time of a core. Chosen.
const PAUSE_PER_LOOK: u32 = 20;

/// Changes that are stored in one transaction. Chosen: the samples of other rigs wait for it.
const CHANGES_AT_ONCE: usize = 64;

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

    /// Looks again and again until the service shuts down.
    #[expect(clippy::disallowed_methods, reason = "the duration of a look, not a time")]
    pub(super) async fn run(mut self) {
        let closing = self.handles.closing.clone();
        let reasons = Reasons::default();
        let forever = async {
            loop {
                let begun = Instant::now();
                let looked = self.look(self.handles.clock.now()).await;
                if let Some(error) = reasons.new_error(looked) {
                    tracing::warn!(%error, "cannot look for lost communication; trying again");
                }
                let pause = begun.elapsed().saturating_mul(PAUSE_PER_LOOK);
                tokio::time::sleep(pause.clamp(SHORTEST_PAUSE, LONGEST_PAUSE)).await;
            }
        };
        let _: Option<()> = closing.run_until_cancelled(forever).await;
    }

    /// Looks at all rigs at `now` and stores what has changed.
    async fn look(&mut self, now: Micros) -> Result<(), ServiceError> {
        let store = &self.handles.store;
        let open = store.open_links(self.handles.ownership.filter().as_deref()).await?;
        let lost = store.lost_communications(None).await?;
        let was_lost: BTreeMap<_, _> = lost.into_iter().map(|row| (row.asset, row.since)).collect();
        self.restart_waits_after_jump(now);
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
        let stored = self.store(changes).await;
        if stored.is_err() {
            // Found again by the next look.
            self.links.clear();
        }
        // A long look is not a jump of the clock.
        self.last_look = Some(self.handles.clock.now());
        stored
    }

    /// Stores the changes of some assets, several in one transaction.
    async fn store(&self, changes: Vec<(String, Write)>) -> Result<(), ServiceError> {
        let mut by_partition = BTreeMap::<_, Vec<_>>::new();
        for (asset, change) in changes {
            let partition = self.handles.ownership.partition_of(&asset);
            by_partition.entry(partition).or_default().push((asset, change));
        }
        for changes in by_partition.into_values() {
            for part in changes.chunks(CHANGES_AT_ONCE) {
                let writes = part.iter().map(|(_, change)| change.clone()).collect();
                self.handles.write(&part[0].0, writes).await?;
            }
        }
        Ok(())
    }

    fn restart_waits_after_jump(&mut self, now: Micros) {
        let elapsed = self.last_look.map_or(0, |last| now - last);
        if !(0..micros(JUMP)).contains(&elapsed) {
            self.links.values_mut().for_each(|link| link.wait_from(now));
        }
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

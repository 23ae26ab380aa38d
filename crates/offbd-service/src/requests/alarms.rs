//! The alarms of the fleet: faults on record, and lost communication.

use std::collections::{BTreeMap, BTreeSet};

use super::mutes::alarm_code;
use crate::clock::rfc3339;
use crate::{EntityTag, Expected, Service, ServiceError, views};
use offbd_core::vocabulary::Invalid;
use offbd_store::{
    AlarmWrite, CommunicationRow, EditWrite, Expectation, FaultFilter, FaultOrder, FaultRow,
    Micros, NoteRow, Write,
};
use offbd_wire::advice;
use offbd_wire::alarm::{
    AcknowledgeOutcomeView, AcknowledgeView, AcknowledgedView, AdviceListView, AlarmEvidenceView,
    AlarmKeyView, AlarmView, NewNoteView, NoteView,
};
use offbd_wire::provenance::ActView;
use offbd_wire::service::{FaultEntryView, Page};
use offbd_wire::verdict::kind_weight;
use offbd_wire::words::{AlarmCodeWord, AlarmStateFilter, EvidenceWord, StatusWord};

/// Alarms that one request acknowledges; a request with more is refused.
const MAX_ACKNOWLEDGED: usize = 500;

/// Longest note on a code, bytes; a longer one is refused.
const MAX_NOTE: usize = 2000;

/// Rows of faults that one request looks at; a page ends there, also with few alarms on it.
const MAX_LOOKED_AT: usize = 5000;

/// Rows of faults read per query.
const ROWS: u32 = 500;

/// The parameters of a query for alarms.
#[derive(Clone, Debug, Default)]
pub struct AlarmQuery {
    /// `active` by default.
    pub state: Option<AlarmStateFilter>,
    pub asset: Option<String>,
    pub code: Option<AlarmCodeWord>,
    pub acknowledged: Option<bool>,
    /// A tag of the asset.
    pub tag: Option<String>,
    /// Range of the last change.
    pub from: Option<Micros>,
    pub to: Option<Micros>,
    pub cursor: Option<String>,
}

/// Where a page of alarms continues: time of the last change, asset and code.
type AlarmKey = (Micros, String, String);

impl AlarmQuery {
    fn takes(&self, alarm: &AlarmView, changed_at: Micros) -> bool {
        let on_record = matches!(alarm.status, StatusWord::Pending | StatusWord::Confirmed);
        let in_state = match self.state.unwrap_or(AlarmStateFilter::Active) {
            AlarmStateFilter::Failing => alarm.failing && alarm.status == StatusWord::Confirmed,
            AlarmStateFilter::Suspected => alarm.failing && alarm.status == StatusWord::Pending,
            AlarmStateFilter::OnRecord => on_record && !alarm.failing,
            AlarmStateFilter::Active => on_record,
            AlarmStateFilter::All => alarm.status != StatusWord::Cleared,
        };
        in_state
            && self.code.is_none_or(|code| code == alarm.code)
            && self.acknowledged.is_none_or(|wanted| wanted == alarm.acknowledgement.is_some())
            && self.from.is_none_or(|from| changed_at >= from)
            && self.to.is_none_or(|to| changed_at <= to)
    }
}

impl Service {
    /// Returns a page of the alarms of the fleet, the latest change first.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] for an invalid cursor.
    pub async fn alarms(
        &self,
        query: AlarmQuery,
        limit: u32,
    ) -> Result<Page<AlarmView>, ServiceError> {
        let after: Option<AlarmKey> = query.cursor.as_deref().map(views::cursor).transpose()?;
        let lost = self.lost(&query, after.clone(), limit).await?;
        let (mut found, rest) = self.failures(&query, after, limit).await?;
        // Of lost communication what belongs to the same stretch of time as the faults.
        found.extend(lost.into_iter().filter(|(key, _)| rest.as_ref().is_none_or(|r| key > r)));
        found.sort_by(|(a, _), (b, _)| b.cmp(a));
        let limit = limit as usize;
        let next = match found.get(limit.saturating_sub(1)) {
            Some((key, _)) if found.len() > limit => Some(key.clone()),
            _ => rest,
        };
        found.truncate(limit);
        let items = found.into_iter().map(|(_, alarm)| alarm).collect();
        let mut page = Page { items, next: next.as_ref().map(views::to_cursor).transpose()? };
        self.add_sessions(&mut page.items).await?;
        Ok(page)
    }

    /// Returns the faults after the key `after` that `query` selects, at least `limit + 1` if
    /// there are as many; and the key of the last row that was looked at, if others follow.
    async fn failures(
        &self,
        query: &AlarmQuery,
        after: Option<AlarmKey>,
        limit: u32,
    ) -> Result<(Vec<(AlarmKey, AlarmView)>, Option<AlarmKey>), ServiceError> {
        let code = match query.code {
            Some(AlarmCodeWord::CommunicationLost) => return Ok((Vec::new(), None)),
            code => code.and_then(AlarmCodeWord::fault_code).map(|code| code.as_str()),
        };
        let order = FaultOrder::Newest;
        let mut filter = FaultFilter {
            asset: query.asset.clone(),
            tag: query.tag.clone(),
            code,
            order,
            after,
            ..FaultFilter::default()
        };
        let (mut found, mut n_looked_at) = (Vec::new(), 0);
        loop {
            let rows = self.inner.handles.store.faults(&filter, ROWS).await?;
            let is_last = rows.len() < ROWS as usize;
            n_looked_at += rows.len();
            for row in rows {
                let key = (row.changed_at, row.asset.clone(), row.code.clone());
                filter.after = Some(key.clone());
                let alarm = self.fault_alarm(row)?;
                if query.takes(&alarm, key.0) {
                    found.push((key, alarm));
                }
                if found.len() > limit as usize {
                    return Ok((found, filter.after));
                }
            }
            let passed = filter.after.as_ref().is_some_and(|(at, ..)| query.from > Some(*at));
            if is_last || passed {
                return Ok((found, None));
            }
            if n_looked_at >= MAX_LOOKED_AT {
                return Ok((found, filter.after));
            }
        }
    }

    /// Returns the lost communications after the key `after` that `query` selects, `limit + 1` if
    /// there are as many.
    async fn lost(
        &self,
        query: &AlarmQuery,
        mut after: Option<AlarmKey>,
        limit: u32,
    ) -> Result<Vec<(AlarmKey, AlarmView)>, ServiceError> {
        let (asset, tag) = (query.asset.as_deref(), query.tag.as_deref());
        let code = AlarmCodeWord::CommunicationLost;
        if query.code.is_some_and(|wanted| wanted != code) {
            return Ok(Vec::new());
        }
        let mut found = Vec::new();
        loop {
            let from = after.clone().map(|(changed_at, asset, _)| (changed_at, asset));
            let rows = self.inner.handles.store.communications(asset, tag, from, ROWS).await?;
            let is_last = rows.len() < ROWS as usize;
            for row in rows {
                let key = (row.changed_at, row.asset.clone(), code.to_string());
                if after.as_ref().is_some_and(|after| key >= *after) {
                    continue;
                }
                after = Some(key.clone());
                let alarm = self.communication_alarm(row);
                if query.takes(&alarm, key.0) {
                    found.push((key, alarm));
                }
                if found.len() > limit as usize {
                    return Ok(found);
                }
            }
            let passed = after.as_ref().is_some_and(|(at, ..)| query.from > Some(*at));
            if is_last || passed {
                return Ok(found);
            }
        }
    }

    fn muted(&self, asset: &str, code: AlarmCodeWord) -> Option<offbd_wire::alarm::MuteView> {
        self.inner.mutes.of(asset, code, self.inner.handles.clock.now())
    }

    fn fault_alarm(&self, row: FaultRow) -> Result<AlarmView, ServiceError> {
        let FaultEntryView { asset, changed_at, record, provenance, .. } = views::fault(row)?;
        let code = AlarmCodeWord::from(record.code);
        let last = provenance.last_occurrence;
        Ok(AlarmView {
            muted: self.muted(&asset, code),
            asset,
            code,
            kind: record.kind,
            kind_weight: kind_weight(record.kind, &record.candidates),
            status: record.status,
            failing: record.status_bits.test_failed,
            tested: !record.status_bits.test_not_completed_this_operation_cycle,
            // Looked up later, for the whole page at once.
            session_open: false,
            communication_lost_since: None,
            since: last.as_ref().map(|last| last.noted_at.clone()),
            changed_at,
            occurrences: record.occurrences,
            acknowledgement: provenance.acknowledgement.filter(|_| record.acknowledged),
            session_id: last.map(|last| last.session_id),
            // The recording is looked for later, for the whole page at once.
            evidence: AlarmEvidenceView {
                state: match record.freeze_frame {
                    Some(_) => EvidenceWord::Partial,
                    None => EvidenceWord::None,
                },
                reason: None,
            },
        })
    }

    fn communication_alarm(&self, row: CommunicationRow) -> AlarmView {
        let code = AlarmCodeWord::CommunicationLost;
        let is_lost = row.lost != 0;
        let acknowledged = row.acknowledged_by.zip(row.acknowledged_at);
        AlarmView {
            muted: self.muted(&row.asset, code),
            asset: row.asset,
            code,
            kind: None,
            kind_weight: None,
            status: if is_lost { StatusWord::Confirmed } else { StatusWord::Healed },
            failing: is_lost,
            tested: true,
            session_open: false,
            communication_lost_since: None,
            since: Some(rfc3339(row.since)),
            changed_at: rfc3339(row.changed_at),
            occurrences: u32::try_from(row.occurrences).unwrap_or(u32::MAX),
            acknowledgement: acknowledged.map(|(by, at)| ActView { by, at: rfc3339(at) }),
            session_id: row.session,
            evidence: AlarmEvidenceView { state: EvidenceWord::None, reason: None },
        }
    }

    /// Completes a page by what is stored of sessions: whether the recordings are there, which
    /// rigs have an open session, and of which no data arrive.
    async fn add_sessions(&self, alarms: &mut [AlarmView]) -> Result<(), ServiceError> {
        let store = &self.inner.handles.store;
        let ids: Vec<_> = alarms.iter().filter_map(|alarm| alarm.session_id.clone()).collect();
        let existing: BTreeSet<_> = store.existing_sessions(&ids).await?.into_iter().collect();
        let assets: BTreeSet<_> = alarms.iter().map(|alarm| alarm.asset.clone()).collect();
        let assets: Vec<_> = assets.into_iter().collect();
        let open: BTreeSet<_> = store.assets_with_session(&assets).await?.into_iter().collect();
        let lost: BTreeMap<_, _> = match (assets.first(), assets.last()) {
            (Some(first), Some(last)) => {
                store.lost_communications_of(first, last).await?.into_iter().collect()
            }
            _ => BTreeMap::new(),
        };
        for alarm in alarms {
            alarm.communication_lost_since = lost.get(&alarm.asset).copied().map(rfc3339);
            let is_there = alarm.session_id.as_ref().is_some_and(|id| existing.contains(id));
            alarm.evidence = evidence(alarm, is_there);
            alarm.session_open = open.contains(&alarm.asset);
        }
        Ok(())
    }

    /// Acknowledges alarms, each by itself: one that cannot be acknowledged does not keep the
    /// others from it.
    ///
    /// # Errors
    /// [`ServiceError::Invalid`] if there are none or too many.
    pub async fn acknowledge_all(
        &self,
        request: AcknowledgeView,
        actor: String,
    ) -> Result<AcknowledgedView, ServiceError> {
        let alarms = request.alarms;
        if !(1..=MAX_ACKNOWLEDGED).contains(&alarms.len()) {
            let reason = format!("must have 1 to {MAX_ACKNOWLEDGED} alarms");
            return Err(Invalid::new("/alarms", reason).into());
        }
        let mut items = Vec::new();
        for AlarmKeyView { asset, code } in alarms {
            let outcome = self.acknowledge_alarm(&asset, code, actor.clone()).await;
            let reason = outcome.err().map(|error| error.to_string());
            items.push(AcknowledgeOutcomeView {
                asset,
                code,
                acknowledged: reason.is_none(),
                reason,
            });
        }
        Ok(AcknowledgedView { items })
    }

    async fn acknowledge_alarm(
        &self,
        asset: &str,
        code: AlarmCodeWord,
        actor: String,
    ) -> Result<(), ServiceError> {
        if let Some(fault) = code.fault_code() {
            return self.acknowledge(asset, fault.as_str(), actor).await.map(drop);
        }
        self.check_known(asset).await?;
        let lost = self.inner.handles.store.lost_communications(Some(asset)).await?;
        if lost.is_empty() {
            let (asset, code) = (asset.to_owned(), code.to_string());
            return Err(ServiceError::NothingToAcknowledge { asset, code });
        }
        let at = self.inner.handles.clock.now();
        let write = AlarmWrite::AcknowledgeCommunication { asset: asset.to_owned(), actor, at };
        self.inner.handles.write(asset, vec![Write::Alarm(write)]).await
    }

    /// Returns what to do about each kind of alarm, with the owner's notes.
    ///
    /// # Errors
    /// [`ServiceError::Store`].
    pub async fn advice(&self) -> Result<AdviceListView, ServiceError> {
        let rows = self.inner.handles.store.notes().await?;
        let notes = rows.into_iter().map(note_view).collect::<Result<_, _>>()?;
        Ok(AdviceListView { items: advice::all(), notes })
    }

    /// Replaces the owner's note on a code; an empty text removes it.
    ///
    /// # Errors
    /// [`ServiceError::UnknownCode`]; [`ServiceError::Invalid`];
    /// [`ServiceError::Changed`] if the present note is not the expected one.
    pub async fn put_note(
        &self,
        word: &str,
        note: NewNoteView,
        actor: String,
        expected: &Expected,
    ) -> Result<NoteView, ServiceError> {
        let code = alarm_code(word)?;
        let found = self.note(code).await?;
        expected.check(found.as_ref().map(note_tag).transpose()?.as_ref())?;
        let text = note.text.trim().to_owned();
        if text.len() > MAX_NOTE || text.chars().any(|c| c.is_control() && c != '\n') {
            let reason = format!("must be at most {MAX_NOTE} bytes without control characters");
            return Err(Invalid::new("/text", reason).into());
        }
        let at = self.inner.handles.clock.now();
        let row = NoteRow { code: code.to_string(), text, actor, at };
        let write = match row.text.is_empty() {
            true => AlarmWrite::RemoveNote { code: row.code.clone() },
            false => AlarmWrite::Note(row.clone()),
        };
        if expected.is_particular() {
            let unchanged = Expectation::Note { code: row.code.clone(), found };
            if !self.inner.handles.edit(None, unchanged, EditWrite::Alarm(write)).await? {
                let now = self.note(code).await?.as_ref().map(note_tag).transpose()?;
                return Err(ServiceError::Changed { now });
            }
        } else {
            self.inner.handles.write_unpartitioned(Write::Alarm(write)).await?;
        }
        note_view(row)
    }

    async fn note(&self, code: AlarmCodeWord) -> Result<Option<NoteRow>, ServiceError> {
        let mut rows = self.inner.handles.store.notes().await?;
        rows.retain(|row| row.code == code.to_string());
        Ok(rows.pop())
    }
}

fn note_tag(row: &NoteRow) -> Result<EntityTag, ServiceError> {
    EntityTag::of(&(&row.text, &row.actor, row.at))
}

fn note_view(row: NoteRow) -> Result<NoteView, ServiceError> {
    let etag = note_tag(&row)?.to_string();
    let NoteRow { code, text, actor, at } = row;
    Ok(NoteView { code: views::word(&code)?, text, by: actor, at: rfc3339(at), etag })
}

/// Returns what is kept of the last occurrence of an alarm.
fn evidence(alarm: &AlarmView, has_recording: bool) -> AlarmEvidenceView {
    use EvidenceWord::{Complete, None as Nothing, Partial};
    let (state, reason) = match (alarm.code, alarm.evidence.state, has_recording) {
        (AlarmCodeWord::CommunicationLost, ..) => {
            (Nothing, "no data arrived, so nothing was recorded")
        }
        (_, Partial | Complete, true) => {
            return AlarmEvidenceView { state: Complete, reason: None };
        }
        (_, Partial | Complete, false) => {
            (Partial, "the recording was deleted, by request or by retention")
        }
        (_, Nothing, true) => (Partial, "the values at the first failure were not stored"),
        (_, Nothing, false) => {
            (Nothing, "the recording was deleted, and the values at the failure were not stored")
        }
    };
    AlarmEvidenceView { state, reason: Some(reason.to_owned()) }
}

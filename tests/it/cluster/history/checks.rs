//! The checks of a history, one function for each invariant.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fmt::Display;

use offbd_core::vocabulary::{FaultCode, Sample};

use super::commit_log::NotedCount;
use super::replay::replay;
use super::stored::{Stored, StoredAction, StoredSession};
use super::{Invariant, Violation};
use crate::support::history::{ClientHistory, SentAction, SentBatch};

#[derive(Default)]
pub struct Findings {
    pub violations: Vec<Violation>,
}

impl Findings {
    fn add(&mut self, invariant: Invariant, place: impl Display) {
        self.violations.push(Violation { invariant, place: place.to_string() });
    }

    fn check(&mut self, holds: bool, invariant: Invariant, place: impl FnOnce() -> String) {
        if !holds {
            self.add(invariant, place());
        }
    }
}

/// By which a sample of a session is recognised.
type SampleKey = (Option<u64>, u64);

fn key(sample: &Sample) -> SampleKey {
    (sample.seq, sample.t_s.to_bits())
}

/// A session and what clients sent for it.
struct SessionView<'a> {
    asset: &'a str,
    name: &'a str,
    /// In the order in which they were sent.
    batches: Vec<&'a SentBatch>,
    recording: &'a [Sample],
    /// Where each stored sample is first.
    positions: HashMap<SampleKey, usize>,
}

impl<'a> SessionView<'a> {
    fn new(
        (asset, name): (&'a str, &'a str),
        batches: Vec<&'a SentBatch>,
        recording: &'a [Sample],
    ) -> Self {
        let mut positions = HashMap::new();
        for (i, sample) in recording.iter().enumerate() {
            positions.entry(key(sample)).or_insert(i);
        }
        Self { asset, name, batches, recording, positions }
    }

    fn at(&self, sample: &Sample) -> String {
        let Self { asset, name, .. } = self;
        format!("asset {asset}, session {name}, sample {:?} at {} s", sample.seq, sample.t_s)
    }

    fn is_stored(&self, sample: &Sample) -> bool {
        self.positions.contains_key(&key(sample))
    }

    /// The samples of each batch that no earlier one had.
    fn new_samples(&self) -> Vec<(&'a SentBatch, Vec<&'a Sample>)> {
        let mut known = HashSet::new();
        let new = |batch: &&'a SentBatch| {
            let new = batch.samples.iter().filter(|sample| known.insert(key(sample)));
            (*batch, new.collect())
        };
        self.batches.iter().map(new).collect()
    }
}

/// Checks the samples of all sessions.
pub fn sessions(history: &ClientHistory, stored: &Stored, found: &mut Findings) {
    let mut sent = BTreeMap::<_, Vec<&SentBatch>>::new();
    for batch in &history.batches {
        sent.entry((batch.asset.as_str(), batch.session.as_str())).or_default().push(batch);
    }
    let mut recordings: BTreeMap<_, &[Sample]> = sent.keys().map(|name| (*name, &[][..])).collect();
    for session in &stored.sessions {
        recordings.insert((&session.asset, &session.name), &session.recording);
    }
    for (name, recording) in recordings {
        let batches = sent.remove(&name).unwrap_or_default();
        let session = SessionView::new(name, batches, recording);
        acknowledged_once(&session, found);
        nothing_unsent(&session, found);
        in_order(&session, found);
        position_stored(&session, found);
        batch_whole(&session, found);
    }
}

fn acknowledged_once(session: &SessionView<'_>, found: &mut Findings) {
    let told = session.batches.iter().filter(|batch| batch.told.is_some());
    for sample in told.flat_map(|batch| &batch.samples) {
        found.check(session.is_stored(sample), Invariant::AcknowledgedOnce, || {
            format!("{} is acknowledged and not stored", session.at(sample))
        });
    }
    for (i, sample) in session.recording.iter().enumerate() {
        let first = session.positions[&key(sample)];
        found.check(first == i, Invariant::AcknowledgedOnce, || {
            format!("{} is stored twice, at {first} and {i}", session.at(sample))
        });
    }
}

fn nothing_unsent(session: &SessionView<'_>, found: &mut Findings) {
    let sent: HashMap<_, _> =
        session.batches.iter().flat_map(|batch| &batch.samples).map(|s| (key(s), s)).collect();
    for sample in session.recording {
        let is_sent = sent.get(&key(sample)).is_some_and(|sent| *sent == sample);
        found.check(is_sent, Invariant::NothingUnsent, || {
            format!("{} is stored and was never sent", session.at(sample))
        });
    }
}

/// Each acknowledged batch was acknowledged before the next one was sent.
fn in_order(session: &SessionView<'_>, found: &mut Findings) {
    let told = session.new_samples().into_iter().filter(|(batch, _)| batch.told.is_some());
    let mut last: Option<(usize, &Sample)> = None;
    for sample in told.flat_map(|(_, samples)| samples) {
        let Some(&at) = session.positions.get(&key(sample)) else { continue };
        if let Some((before, earlier)) = last.filter(|(before, _)| *before > at) {
            let (sample, earlier) = (session.at(sample), earlier.seq);
            let place = format!("{sample} is stored at {at}, before {earlier:?} at {before}");
            found.add(Invariant::InOrder, place);
        }
        last = Some((at, sample));
    }
}

fn position_stored(session: &SessionView<'_>, found: &mut Findings) {
    let stored = session.recording.iter().filter_map(|sample| sample.seq).max();
    let told = session.batches.iter().filter_map(|batch| batch.told?.last_seq).max();
    found.check(told <= stored, Invariant::PositionStored, || {
        let SessionView { asset, name, .. } = session;
        format!("asset {asset}, session {name}: {told:?} is acknowledged, {stored:?} is stored")
    });
}

fn batch_whole(session: &SessionView<'_>, found: &mut Findings) {
    for (batch, samples) in session.new_samples() {
        let n = samples.iter().filter(|sample| session.is_stored(sample)).count();
        let is_whole = batch.told.is_some() || n == 0 || n == samples.len();
        found.check(is_whole, Invariant::BatchWhole, || {
            let of = samples.len();
            format!("{}: {n} of the {of} samples from it on are stored", session.at(samples[0]))
        });
    }
}

/// Compares what was judged with the recordings, judged again.
pub fn judgements(stored: &Stored, found: &mut Findings) {
    for session in &stored.sessions {
        judgement(session, stored, found);
    }
}

fn judgement(session: &StoredSession, stored: &Stored, found: &mut Findings) {
    let StoredSession { id, asset, name, hash, .. } = session;
    let actions: Vec<_> = stored.actions.iter().filter(|a| a.asset == *asset).collect();
    let again = replay(session, &actions);
    let place = |what: String| format!("asset {asset}, session {name}: {what}");
    found.check(again.hash == *hash, Invariant::VerdictRepeats, || {
        place(format!("the verdict is {hash}, that of the recording {}", again.hash))
    });
    let of_session = stored.events.iter().filter(|event| event.session_id.as_ref() == Some(id));
    let transitions: Vec<_> =
        of_session.map(|event| (event.code.clone(), event.status.clone())).collect();
    found.check(transitions == again.transitions, Invariant::VerdictRepeats, || {
        place(format!("transitions {transitions:?}, in the recording {:?}", again.transitions))
    });
    for ((_, code), fault) in stored.faults.iter().filter(|((of, _), _)| of == asset) {
        let record = again.memory.record(code.parse::<FaultCode>().unwrap());
        let wanted = (record.word().to_string(), record.acknowledged);
        found.check(*fault == wanted, Invariant::VerdictRepeats, || {
            place(format!("the fault {code} is {fault:?}, by the recording {wanted:?}"))
        });
    }
}

/// Compares what a subscriber got with what is stored.
pub fn events(history: &ClientHistory, stored: &Stored, found: &mut Findings) {
    let ids: Vec<_> = history.events.iter().map(|event| event.id).collect();
    for pair in ids.windows(2).filter(|pair| pair[0] >= pair[1]) {
        found.add(Invariant::EventsComplete, format!("event {} came after {}", pair[1], pair[0]));
    }
    let (seen, kept): (BTreeSet<_>, BTreeSet<_>) =
        (history.events.iter().collect(), stored.events.iter().collect());
    for event in kept.difference(&seen) {
        found.add(Invariant::EventsComplete, format!("{event:?} was not delivered"));
    }
    for event in seen.difference(&kept) {
        found.add(Invariant::EventsComplete, format!("{event:?} is not stored"));
    }
}

/// Checks who has committed what.
pub fn commits(stored: &Stored, found: &mut Findings) {
    let log = &stored.commits;
    let mut last = BTreeMap::<i64, &NotedCount>::new();
    for count in &log.counts {
        if let Some(before) = last.insert(count.partition, count) {
            epochs_rise(before, count, found);
            one_owner(before, count, found);
        }
    }
    let is_commit = |before: &NotedCount, count: &NotedCount| count.n_commits > before.n_commits;
    let mut counted = HashSet::new();
    let mut last = BTreeMap::<i64, &NotedCount>::new();
    for count in &log.counts {
        let before = last.insert(count.partition, count);
        if before.is_some_and(|before| is_commit(before, count)) {
            counted.insert((count.tx, count.partition));
        }
    }
    for change in &log.changes {
        let is_counted = counted.contains(&(change.tx, change.partition));
        found.check(is_counted, Invariant::EpochsRise, || {
            let (partition, place) = (change.partition, &change.place);
            format!("partition {partition}: {place} was committed without being counted")
        });
    }
}

/// A commit is counted in the same epoch; a new owner has the next one.
fn epochs_rise(before: &NotedCount, count: &NotedCount, found: &mut Findings) {
    let step = (count.epoch - before.epoch, count.n_commits - before.n_commits);
    let is_release = step == (0, 0) && count.owner.is_empty();
    found.check(is_release || [(0, 1), (1, 0)].contains(&step), Invariant::EpochsRise, || {
        format!("{before:?} is followed by {count:?}")
    });
}

fn one_owner(before: &NotedCount, count: &NotedCount, found: &mut Findings) {
    let is_other = before.epoch == count.epoch && before.owner != count.owner;
    let is_same = !is_other && count.writer == count.owner;
    let is_commit = count.n_commits > before.n_commits;
    found.check(!is_commit || is_same, Invariant::OneOwner, || {
        format!("{before:?} is followed by a commit of another node: {count:?}")
    });
}

/// An answer contains what was acknowledged before it was asked for, and nothing that was sent
/// after it came.
pub fn progress(history: &ClientHistory, found: &mut Findings) {
    for seen in &history.progress {
        let count = |is_in: &dyn Fn(&SentBatch) -> bool| {
            let batches = history.batches.iter().filter(|b| b.asset == seen.asset && is_in(b));
            batches.flat_map(|batch| &batch.samples).map(key).collect::<HashSet<_>>().len() as u64
        };
        let least = count(&|batch| batch.told.is_some_and(|told| told.at < seen.asked));
        let most = count(&|batch| batch.sent < seen.told);
        found.check((least..=most).contains(&seen.n_samples), Invariant::OneOwner, || {
            let (asset, n) = (&seen.asset, seen.n_samples);
            format!("asset {asset}: an answer tells of {n} samples, and not of {least} to {most}")
        });
    }
}

/// Compares what people did with what is stored of it.
pub fn actions(history: &ClientHistory, stored: &Stored, found: &mut Findings) {
    let place = |sent: &SentAction| format!("asset {}, {} {}", sent.asset, sent.kind, sent.code);
    let is_of = |stored: &StoredAction, sent: &SentAction| {
        stored.actor == sent.actor
            && stored.asset == sent.asset
            && stored.kind == sent.kind
            && stored.code == sent.code.as_str()
    };
    for action in &stored.actions {
        let is_sent = history.actions.iter().any(|sent| is_of(action, sent));
        found.check(is_sent, Invariant::ActionsOnce, || format!("{action:?} was never sent"));
    }
    let mut last = BTreeMap::new();
    for sent in &history.actions {
        let at: Vec<_> =
            (0..stored.actions.len()).filter(|i| is_of(&stored.actions[*i], sent)).collect();
        let allowed = match sent.told.map(|told| told.is_done) {
            Some(true) => 1..=1,
            Some(false) => 0..=0,
            None => 0..=1,
        };
        found.check(allowed.contains(&at.len()), Invariant::ActionsOnce, || {
            format!("{} is stored {} times, and told {:?}", place(sent), at.len(), sent.told)
        });
        let (Some(&at), Some(told)) = (at.first(), sent.told) else { continue };
        let before = last.insert((&sent.asset, sent.code), (at, told.at));
        let is_after = before.is_none_or(|(before, ended)| before < at || ended > sent.sent);
        found.check(is_after, Invariant::ActionsOnce, || {
            format!("{} is stored before an earlier one", place(sent))
        });
    }
}

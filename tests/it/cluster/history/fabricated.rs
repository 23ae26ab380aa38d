//! Fabricated histories, each of which violates one thing: the check finds it, and nothing else.

use offbd_core::vocabulary::{FaultCode, Sample};
use serde_json::json;

use super::commit_log::{NotedChange, NotedCount};
use super::replay::replay;
use super::stored::{StoredAction, StoredSession};
use super::{Invariant, Stored, violations};
use crate::support::history::{ClientHistory, SeenEvent, SeenProgress};
use crate::support::rig;

/// Samples of a batch.
const BATCH: usize = 100;
/// Batches that are acknowledged, and of those that are sent.
const TOLD: usize = 12;

/// A history of one rig, and what is stored of it.
struct Fabricated {
    history: ClientHistory,
    stored: Stored,
}

impl Fabricated {
    /// A history in which everything is right: the last batch is not acknowledged, a fault is
    /// acknowledged, and the rig moves to another node.
    fn new() -> Self {
        let samples = rig((TOLD + 1) * BATCH, 500);
        let mut history = ClientHistory::default();
        for part in samples.chunks(BATCH) {
            let number = history.send_batch("a", "s", part);
            if number < TOLD {
                history.tell_batch(number, &json!({ "last_seq": part.last().unwrap().seq }));
            }
        }
        for (status, n) in [(200, 0), (409, 1)] {
            assert_eq!(history.send_action("a", FaultCode::XServo, "acknowledge"), n);
            history.tell_action(n, status);
        }
        history.progress.push(SeenProgress {
            asset: "a".to_owned(),
            n_samples: 1300,
            asked: 100,
            told: 101,
        });
        let mut this = Self {
            history,
            stored: Stored { actions: vec![acknowledged(0)], ..Stored::default() },
        };
        this.stored.commits.counts = counts();
        this.stored.commits.changes =
            vec![NotedChange { tx: 2, partition: 3, place: String::new() }];
        this.store(&samples);
        this
    }

    /// Stores this recording, and what is judged of it.
    fn store(&mut self, recording: &[Sample]) {
        let [id, asset, name] = ["1", "a", "s"].map(str::to_owned);
        let recording = recording.to_vec();
        let mut session = StoredSession { id, asset, name, recording, hash: String::new() };
        let actions: Vec<_> = self.stored.actions.iter().collect();
        let judged = replay(&session, &actions);
        session.hash = judged.hash;
        self.stored.events = (1..).zip(judged.transitions).map(event).collect();
        self.history.events = self.stored.events.clone();
        for code in ["x_servo", "sensor"] {
            let record = judged.memory.record(code.parse().unwrap());
            let fault = (record.word().to_string(), record.acknowledged);
            self.stored.faults.insert(("a".to_owned(), code.to_owned()), fault);
        }
        self.stored.sessions = vec![session];
    }

    /// Stores what is sent, after `change`.
    fn store_changed(&mut self, change: impl FnOnce(&mut Vec<Sample>)) {
        let mut recording = self.stored.sessions[0].recording.clone();
        change(&mut recording);
        self.store(&recording);
    }
}

fn event((id, (code, status)): (i64, (String, String))) -> SeenEvent {
    SeenEvent { id, asset: "a".to_owned(), session_id: Some("1".to_owned()), code, status }
}

/// What the person with this number did, while the session was open.
fn acknowledged(number: usize) -> StoredAction {
    let [asset, kind, code] = ["a", "acknowledge", "x_servo"].map(str::to_owned);
    let (session, actor) = (Some("1".to_owned()), format!("person-{number}"));
    StoredAction { asset, session, is_early: false, after_index: 1300, kind, code, actor }
}

/// A partition that node `one` takes, changes and gives up, and that node `two` takes and
/// changes.
fn counts() -> Vec<NotedCount> {
    let count = |(tx, epoch, n_commits, owner, writer): (_, _, _, &str, &str)| {
        let (owner, writer) = (owner.to_owned(), writer.to_owned());
        NotedCount { tx, partition: 3, epoch, n_commits, owner, writer }
    };
    let all = [
        (0, 0, 0, "", ""),
        (1, 1, 0, "one", "one"),
        (2, 1, 1, "one", "one"),
        (3, 1, 1, "", "one"),
        (4, 2, 1, "two", "two"),
        (5, 2, 2, "two", "two"),
    ];
    all.into_iter().map(count).collect()
}

/// Checks that `change` of a history that is right violates this alone.
#[track_caller]
fn violates(invariant: Invariant, change: impl FnOnce(&mut Fabricated)) {
    let mut fabricated = Fabricated::new();
    change(&mut fabricated);
    let found = violations(&fabricated.history, &fabricated.stored);
    assert!(!found.is_empty(), "not found");
    for violation in found {
        assert_eq!(violation.invariant, invariant, "{violation}");
        assert!(!violation.place.is_empty());
    }
}

#[test]
fn a_history_that_is_right_violates_nothing() {
    let Fabricated { history, stored } = Fabricated::new();
    assert!(!stored.events.is_empty());
    let found = violations(&history, &stored);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn samples_that_are_lost_or_stored_twice_are_found() {
    violates(Invariant::AcknowledgedOnce, |it| it.store_changed(|all| drop(all.drain(250..251))));
    violates(Invariant::AcknowledgedOnce, |it| it.store_changed(|all| all.insert(251, all[250])));
    violates(Invariant::AcknowledgedOnce, |it| it.store_changed(|all| drop(all.drain(200..300))));
}

#[test]
fn samples_that_were_never_sent_are_found() {
    let unsent = |sample: &Sample| Sample { seq: Some(5000), t_s: 90.0, ..*sample };
    violates(Invariant::NothingUnsent, |it| it.store_changed(|all| all.push(unsent(&all[7]))));
    violates(Invariant::NothingUnsent, |it| it.store_changed(|all| all[7].x_m = Some(0.01)));
}

#[test]
fn samples_in_another_order_are_found() {
    violates(Invariant::InOrder, |it| it.store_changed(|all| all[150..350].rotate_left(50)));
}

#[test]
fn another_verdict_than_that_of_the_recording_is_found() {
    violates(Invariant::VerdictRepeats, |it| it.stored.sessions[0].hash.push('0'));
    violates(Invariant::VerdictRepeats, |it| {
        let key = ("a".to_owned(), "sensor".to_owned());
        it.stored.faults.insert(key, ("confirmed".to_owned(), false));
    });
    violates(Invariant::VerdictRepeats, |it| {
        it.stored.events.pop();
        it.history.events.pop();
    });
}

#[test]
fn events_that_are_lost_twice_exchanged_or_not_stored_are_found() {
    violates(Invariant::EventsComplete, |it| drop(it.history.events.remove(0)));
    violates(Invariant::EventsComplete, |it| {
        let first = it.history.events[0].clone();
        it.history.events.insert(1, first);
    });
    violates(Invariant::EventsComplete, |it| it.history.events.swap(0, 1));
    violates(Invariant::EventsComplete, |it| it.history.events[0].status = "other".to_owned());
}

#[test]
fn commits_of_an_older_epoch_or_without_a_count_are_found() {
    let counts = |it: &mut Fabricated, i: usize, epoch, n_commits| {
        let count = &mut it.stored.commits.counts[i];
        (count.epoch, count.n_commits) = (epoch, n_commits);
    };
    violates(Invariant::EpochsRise, |it| counts(it, 5, 1, 2));
    violates(Invariant::EpochsRise, |it| counts(it, 5, 2, 3));
    violates(Invariant::EpochsRise, |it| drop(it.stored.commits.counts.remove(1)));
    violates(Invariant::EpochsRise, |it| it.stored.commits.changes[0].tx = 4);
    violates(Invariant::EpochsRise, |it| it.stored.commits.changes[0].partition = 4);
}

#[test]
fn two_owners_in_one_epoch_and_answers_from_the_past_are_found() {
    violates(Invariant::OneOwner, |it| it.stored.commits.counts[5].writer = "one".to_owned());
    violates(Invariant::OneOwner, |it| {
        let count = &mut it.stored.commits.counts[2];
        (count.owner, count.writer) = ("two".to_owned(), "two".to_owned());
    });
    violates(Invariant::OneOwner, |it| it.history.progress[0].n_samples = 1199);
    violates(Invariant::OneOwner, |it| it.history.progress[0].n_samples = 1301);
}

#[test]
fn an_acknowledged_number_beyond_what_is_stored_is_found() {
    violates(Invariant::PositionStored, |it| {
        it.history.batches[3].told.as_mut().unwrap().last_seq = Some(1300);
    });
}

#[test]
fn half_a_batch_is_found() {
    violates(Invariant::BatchWhole, |it| it.store_changed(|all| all.truncate(1250)));
}

#[test]
fn actions_that_are_lost_twice_refused_unsent_or_exchanged_are_found() {
    violates(Invariant::ActionsOnce, |it| {
        it.history.actions[1].told.as_mut().unwrap().is_done = true
    });
    violates(Invariant::ActionsOnce, |it| it.stored.actions.push(acknowledged(0)));
    violates(Invariant::ActionsOnce, |it| it.stored.actions.push(acknowledged(1)));
    violates(Invariant::ActionsOnce, |it| it.stored.actions.push(acknowledged(7)));
    violates(Invariant::ActionsOnce, |it| {
        it.history.actions[1].told.as_mut().unwrap().is_done = true;
        it.stored.actions.insert(0, acknowledged(1));
    });
}

#[test]
fn what_is_cleared_before_the_session_begins_changes_no_fault_of_it() {
    let Fabricated { mut history, mut stored } = Fabricated::new();
    let number = history.send_action("a", FaultCode::XServo, "clear");
    let mut early = acknowledged(number);
    (early.session, early.is_early, early.after_index) = (None, true, 0);
    early.kind = "clear".to_owned();
    stored.actions.insert(0, early);
    let found = violations(&history, &stored);
    assert!(found.is_empty(), "{found:?}");
    // The same after its end changes what has to be stored.
    stored.actions[0].is_early = false;
    assert_eq!(violations(&history, &stored)[0].invariant, Invariant::VerdictRepeats);
}

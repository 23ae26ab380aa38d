//! Comparison of two verdicts on one recording, transition by transition.
//!
//! Transitions of the same code to the same status byte are paired if they are near in
//! time. The nearest pair is matched first, and pairs never cross.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::verdict::FaultView;
use super::words::{ChangeWord, CodeWord, KindWord, StatusWord};

/// Largest difference of the times of two paired transitions, s: the longest debounce time
/// that can be set.
const MAX_MOVE_S: f64 = 60.0;

/// One transition in the recorded and the replayed verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ComparedView {
    pub change: ChangeWord,
    pub code: CodeWord,
    /// Failure mode as recorded, or as replayed if only the replay has the transition; null
    /// if not determined.
    pub kind: Option<KindWord>,
    pub status: StatusWord,
    /// ISO 14229 status byte, two hexadecimal digits.
    pub status_byte: String,
    /// Time in the recorded verdict, s on the device's clock; null if only the replay has the
    /// transition.
    pub recorded_t_s: Option<f64>,
    /// Time in the replayed verdict, s on the device's clock; null if only the record has the
    /// transition.
    pub replayed_t_s: Option<f64>,
    /// Replayed minus recorded time, s, positive if the replay is later; null if only one
    /// verdict has the transition.
    pub moved_s: Option<f64>,
}

/// The number of transitions of each change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TallyView {
    pub same: u64,
    pub altered: u64,
    pub moved: u64,
    pub only_recorded: u64,
    pub only_replayed: u64,
}

/// One transition in two verdicts, with its index in each.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparedTransition {
    pub recorded: Option<usize>,
    pub replayed: Option<usize>,
    pub view: ComparedView,
}

impl ComparedTransition {
    /// Returns whether both verdicts have the transition with equal time, kind and onset;
    /// the evidence may differ.
    #[must_use]
    pub fn is_same(&self) -> bool {
        self.view.change == ChangeWord::Same
    }
}

/// Returns every transition of two verdicts on one recording once, in the order of time.
#[must_use]
pub fn compare(recorded: &[FaultView], replayed: &[FaultView]) -> Vec<ComparedTransition> {
    let mut groups: BTreeMap<(CodeWord, StatusWord, &str), [Vec<usize>; 2]> = BTreeMap::new();
    for (side, faults) in [recorded, replayed].into_iter().enumerate() {
        for (i, fault) in faults.iter().enumerate() {
            let key = (fault.code, fault.status, fault.status_byte.as_str());
            groups.entry(key).or_default()[side].push(i);
        }
    }
    let mut all = Vec::new();
    for [left, right] in groups.into_values() {
        let times = |faults: &[FaultView], at: &[usize]| -> Vec<f64> {
            at.iter().map(|&i| faults[i].t_s).collect()
        };
        for (l, r) in pair(&times(recorded, &left), &times(replayed, &right)) {
            let (l, r) = (l.map(|l| left[l]), r.map(|r| right[r]));
            all.extend(compared(l.map(|l| (l, &recorded[l])), r.map(|r| (r, &replayed[r]))));
        }
    }
    // A transition that has moved is at the earlier of its times.
    let time = |one: &ComparedTransition| {
        let times = [one.view.recorded_t_s, one.view.replayed_t_s];
        times.into_iter().flatten().fold(f64::INFINITY, f64::min)
    };
    // At equal times, recorded transitions come first, each side in its own order.
    let order = |one: &ComparedTransition| (one.recorded.is_none(), one.recorded, one.replayed);
    all.sort_by(|a, b| time(a).total_cmp(&time(b)).then_with(|| order(a).cmp(&order(b))));
    all
}

/// Counts the transitions of each change.
#[must_use]
pub fn count_changes(all: &[ComparedTransition]) -> TallyView {
    let count = |word| all.iter().filter(|one| one.view.change == word).count() as u64;
    TallyView {
        same: count(ChangeWord::Same),
        altered: count(ChangeWord::Altered),
        moved: count(ChangeWord::Moved),
        only_recorded: count(ChangeWord::OnlyRecorded),
        only_replayed: count(ChangeWord::OnlyReplayed),
    }
}

/// A transition and its index in its verdict.
type IndexedFault<'a> = (usize, &'a FaultView);

/// Returns the comparison of a pair, or of a transition without a partner; `None` if both
/// are `None`.
fn compared(
    recorded: Option<IndexedFault<'_>>,
    replayed: Option<IndexedFault<'_>>,
) -> Option<ComparedTransition> {
    let (_, either) = recorded.or(replayed)?;
    let change = match (recorded, replayed) {
        (Some((_, a)), Some((_, b))) if a.t_s != b.t_s => ChangeWord::Moved,
        (Some((_, a)), Some((_, b))) if (a.kind, a.onset_s) != (b.kind, b.onset_s) => {
            ChangeWord::Altered
        }
        (Some(_), Some(_)) => ChangeWord::Same,
        (Some(_), None) => ChangeWord::OnlyRecorded,
        _ => ChangeWord::OnlyReplayed,
    };
    let t_s = |indexed: Option<IndexedFault<'_>>| indexed.map(|(_, fault)| fault.t_s);
    Some(ComparedTransition {
        recorded: recorded.map(|(i, _)| i),
        replayed: replayed.map(|(i, _)| i),
        view: ComparedView {
            change,
            code: either.code,
            kind: either.kind,
            status: either.status,
            status_byte: either.status_byte.clone(),
            recorded_t_s: t_s(recorded),
            replayed_t_s: t_s(replayed),
            moved_s: t_s(recorded).zip(t_s(replayed)).map(|(a, b)| b - a),
        },
    })
}

/// Pairs the indices of two ascending lists of times: first the nearest pair, then
/// recursively the ranges before and after it. An index without a partner is returned
/// alone.
fn pair(left: &[f64], right: &[f64]) -> Vec<(Option<usize>, Option<usize>)> {
    let mut found = Vec::new();
    let mut ranges = vec![(0..left.len(), 0..right.len())];
    while let Some((l, r)) = ranges.pop() {
        match nearest(&left[l.clone()], &right[r.clone()]) {
            Some((i, j)) => {
                let (i, j) = (l.start + i, r.start + j);
                found.push((Some(i), Some(j)));
                ranges.push((l.start..i, r.start..j));
                ranges.push((i + 1..l.end, j + 1..r.end));
            }
            None => {
                found.extend(l.map(|i| (Some(i), None)));
                found.extend(r.map(|j| (None, Some(j))));
            }
        }
    }
    found
}

/// Returns the indices of the nearest two times at most [`MAX_MOVE_S`] apart; of equally
/// near ones, the first.
fn nearest(left: &[f64], right: &[f64]) -> Option<(usize, usize)> {
    let (mut i, mut j, mut best) = (0, 0, None::<(f64, usize, usize)>);
    while let (Some(a), Some(b)) = (left.get(i), right.get(j)) {
        let distance = (a - b).abs();
        if distance <= MAX_MOVE_S && best.is_none_or(|(least, ..)| distance < least) {
            best = Some((distance, i, j));
        }
        if a <= b { i += 1 } else { j += 1 }
    }
    best.map(|(_, i, j)| (i, j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::Basis;
    use crate::verdict::fault_view;
    use offbd_core::diagnosis::{Evidence, StatusByte, Suspicion, Transition};
    use offbd_core::vocabulary::{FaultCode, FaultStatus, SimTime};
    use proptest::prelude::*;

    fn fault(code: FaultCode, status: FaultStatus, t_s: f64) -> FaultView {
        let at = SimTime::new(t_s).unwrap();
        let (byte, suspicion) = (StatusByte::default(), Suspicion::default());
        let evidence = Evidence::default();
        let transition = Transition { at, code, status, byte, suspicion, evidence };
        fault_view("s", &Basis::default(), &transition)
    }

    fn x(t_s: f64) -> FaultView {
        fault(FaultCode::XServo, FaultStatus::Pending, t_s)
    }

    fn changes(all: &[ComparedTransition]) -> Vec<(ChangeWord, Option<f64>)> {
        all.iter().map(|one| (one.view.change, one.view.moved_s)).collect()
    }

    #[test]
    fn the_nearest_transitions_are_paired() {
        use ChangeWord::{Altered, Moved, OnlyRecorded, OnlyReplayed};
        let found = compare(&[x(10.0), x(50.0)], &[x(50.25)]);
        assert_eq!(changes(&found), [(OnlyRecorded, None), (Moved, Some(0.25))]);
        let found = compare(&[x(10.0)], &[x(70.5)]);
        let alone = [(OnlyRecorded, None), (OnlyReplayed, None)];
        assert_eq!(changes(&found), alone, "too far apart");
        let confirmed = fault(FaultCode::XServo, FaultStatus::Confirmed, 10.0);
        assert_eq!(changes(&compare(&[x(10.0)], &[confirmed])), alone, "another status");
        let mut dead = x(10.0);
        dead.kind = Some(KindWord::Dead);
        assert_eq!(changes(&compare(&[x(10.0)], &[dead])), [(Altered, Some(0.0))]);
    }

    #[test]
    fn a_transition_that_has_moved_is_at_the_earlier_of_its_times() {
        let y = |t_s| fault(FaultCode::YServo, FaultStatus::Pending, t_s);
        let found = compare(&[y(15.0), x(20.9)], &[x(4.9), y(16.0)]);
        let times = found.iter().map(|one| (one.view.recorded_t_s, one.view.replayed_t_s));
        let wanted = [(Some(20.9), Some(4.9)), (Some(15.0), Some(16.0))];
        assert_eq!(times.collect::<Vec<_>>(), wanted);
    }

    fn verdict() -> impl Strategy<Value = Vec<FaultView>> {
        let one = (0..4_usize, 0..2_usize, 0..2000_u32);
        prop::collection::vec(one, 0..40).prop_map(|mut all| {
            all.sort_by_key(|one| one.2);
            let status = [FaultStatus::Pending, FaultStatus::Confirmed];
            let fault = |(code, word, tenths): (usize, usize, u32)| {
                fault(FaultCode::ALL[code], status[word], f64::from(tenths) / 10.0)
            };
            all.into_iter().map(fault).collect()
        })
    }

    proptest! {
        #[test]
        fn a_verdict_is_the_same_as_itself(verdict in verdict()) {
            let found = compare(&verdict, &verdict);
            prop_assert_eq!(count_changes(&found).same, verdict.len() as u64);
            prop_assert!(found.iter().all(ComparedTransition::is_same));
        }

        /// Every transition is returned once, pairs have equal code and status and are near
        /// enough, and pairs do not cross.
        #[test]
        fn every_transition_is_compared_once_and_pairs_do_not_cross(a in verdict(), b in verdict()) {
            let found = compare(&a, &b);
            for (n, indices) in [
                (a.len(), found.iter().filter_map(|one| one.recorded).collect::<Vec<_>>()),
                (b.len(), found.iter().filter_map(|one| one.replayed).collect()),
            ] {
                let mut sorted = indices;
                sorted.sort_unstable();
                prop_assert_eq!(sorted, (0..n).collect::<Vec<_>>());
            }
            let pairs: Vec<_> =
                found.iter().filter_map(|one| one.recorded.zip(one.replayed)).collect();
            for &(i, j) in &pairs {
                prop_assert_eq!((&a[i].code, &a[i].status), (&b[j].code, &b[j].status));
                prop_assert!((a[i].t_s - b[j].t_s).abs() <= MAX_MOVE_S);
                for &(k, l) in &pairs {
                    let alike = a[i].code == a[k].code && a[i].status == a[k].status;
                    prop_assert!(!alike || (i < k) == (j < l) , "{i}-{j} crosses {k}-{l}");
                }
            }
        }

        #[test]
        fn exchanging_the_verdicts_exchanges_the_counts(a in verdict(), b in verdict()) {
            let (there, back) = (count_changes(&compare(&a, &b)), count_changes(&compare(&b, &a)));
            prop_assert_eq!(there.same, back.same);
            prop_assert_eq!(there.only_recorded, back.only_replayed);
            prop_assert_eq!(there.only_replayed, back.only_recorded);
        }
    }
}

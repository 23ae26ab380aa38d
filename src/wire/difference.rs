//! Two verdicts on one recording, transition by transition.
//!
//! Transitions of one code to one status byte are the same event where they
//! are near in time; the nearest pair goes first, and pairs never cross.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::verdict::FaultView;

/// How far a transition may have moved to be the same one, s: the longest
/// debounce that can be asked for.
const MAX_MOVE_S: f64 = 60.0;

/// One transition in two verdicts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ComparedView {
    /// `same`; `altered`: at the same moment, but of another kind or onset;
    /// `moved`: earlier or later; `only_recorded` or `only_replayed`.
    pub change: String,
    pub code: String,
    /// As recorded, or as replayed where the record does not have it.
    pub kind: Option<String>,
    pub status: String,
    pub status_byte: String,
    /// Null where only the replay has it.
    pub recorded_t_s: Option<f64>,
    /// Null where only the record has it.
    pub replayed_t_s: Option<f64>,
    /// Replayed − recorded, s; above 0 where the replay is later.
    pub moved_s: Option<f64>,
}

/// How many transitions there are of each change.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TallyView {
    pub same: u64,
    pub altered: u64,
    pub moved: u64,
    pub only_recorded: u64,
    pub only_replayed: u64,
}

/// One transition in two verdicts, by its places there.
#[derive(Clone, Debug, PartialEq)]
pub struct Compared {
    pub recorded: Option<usize>,
    pub replayed: Option<usize>,
    pub view: ComparedView,
}

impl Compared {
    /// Whether the two verdicts agree on it, the numbers behind it aside.
    #[must_use]
    pub fn is_same(&self) -> bool {
        self.view.change == SAME
    }
}

const SAME: &str = "same";
const ALTERED: &str = "altered";
const MOVED: &str = "moved";
const ONLY_RECORDED: &str = "only_recorded";
const ONLY_REPLAYED: &str = "only_replayed";

/// Every transition of two verdicts on one recording, each once, in the order
/// of time.
#[must_use]
pub fn compare(recorded: &[FaultView], replayed: &[FaultView]) -> Vec<Compared> {
    let mut groups: BTreeMap<(&str, &str, &str), [Vec<usize>; 2]> = BTreeMap::new();
    for (side, faults) in [recorded, replayed].into_iter().enumerate() {
        for (i, fault) in faults.iter().enumerate() {
            let key = (fault.code.as_str(), fault.status.as_str(), fault.status_byte.as_str());
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
            all.push(compared(l.map(|l| (l, &recorded[l])), r.map(|r| (r, &replayed[r]))));
        }
    }
    let time = |one: &Compared| one.view.recorded_t_s.or(one.view.replayed_t_s).unwrap_or(0.0);
    // At one moment, what the record has comes first, each in its own order.
    let place = |one: &Compared| (one.recorded.is_none(), one.recorded, one.replayed);
    all.sort_by(|a, b| time(a).total_cmp(&time(b)).then_with(|| place(a).cmp(&place(b))));
    all
}

/// How many there are of each change.
#[must_use]
pub fn tally(all: &[Compared]) -> TallyView {
    let count = |word: &str| all.iter().filter(|one| one.view.change == word).count() as u64;
    TallyView {
        same: count(SAME),
        altered: count(ALTERED),
        moved: count(MOVED),
        only_recorded: count(ONLY_RECORDED),
        only_replayed: count(ONLY_REPLAYED),
    }
}

type Placed<'a> = Option<(usize, &'a FaultView)>;

fn compared(recorded: Placed<'_>, replayed: Placed<'_>) -> Compared {
    let change = match (recorded, replayed) {
        (Some((_, a)), Some((_, b))) if a.t_s != b.t_s => MOVED,
        (Some((_, a)), Some((_, b))) if (&a.kind, a.onset_s) != (&b.kind, b.onset_s) => ALTERED,
        (Some(_), Some(_)) => SAME,
        (Some(_), None) => ONLY_RECORDED,
        _ => ONLY_REPLAYED,
    };
    let t_s = |placed: Placed<'_>| placed.map(|(_, fault)| fault.t_s);
    let shown = recorded.or(replayed).map(|(_, fault)| fault);
    let word = |of: fn(&FaultView) -> &String| shown.map(|f| of(f).clone()).unwrap_or_default();
    Compared {
        recorded: recorded.map(|(i, _)| i),
        replayed: replayed.map(|(i, _)| i),
        view: ComparedView {
            change: change.to_owned(),
            code: word(|f| &f.code),
            kind: shown.and_then(|f| f.kind.clone()),
            status: word(|f| &f.status),
            status_byte: word(|f| &f.status_byte),
            recorded_t_s: t_s(recorded),
            replayed_t_s: t_s(replayed),
            moved_s: t_s(recorded).zip(t_s(replayed)).map(|(a, b)| b - a),
        },
    }
}

/// Places in two ascending lists of times, paired where they are near: the
/// nearest pair first, then what is left of it and what is right of it. What
/// has no partner stands alone.
fn pair(left: &[f64], right: &[f64]) -> Vec<(Option<usize>, Option<usize>)> {
    let mut found = Vec::new();
    let mut stretches = vec![(0..left.len(), 0..right.len())];
    while let Some((l, r)) = stretches.pop() {
        match nearest(&left[l.clone()], &right[r.clone()]) {
            Some((i, j)) => {
                let (i, j) = (l.start + i, r.start + j);
                found.push((Some(i), Some(j)));
                stretches.push((l.start..i, r.start..j));
                stretches.push((i + 1..l.end, j + 1..r.end));
            }
            None => {
                found.extend(l.map(|i| (Some(i), None)));
                found.extend(r.map(|j| (None, Some(j))));
            }
        }
    }
    found
}

/// The nearest two within reach, the first of several.
fn nearest(left: &[f64], right: &[f64]) -> Option<(usize, usize)> {
    let (mut i, mut j, mut best) = (0, 0, None::<(f64, usize, usize)>);
    while let (Some(a), Some(b)) = (left.get(i), right.get(j)) {
        let away = (a - b).abs();
        if away <= MAX_MOVE_S && best.is_none_or(|(least, ..)| away < least) {
            best = Some((away, i, j));
        }
        if a <= b { i += 1 } else { j += 1 }
    }
    best.map(|(_, i, j)| (i, j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::basis::Basis;
    use crate::wire::verdict::fault_view;
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

    fn words(all: &[Compared]) -> Vec<(String, Option<f64>)> {
        all.iter().map(|one| (one.view.change.clone(), one.view.moved_s)).collect()
    }

    #[test]
    fn the_nearest_are_the_same_one() {
        let word = |word: &str, moved_s| (word.to_owned(), moved_s);
        let found = compare(&[x(10.0), x(50.0)], &[x(50.25)]);
        assert_eq!(words(&found), [word("only_recorded", None), word("moved", Some(0.25))]);
        let found = compare(&[x(10.0)], &[x(70.5)]);
        let alone = [word("only_recorded", None), word("only_replayed", None)];
        assert_eq!(words(&found), alone, "too far apart to be one");
        let confirmed = fault(FaultCode::XServo, FaultStatus::Confirmed, 10.0);
        assert_eq!(words(&compare(&[x(10.0)], &[confirmed])), alone, "another status");
        let mut dead = x(10.0);
        dead.kind = Some("dead".to_owned());
        assert_eq!(words(&compare(&[x(10.0)], &[dead])), [word("altered", Some(0.0))]);
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
            prop_assert_eq!(tally(&found).same, verdict.len() as u64);
            prop_assert!(found.iter().all(Compared::is_same));
        }

        /// Each transition is there once, paired with one of its own code and
        /// status within reach, and pairs do not cross.
        #[test]
        fn each_is_there_once_and_order_is_kept(a in verdict(), b in verdict()) {
            let found = compare(&a, &b);
            for (n, place) in [
                (a.len(), found.iter().filter_map(|one| one.recorded).collect::<Vec<_>>()),
                (b.len(), found.iter().filter_map(|one| one.replayed).collect()),
            ] {
                let mut sorted = place;
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

        /// The other way round, it is the same seen from the other side.
        #[test]
        fn sides_may_be_changed(a in verdict(), b in verdict()) {
            let (there, back) = (tally(&compare(&a, &b)), tally(&compare(&b, &a)));
            prop_assert_eq!(there.same, back.same);
            prop_assert_eq!(there.only_recorded, back.only_replayed);
            prop_assert_eq!(there.only_replayed, back.only_recorded);
        }
    }
}

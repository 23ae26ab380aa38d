//! What a session came to, monitor by monitor, and how much of it was judged.
//!
//! Silence is no proof of health: a monitor that could not judge says so, and so
//! does one of a rig that is not learnt, or one that has found two causes which
//! read alike.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{CandidateView, SummaryView, Verdict, candidate_view, warnings};
use offbd_core::diagnosis::Suspicion;
use offbd_core::engine::{Misfit, MonitorState, Reach, State};
use offbd_core::vocabulary::FaultCode;

/// What a session came to, or one monitor in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum Outcome {
    /// Confirmed.
    #[serde(rename = "fault")]
    Fault,
    /// Confirmed, but causes read alike that lie in different parts of the rig.
    #[serde(rename = "cannot tell")]
    CannotTell,
    /// A test has failed, and nothing was confirmed.
    #[serde(rename = "pending")]
    Pending,
    /// Judged for long enough to have confirmed a fault, and there was none; of a
    /// session: by every monitor.
    #[serde(rename = "no fault")]
    NoFault,
    /// Of a session: no fault, but some monitors have not judged.
    #[serde(rename = "partly judged")]
    PartlyJudged,
    /// No fault, but the rig is not learnt: faults of its servos and its ball are
    /// not confirmed.
    #[serde(rename = "not learnt")]
    NotLearnt,
    /// Judged for less time than a fault takes to be confirmed.
    #[serde(rename = "not judged")]
    NotJudged,
}

impl Outcome {
    /// The same word as on the wire.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Fault => "fault",
            Self::CannotTell => "cannot tell",
            Self::Pending => "pending",
            Self::NoFault => "no fault",
            Self::PartlyJudged => "partly judged",
            Self::NotLearnt => "not learnt",
            Self::NotJudged => "not judged",
        }
    }

    /// What a session came to whose monitors came to `each`: the worst that was
    /// found, or else the least that is known.
    fn of_session(each: &[Self]) -> Self {
        let found = [Self::Fault, Self::CannotTell, Self::Pending];
        let all = |outcome| each.iter().all(|&o| o == outcome);
        match found.into_iter().find(|outcome| each.contains(outcome)) {
            Some(outcome) => outcome,
            None if all(Self::NotJudged) => Self::NotJudged,
            None if each.contains(&Self::NotLearnt) => Self::NotLearnt,
            None if all(Self::NoFault) => Self::NoFault,
            None => Self::PartlyJudged,
        }
    }
}

/// One monitor over a whole session.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JudgedView {
    pub code: String,
    /// Seconds of the session in which it could judge.
    pub judged_s: f64,
    /// The same as a share of the session, from its first sample to its last,
    /// 0 to 1.
    pub judged_share: f64,
    pub outcome: Outcome,
    /// Causes that read alike, heaviest first; empty where only one does.
    pub candidates: Vec<CandidateView>,
}

impl Verdict {
    /// What each monitor came to, in the order of [`FaultCode::ALL`], in a session
    /// that leaves the engine in `state`.
    #[must_use]
    pub fn monitors(&self, state: &State) -> Vec<JudgedView> {
        let view = |(&code, monitor)| self.judged_view(code, monitor);
        FaultCode::ALL.iter().zip(&state.monitors).map(view).collect()
    }

    fn judged_view(&self, code: FaultCode, monitor: &MonitorState) -> JudgedView {
        let suspected = self.suspected[code as usize].as_ref();
        let candidates = suspected.map(|s| s.candidates.iter().map(candidate_view).collect());
        JudgedView {
            code: code.to_string(),
            judged_s: monitor.judged_s,
            judged_share: monitor.judged_share,
            outcome: self.outcome(code, monitor.reach),
            candidates: candidates.unwrap_or_default(),
        }
    }

    fn outcome(&self, code: FaultCode, reach: Reach) -> Outcome {
        let suspected = self.suspected[code as usize].as_ref();
        match (self.confirmed.contains(&code), suspected, reach) {
            (true, Some(suspicion), _) if read_alike(suspicion) => Outcome::CannotTell,
            (true, ..) => Outcome::Fault,
            (false, Some(_), _) => Outcome::Pending,
            (false, None, Reach::Judged) => Outcome::NoFault,
            (false, None, Reach::NotLearnt) => Outcome::NotLearnt,
            (false, None, Reach::NotJudged) => Outcome::NotJudged,
        }
    }
}

/// Whether the causes lie in different parts of the rig.
pub(super) fn read_alike(suspicion: &Suspicion) -> bool {
    let first = suspicion.candidates.first().map(|c| c.code);
    suspicion.candidates.iter().any(|c| Some(c.code) != first)
}

impl SummaryView {
    /// The same with what each monitor came to, and so the session.
    #[must_use]
    pub fn with_monitors(self, monitors: Vec<JudgedView>) -> Self {
        let each: Vec<Outcome> = monitors.iter().map(|m| m.outcome).collect();
        Self { outcome: Some(Outcome::of_session(&each)), monitors, ..self }
    }

    /// The same with what does not fit: no fault found may mean nothing then.
    #[must_use]
    pub fn with_misfits(self, misfits: &[Misfit]) -> Self {
        let found =
            matches!(self.outcome, Some(Outcome::Fault | Outcome::CannotTell | Outcome::Pending));
        let prevented = !found && misfits.iter().any(|m| m.prevents_judging());
        let outcome = if prevented { Some(Outcome::NotJudged) } else { self.outcome };
        Self { outcome, warnings: warnings(misfits), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::{Candidate, Evidence, StatusByte, Transition};
    use offbd_core::engine::Output;
    use offbd_core::vocabulary::{FaultKind, FaultStatus, SimTime};

    /// A confirmed stuck ball with these causes, as the verdict takes it.
    fn stuck(candidates: Vec<Candidate>) -> JudgedView {
        let mut byte = StatusByte::default();
        byte.failed();
        byte.confirm(false);
        let (code, at) = (FaultCode::StuckBall, SimTime::new(1.0).unwrap());
        let suspicion = Suspicion { onset: None, kind: None, candidates };
        let (status, evidence) = (FaultStatus::Confirmed, Evidence::default());
        let transition = Transition { at, code, status, byte, suspicion, evidence };
        let mut verdict = Verdict::default();
        verdict.take(&Output::Transition(Box::new(transition)));
        verdict.monitors(&State::default()).swap_remove(code as usize)
    }

    #[test]
    fn causes_in_different_parts_cannot_be_told() {
        let ball = Candidate { code: FaultCode::StuckBall, kind: None, weight: 0.6 };
        let kind = Some(FaultKind::Dead);
        let servo = Candidate { code: FaultCode::XServo, kind, weight: 0.4 };
        let found = stuck(vec![ball, servo]);
        assert_eq!(found.outcome, Outcome::CannotTell);
        let named: Vec<(&str, f64)> =
            found.candidates.iter().map(|c| (c.code.as_str(), c.weight)).collect();
        assert_eq!(named, [("stuck_ball", 0.6), ("x_servo", 0.4)]);
        assert_eq!(stuck(vec![ball, ball]).outcome, Outcome::Fault);
        assert_eq!(stuck(Vec::new()).outcome, Outcome::Fault);
    }

    #[test]
    fn a_session_is_what_is_worst_or_least_known() {
        use Outcome::{CannotTell, Fault, NoFault, NotJudged, NotLearnt, PartlyJudged, Pending};
        let cases = [
            (vec![NoFault, NoFault], NoFault),
            (vec![NotJudged, NotJudged], NotJudged),
            (vec![NoFault, NotJudged], PartlyJudged),
            (vec![NotLearnt, NoFault], NotLearnt),
            (vec![NotJudged, NotLearnt, NoFault], NotLearnt),
            (vec![NotJudged, Pending], Pending),
            (vec![Pending, CannotTell], CannotTell),
            (vec![NoFault, CannotTell, Fault], Fault),
        ];
        for (each, wanted) in cases {
            assert_eq!(Outcome::of_session(&each), wanted, "{each:?}");
        }
    }

    #[test]
    fn the_word_is_the_one_on_the_wire() {
        use Outcome::{CannotTell, Fault, NoFault, NotJudged, NotLearnt, PartlyJudged, Pending};
        for outcome in [Fault, CannotTell, Pending, NoFault, PartlyJudged, NotLearnt, NotJudged] {
            assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.as_str());
        }
    }
}

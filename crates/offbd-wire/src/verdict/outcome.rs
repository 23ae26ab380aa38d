//! The results of the monitors and of the session, and how much was judged.
//!
//! No fault line does not mean no fault: a monitor that could not judge, a rig that is not
//! learnt, and causes that cannot be told apart each have their own result.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{CandidateView, SummaryView, Verdict, candidate_view, warnings};
use crate::words::{CodeWord, KindWord};
use offbd_core::diagnosis::{FaultMemory, Suspicion};
use offbd_core::engine::{Misfit, MonitorState, Reach, State};
use offbd_core::vocabulary::{FaultCode, PerAxis};

/// The result of a session, or of one monitor in a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum Outcome {
    /// A fault was confirmed.
    #[serde(rename = "fault")]
    Fault,
    /// A fault was confirmed, but causes in different parts of the rig, or a wrong unit of the
    /// positions, would explain it equally; or none was, and the level of a servo's axis differs from
    /// that of the rig's sessions, which a servo that is off explains as well as a rig that was moved.
    #[serde(rename = "cannot tell")]
    CannotTell,
    /// A test has failed, and nothing was confirmed.
    #[serde(rename = "pending")]
    Pending,
    /// No fault was found, although the tests have judged for long enough to confirm one; for a
    /// session: every monitor has.
    #[serde(rename = "no fault")]
    NoFault,
    /// Only for a session: no fault, but some monitors have not judged.
    #[serde(rename = "partly judged")]
    PartlyJudged,
    /// No fault, but the rig is not calibrated, so that faults of its servos and its ball cannot
    /// be confirmed.
    #[serde(rename = "not learnt")]
    NotLearnt,
    /// Judged for less time than the confirmation of a fault takes.
    #[serde(rename = "not judged")]
    NotJudged,
}

impl Outcome {
    /// Returns the word used in JSON.
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

    /// Returns the word for people, who know a pending fault as a suspected one, and a rig that is
    /// learnt as a calibrated one.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Pending => "suspected",
            Self::NotLearnt => "not calibrated",
            other => other.as_str(),
        }
    }

    /// Returns the result of a session whose monitors have the results `each`: the most
    /// severe finding, or else the least that is known.
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

/// The result of one monitor in a session.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JudgedView {
    pub code: CodeWord,
    /// Time of the session for which it could judge, s.
    pub judged_s: f64,
    /// That time as a fraction of the session from its first to its last sample, 0 to 1.
    pub judged_share: f64,
    pub outcome: Outcome,
    /// Causes that would explain the evidence equally, heaviest first; empty if there is only
    /// one.
    pub candidates: Vec<CandidateView>,
    /// The failure modes of its confirmed fault, each with the time at which it was first named;
    /// absent if there are none, or if an earlier version stored the summary without them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub kinds: Vec<NamedKindView>,
}

/// A failure mode that a confirmed fault was given.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct NamedKindView {
    pub kind: KindWord,
    /// Time at which it was first named, s on the device's clock.
    pub t_s: f64,
    /// Its weight among the candidates, in (0, 1]: of the last kind as in the fault's record, of
    /// an earlier one the largest; null if unknown.
    pub weight: Option<f64>,
}

impl Verdict {
    /// Returns the result of each monitor, in the order of [`FaultCode::ALL`], of a session
    /// that leaves the engine in `state` and with `memory`.
    #[must_use]
    pub fn monitors(&self, state: &State, memory: &FaultMemory) -> Vec<JudgedView> {
        let view = |(&code, monitor)| self.judged_view(code, monitor, memory);
        FaultCode::ALL.iter().zip(&state.monitors).map(view).collect()
    }

    fn judged_view(
        &self,
        code: FaultCode,
        monitor: &MonitorState,
        memory: &FaultMemory,
    ) -> JudgedView {
        // The weights of the kinds change while a fault lasts; its record has the present ones.
        let record = memory.record(code).suspicion.as_deref();
        let record = record.filter(|_| self.confirmed.contains(&code));
        let suspected = record.or(self.suspected[code as usize].as_deref());
        let mut kinds = self.kinds(code);
        if let Some(last) = kinds.last_mut()
            && let Some(record) =
                record.filter(|record| record.kind.map(Into::into) == Some(last.kind))
        {
            last.weight = record.kind_weight();
        }
        let candidates = suspected.map(|s| s.candidates.iter().map(candidate_view).collect());
        JudgedView {
            code: code.into(),
            judged_s: monitor.judged_s,
            judged_share: monitor.judged_share,
            outcome: self.outcome(code, suspected, monitor.reach),
            candidates: candidates.unwrap_or_default(),
            kinds,
        }
    }

    /// Returns the kinds that a confirmed code was given, in the order of time.
    fn kinds(&self, code: FaultCode) -> Vec<NamedKindView> {
        let of_code = self.named.iter().filter(|named| named.code == code);
        of_code
            .map(|named| NamedKindView {
                kind: named.kind.into(),
                t_s: named.t_s,
                weight: named.weight,
            })
            .collect()
    }

    fn outcome(&self, code: FaultCode, suspected: Option<&Suspicion>, reach: Reach) -> Outcome {
        match (self.confirmed.contains(&code), suspected, reach) {
            (true, Some(suspicion), _) if is_ambiguous(suspicion) => Outcome::CannotTell,
            (true, ..) => Outcome::Fault,
            (false, Some(_), _) => Outcome::Pending,
            (false, None, Reach::Judged) => Outcome::NoFault,
            (false, None, Reach::NotLearnt) => Outcome::NotLearnt,
            (false, None, Reach::NotJudged) => Outcome::NotJudged,
        }
    }
}

/// Returns whether the candidates are in different parts of the rig.
pub(super) fn is_ambiguous(suspicion: &Suspicion) -> bool {
    let first = suspicion.candidates.first().map(|c| c.code);
    suspicion.candidates.iter().any(|c| Some(c.code) != first)
}

fn outcomes(monitors: &[JudgedView]) -> Vec<Outcome> {
    monitors.iter().map(|monitor| monitor.outcome).collect()
}

impl SummaryView {
    /// Adds the results of the monitors, and the result of the session that follows.
    #[must_use]
    pub fn with_monitors(self, monitors: Vec<JudgedView>) -> Self {
        Self { outcome: Some(Outcome::of_session(&outcomes(&monitors))), monitors, ..self }
    }

    /// Adds the root mean square of the residual along each axis, m/s².
    #[must_use]
    pub fn with_residual(self, rms_m_s2: PerAxis<Option<f64>>) -> Self {
        Self { residual_x_m_s2: rms_m_s2.x, residual_y_m_s2: rms_m_s2.y, ..self }
    }

    /// Adds the warnings of `misfits`. If one of them prevents judging and nothing was found,
    /// the result is [`Outcome::NotJudged`]; if one explains what was found as well as a fault
    /// of the servos, or leaves a servo in doubt of which nothing was found, it is
    /// [`Outcome::CannotTell`].
    #[must_use]
    pub fn with_misfits(mut self, misfits: &[Misfit]) -> Self {
        for doubted in misfits.iter().filter_map(|misfit| misfit.doubted_servo()) {
            let of_servo =
                |m: &&mut JudgedView| m.code == doubted.into() && m.outcome == Outcome::NoFault;
            if let Some(monitor) = self.monitors.iter_mut().find(of_servo) {
                monitor.outcome = Outcome::CannotTell;
                self.outcome = Some(Outcome::of_session(&outcomes(&self.monitors)));
            }
        }
        let any = |of: fn(Misfit) -> bool| misfits.iter().copied().any(of);
        let servos_only = || self.faults.iter().all(|code| FaultCode::from(*code).axis().is_some());
        let outcome = match self.outcome {
            Some(Outcome::Fault) if any(Misfit::excuses_servos) && servos_only() => {
                Some(Outcome::CannotTell)
            }
            found @ Some(Outcome::Fault | Outcome::CannotTell | Outcome::Pending) => found,
            _ if any(Misfit::prevents_judging) => Some(Outcome::NotJudged),
            other => other,
        };
        Self { outcome, warnings: warnings(misfits), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_core::diagnosis::{Candidate, Evidence, StatusByte, Transition};
    use offbd_core::vocabulary::{Axis, FaultKind, FaultStatus, SimTime};

    /// Returns the result of a confirmed stuck ball with these candidates.
    fn stuck(candidates: Vec<Candidate>) -> JudgedView {
        let mut byte = StatusByte::default();
        byte.failed();
        byte.confirm(false);
        let (code, at) = (FaultCode::StuckBall, SimTime::new(1.0).unwrap());
        let suspicion = Suspicion { onset: None, kind: None, candidates };
        let (status, evidence) = (FaultStatus::Confirmed, Evidence::default());
        let transition = Transition { at, code, status, byte, suspicion, evidence };
        let mut verdict = Verdict::default();
        verdict.take(0, &[transition]);
        verdict.monitors(&State::default(), &FaultMemory::default()).swap_remove(code as usize)
    }

    #[test]
    fn candidates_in_different_parts_make_the_outcome_cannot_tell() {
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
    fn a_wrong_unit_explains_a_servo_fault_and_no_other() {
        let scale = |scattered| Misfit::Scale { ratio: 0.1, factor: 10.0, unit_m: 1.0, scattered };
        let outcome = |code: FaultCode, misfit: Misfit| {
            let none = Verdict::default().summary("a", 2000, 0, 20.0);
            let outcome = Some(Outcome::Fault);
            let found = SummaryView { faults: vec![code.into()], outcome, ..none };
            found.with_misfits(&[misfit]).outcome
        };
        assert_eq!(outcome(FaultCode::XServo, scale(true)), Some(Outcome::CannotTell));
        assert_eq!(outcome(FaultCode::XServo, scale(false)), Some(Outcome::Fault));
        assert_eq!(outcome(FaultCode::Sensor, scale(true)), Some(Outcome::Fault));
    }

    #[test]
    fn another_level_leaves_only_a_servo_that_was_judged_in_doubt() {
        use Outcome::{CannotTell, Fault, NoFault, NotJudged, PartlyJudged};
        let level = Misfit::Level { axis: Axis::Y, off_rad: 0.05, spread_rad: 0.02 };
        let outcomes = |y_servo: Outcome| {
            let monitor = |code: FaultCode, outcome| JudgedView {
                code: code.into(),
                judged_s: 20.0,
                judged_share: 1.0,
                outcome,
                candidates: Vec::new(),
                kinds: Vec::new(),
            };
            let monitors =
                vec![monitor(FaultCode::XServo, NoFault), monitor(FaultCode::YServo, y_servo)];
            let summary = Verdict::default().summary("a", 2000, 0, 20.0).with_monitors(monitors);
            let found = summary.with_misfits(&[level]);
            (found.outcome.unwrap(), found.monitors[0].outcome, found.monitors[1].outcome)
        };
        assert_eq!(outcomes(NoFault), (CannotTell, NoFault, CannotTell));
        assert_eq!(outcomes(NotJudged), (PartlyJudged, NoFault, NotJudged));
        assert_eq!(outcomes(Fault), (Fault, NoFault, Fault));
    }

    #[test]
    fn the_kinds_of_a_fault_are_told_with_the_time_at_which_each_was_named() {
        let (code, mut byte) = (FaultCode::XServo, StatusByte::default());
        byte.failed();
        let mut verdict = Verdict::default();
        let mut take = |t_s: f64, status, kind| {
            let at = SimTime::new(t_s).unwrap();
            let candidates = vec![Candidate { code, kind: Some(FaultKind::Dead), weight: 0.5 }];
            let suspicion = Suspicion { onset: None, kind, candidates };
            let evidence = Evidence::default();
            verdict.take(0, &[Transition { at, code, status, byte, suspicion, evidence }]);
        };
        let (dead, slow) = (Some(FaultKind::Dead), Some(FaultKind::Slow));
        take(1.0, FaultStatus::Pending, slow);
        take(2.0, FaultStatus::Confirmed, None);
        take(3.0, FaultStatus::Confirmed, dead);
        take(4.0, FaultStatus::Confirmed, slow);
        take(5.0, FaultStatus::Confirmed, dead);
        let monitor =
            verdict.monitors(&State::default(), &FaultMemory::default()).swap_remove(code as usize);
        let told: Vec<_> =
            monitor.kinds.iter().map(|k| (k.kind.as_str(), k.t_s, k.weight)).collect();
        assert_eq!(told, [("dead", 3.0, Some(0.5)), ("slow", 4.0, None)]);
    }

    #[test]
    fn the_outcome_of_a_session_is_its_worst_finding_or_the_least_known() {
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
    fn as_str_equals_the_serialised_word() {
        use Outcome::{CannotTell, Fault, NoFault, NotJudged, NotLearnt, PartlyJudged, Pending};
        for outcome in [Fault, CannotTell, Pending, NoFault, PartlyJudged, NotLearnt, NotJudged] {
            assert_eq!(serde_json::to_value(outcome).unwrap(), outcome.as_str());
        }
    }
}

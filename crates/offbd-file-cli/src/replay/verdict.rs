//! The verdict in a few words, and how much of each session was judged.

use comfy_table::Table;
use offbd_wire::words::{CodeWord, StatusWord};

use crate::judge::JudgedSession;
use offbd_core::diagnosis::Profile;
use offbd_core::vocabulary::FaultCode;
use offbd_terminal::table::{self, Look};
use offbd_wire::verdict::{
    CandidateView, FaultView, JudgedView, NamedKindView, Outcome, SummaryView, fault_title,
    kind_words, weighed_causes,
};

/// The verdict on a session in a few words, in colour where stdout shows it. What was not judged beside
/// a fault has another line.
pub(super) fn coloured(session: &JudgedSession, profile: Profile) -> String {
    let mut words = words(session, profile);
    if !session.summary.faults.is_empty() {
        words = words.replace("; ", ";\n");
    }
    match look(&session.summary) {
        Some(look) => table::coloured(&words, look),
        None => words,
    }
}

/// The look of a verdict; `None` if a part of it is not known.
fn look(summary: &SummaryView) -> Option<Look> {
    match summary.outcome? {
        Outcome::CannotTell if summary.faults.is_empty() => Some(Look::Doubtful),
        Outcome::Fault | Outcome::CannotTell => Some(Look::Bad),
        Outcome::Pending => Some(Look::Doubtful),
        Outcome::NoFault => Some(Look::Good),
        Outcome::PartlyJudged | Outcome::NotLearnt | Outcome::NotJudged => None,
    }
}

/// The verdict on a session in a few words: the faults that were found, or else those
/// that were excluded, and the monitors that were not calibrated, did not judge, or have no test in
/// `profile`.
fn words(session: &JudgedSession, profile: Profile) -> String {
    if session.summary.outcome == Some(Outcome::NotJudged) {
        return Outcome::NotJudged.words().to_owned();
    }
    let found: Vec<String> = session.summary.faults.iter().map(|&c| found(session, c)).collect();
    summary_words(&session.summary, &found, profile)
}

/// The verdict of a summary, whose faults are `found`.
fn summary_words(summary: &SummaryView, found: &[String], profile: Profile) -> String {
    let of = |outcome| codes(summary, outcome, |_| true);
    let (judged, pending) = (of(Outcome::NoFault), of(Outcome::Pending));
    let has_test = |code: CodeWord| profile.has_test(code.into());
    let is_unfound = |code: CodeWord| !summary.faults.contains(&code);
    let rest = [
        (Outcome::CannotTell.words(), codes(summary, Outcome::CannotTell, is_unfound)),
        (Outcome::NotLearnt.words(), of(Outcome::NotLearnt)),
        (Outcome::NotJudged.words(), codes(summary, Outcome::NotJudged, has_test)),
        ("no test in this profile", codes(summary, Outcome::NotJudged, |code| !has_test(code))),
    ];
    let all = rest.iter().all(|(_, codes)| codes.is_empty());
    let mut words = Vec::new();
    match (found.is_empty(), pending.is_empty()) {
        (false, _) if is_excused(summary) => {
            words.push(format!("cannot tell a wrong unit from {}", found.join(", ")));
        }
        (false, _) => words.push(found.join(", ")),
        (true, false) => words.push(format!("suspected only: {}", pending.join(", "))),
        (true, true) if judged.is_empty() => {}
        (true, true) if all => words.push(Outcome::NoFault.words().to_owned()),
        (true, true) => words.push(format!("no fault of {}", judged.join(", "))),
    }
    let rest = rest.into_iter().filter(|(_, codes)| !codes.is_empty());
    words.extend(rest.map(|(result, codes)| format!("{result}: {}", codes.join(", "))));
    words.join("; ")
}

/// Whether a wrong unit explains the faults as well, as a warning says.
fn is_excused(summary: &SummaryView) -> bool {
    let unclear = |outcome| outcome == Outcome::CannotTell;
    let mut found = summary.monitors.iter().filter(|m| summary.faults.contains(&m.code));
    summary.outcome.is_some_and(unclear) && !found.any(|m| unclear(m.outcome))
}

/// The codes with a result that are `wanted`.
fn codes(
    summary: &SummaryView,
    outcome: Outcome,
    wanted: impl Fn(CodeWord) -> bool,
) -> Vec<&'static str> {
    let of = summary.monitors.iter().filter(|m| m.outcome == outcome && wanted(m.code));
    of.map(|m| m.code.as_str()).collect()
}

/// A confirmed fault with the time of its confirmation, or all causes if they cannot be told
/// apart.
fn found(session: &JudgedSession, code: CodeWord) -> String {
    // A test that passes again is not a confirmation.
    let is_confirmed =
        |f: &&FaultView| f.code == code && f.status == StatusWord::Confirmed && f.is_failing();
    let Some(FaultView { t_s: at_s, .. }) = session.faults.iter().find(is_confirmed) else {
        return code.to_string();
    };
    match session.summary.monitors.iter().find(|m| m.code == code) {
        Some(monitor) if monitor.outcome == Outcome::CannotTell => {
            format!("{} at {at_s:.2} s", causes(&monitor.candidates))
        }
        monitor => kinds(code, *at_s, monitor.map_or(&[], |monitor| &monitor.kinds)),
    }
}

fn causes(candidates: &[CandidateView]) -> String {
    let causes: Vec<_> = candidates.iter().map(|c| (c.code.into(), c.kind, c.weight)).collect();
    let causes = weighed_causes(&causes, FaultCode::as_str);
    format!("cannot tell {}", causes.join(" from "))
}

/// A fault that was confirmed at `at_s`, with its first kind, and later kinds with their times.
fn kinds(code: CodeWord, at_s: f64, kinds: &[NamedKindView]) -> String {
    let weight = |named: &NamedKindView| named.weight.unwrap_or(1.0);
    let first = kinds.first();
    let title = fault_title(code, first.map(|named| named.kind), first.map_or(1.0, weight));
    let later = kinds.iter().skip(1).map(|named| {
        format!(", later {} at {:.2} s", kind_words(named.kind, weight(named)), named.t_s)
    });
    format!("{title} at {at_s:.2} s{}", later.collect::<String>())
}

/// A table of how much of each session each monitor judged.
pub(super) fn judged<'a>(sessions: impl Iterator<Item = &'a JudgedSession>) -> Table {
    let mut heading = vec!["judged"];
    heading.extend(FaultCode::ALL.iter().map(|code| code.as_str()));
    let mut rows = table::table_of_files(&heading, &[1, 2, 3, 4]);
    for JudgedSession { summary, .. } in sessions {
        let cell = |m: &JudgedView| table::judged(m.judged_share, m.judged_s);
        let cells = summary.monitors.iter().map(cell);
        rows.add_row(std::iter::once(summary.session.clone()).chain(cells));
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use offbd_wire::words::KindWord;

    #[test]
    fn a_fault_has_its_first_kind_and_later_ones_with_their_times() {
        let named = |kind, t_s, weight| NamedKindView { kind, t_s, weight };
        let told = |named: &[NamedKindView]| kinds(CodeWord::XServo, 9001.04, named);
        assert_eq!(told(&[]), "x_servo at 9001.04 s");
        let offset = named(KindWord::Offset, 9001.5, Some(0.9));
        let slow = named(KindWord::Slow, 9602.1, Some(0.55));
        assert_eq!(
            told(&[offset, slow]),
            "x_servo (offset) at 9001.04 s, later probably slow, 55 % at 9602.10 s"
        );
        let dead = named(KindWord::Dead, 9001.5, Some(0.512));
        assert_eq!(told(&[dead]), "x_servo (probably dead, 51 %) at 9001.04 s");
        let unknown = named(KindWord::Dead, 9001.5, None);
        assert_eq!(told(&[unknown]), "x_servo (dead) at 9001.04 s");
    }
}

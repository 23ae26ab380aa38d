//! The verdict in a few words, and how much of each session was judged.

use comfy_table::Table;
use offbd_wire::words::{CodeWord, KindWord, StatusWord};

use crate::judge::JudgedSession;
use offbd_core::vocabulary::FaultCode;
use offbd_terminal::table;
use offbd_wire::verdict::{CandidateView, FaultView, JudgedView, Outcome};

/// The verdict on a session in a few words: the faults that were found, or else those
/// that were excluded, and the monitors that were not learnt or did not judge.
pub(super) fn words(session: &JudgedSession) -> String {
    if session.summary.outcome == Some(Outcome::NotJudged) {
        return Outcome::NotJudged.as_str().to_owned();
    }
    let of = |outcome| codes(session, outcome);
    let (judged, pending) = (of(Outcome::NoFault), of(Outcome::Pending));
    let (unlearnt, unjudged) = (of(Outcome::NotLearnt), of(Outcome::NotJudged));
    let found = found(session);
    let all = unlearnt.len() + unjudged.len() == 0;
    let mut words = Vec::new();
    match (found.is_empty(), pending.is_empty()) {
        (false, _) => words.push(found.join(", ")),
        (true, false) => words.push(format!("pending only: {}", pending.join(", "))),
        (true, true) if judged.is_empty() => {}
        (true, true) if all => words.push(Outcome::NoFault.as_str().to_owned()),
        (true, true) => words.push(format!("no fault of {}", judged.join(", "))),
    }
    for (outcome, codes) in [(Outcome::NotLearnt, unlearnt), (Outcome::NotJudged, unjudged)] {
        if !codes.is_empty() {
            words.push(format!("{}: {}", outcome.as_str(), codes.join(", ")));
        }
    }
    words.join("; ")
}

fn codes(session: &JudgedSession, outcome: Outcome) -> Vec<&str> {
    let monitors = session.summary.monitors.iter();
    monitors.filter(|m| m.outcome == outcome).map(|m| m.code.as_str()).collect()
}

/// The confirmed faults, each with the time of its confirmation.
fn found(session: &JudgedSession) -> Vec<String> {
    let one = |code: &CodeWord| {
        let confirmed = |f: &&FaultView| f.code == *code && f.status == StatusWord::Confirmed;
        let of_code = || session.faults.iter().filter(confirmed);
        let first = of_code().next()?;
        // The kind may have been determined later.
        let kind = of_code().find(|f| f.kind.is_some()).unwrap_or(first);
        let monitor = session.summary.monitors.iter().find(|m| m.code == *code);
        Some(format!("{} at {:.2} s", blamed(monitor, kind), first.t_s))
    };
    session.summary.faults.iter().filter_map(one).collect()
}

/// The cause of a fault, or all candidates if they cannot be told apart.
fn blamed(monitor: Option<&JudgedView>, fault: &FaultView) -> String {
    let alike = monitor.filter(|m| m.outcome == Outcome::CannotTell);
    let Some(monitor) = alike else {
        return named(fault.code, fault.kind);
    };
    let word = |c: &CandidateView| format!("{} {:.0} %", named(c.code, c.kind), 100.0 * c.weight);
    let causes: Vec<String> = monitor.candidates.iter().map(word).collect();
    format!("cannot tell {}", causes.join(" from "))
}

fn named(code: CodeWord, kind: Option<KindWord>) -> String {
    kind.map_or_else(|| code.to_string(), |kind| format!("{code} ({kind})"))
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

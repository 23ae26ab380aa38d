//! Comparison of two verdicts on the same session.

use std::io::Write;

use serde::Serialize;

use crate::judge::JudgedSession;
use offbd_terminal::table;
use offbd_wire::difference::{ComparedTransition, ComparedView, TallyView, compare, count_changes};
use offbd_wire::verdict::{FaultView, fault_title, kind_weight, status_words};

/// A JSON line for a transition of either verdict.
#[derive(Serialize)]
struct DifferenceLine<'a> {
    #[serde(rename = "type")]
    line: &'static str,
    session: &'a str,
    #[serde(flatten)]
    transition: &'a ComparedView,
}

/// The last JSON line of a session.
#[derive(Serialize)]
struct ComparisonLine<'a> {
    #[serde(rename = "type")]
    line: &'static str,
    session: &'a str,
    #[serde(flatten)]
    tally: TallyView,
    verdict_hash: &'a str,
    against_hash: &'a str,
}

/// Writes the comparison as JSON lines.
pub(super) fn write_json(
    out: &mut impl Write,
    judged: &JudgedSession,
    against: &JudgedSession,
) -> anyhow::Result<()> {
    let session = judged.summary.session.as_str();
    let all = compare(&judged.faults, &against.faults);
    for one in &all {
        let line = DifferenceLine { line: "difference", session, transition: &one.view };
        serde_json::to_writer(&mut *out, &line)?;
        writeln!(out)?;
    }
    let line = ComparisonLine {
        line: "comparison",
        session,
        tally: count_changes(&all),
        verdict_hash: &judged.summary.verdict_hash,
        against_hash: &against.summary.verdict_hash,
    };
    serde_json::to_writer(&mut *out, &line)?;
    Ok(writeln!(out)?)
}

/// Writes the comparison as a table.
pub(super) fn write_table(
    out: &mut impl Write,
    judged: &JudgedSession,
    against: &JudgedSession,
) -> anyhow::Result<()> {
    let all = compare(&judged.faults, &against.faults);
    let TallyView { same, altered, moved, only_recorded, only_replayed } = count_changes(&all);
    let name = &judged.summary.session;
    let counts = format!(
        "{same} the same, {altered} altered, {moved} moved, {only_recorded} here only, \
         {only_replayed} there only"
    );
    writeln!(out, "\n{}", table::wrapped(&format!("{name}: "), &counts))?;
    if all.is_empty() {
        return Ok(());
    }
    let heading = ["", "fault", "status", "here, s", "there, s", "moved, s"];
    let mut rows = table::table(&heading, &[3, 4, 5]);
    for one in &all {
        let recorded = one.recorded.map(|i| &judged.faults[i]);
        let replayed = one.replayed.map(|i| &against.faults[i]);
        rows.add_row(cells(one, recorded.or(replayed)));
    }
    for line in table::lines(&rows) {
        writeln!(out, "{line}")?;
    }
    Ok(())
}

fn cells(one: &ComparedTransition, fault: Option<&FaultView>) -> [String; 6] {
    let view = &one.view;
    let time = |t_s: Option<f64>| t_s.map_or_else(String::new, |t_s| format!("{t_s:.2}"));
    let word = match view.change.as_str() {
        "only_recorded" => "here only",
        "only_replayed" => "there only",
        word => word,
    };
    let weight = fault.and_then(|fault| kind_weight(fault.kind, &fault.candidates));
    let moved = view.moved_s.filter(|moved_s| *moved_s != 0.0);
    [
        word.to_owned(),
        fault_title(view.code, view.kind, weight.unwrap_or(1.0)),
        format!("{} {}", status_words(view.status.into()), view.status_byte),
        time(view.recorded_t_s),
        time(view.replayed_t_s),
        moved.map_or_else(String::new, |moved_s| format!("{moved_s:+.2}")),
    ]
}

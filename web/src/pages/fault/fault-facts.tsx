/** The record of a fault as names and values. */
import type { FaultEntry } from "../../api/types";
import type { Fact } from "../../parts/facts";
import { Term } from "../../parts/term";
import { Link } from "../../router/link";
import { calibrationsPath, sessionPath } from "../../router/paths";
import { statusWord } from "../../words/fault-state";
import { NONE, plural, seconds } from "../../words/numbers";
import { dateTime } from "../../words/time";

export function faultFacts(fault: FaultEntry, isPrinted = false): Fact[] {
  const { status, axis, command, occurrences, failed_cycles, acknowledgement } = fault;
  const sessions = plural(failed_cycles ?? 0, "session");
  return [
    ...(axis ? [["Axis", `${axis}, moved by ${command}`] satisfies Fact] : []),
    ["Status", <Term of={status}>{statusWord(status)}</Term>],
    ["Occurrences", `${occurrences} since the last clear, in ${sessions}`],
    ...occurrenceFacts("First", fault.first_occurrence, fault.first_onset_s),
    ...(occurrences > 1 ? occurrenceFacts("Last", fault.last_occurrence, fault.last_onset_s) : []),
    ...settingsFacts(fault, isPrinted),
    ["Acknowledged", doneBy(acknowledgement) ?? (occurrences ? "not yet" : NONE)],
    ["Cleared", doneBy(fault.cleared) ?? "never"],
    ...recoveryFacts(fault),
    ["Last change", dateTime(fault.changed_at)],
  ];
}

/** The time and session of an occurrence. */
function occurrenceFacts(
  which: string,
  occurrence: FaultEntry["last_occurrence"],
  onset_s?: number | null,
): Fact[] {
  if (!occurrence) return [];
  const { noted_at, session, session_id } = occurrence;
  const value = (
    <>
      {dateTime(noted_at)}, {onset_s == null ? "in" : `at ${seconds(onset_s)} of`}{" "}
      <Link to={sessionPath(session_id, onset_s)}>{session}</Link>
    </>
  );
  return [[`${which} occurrence`, value]];
}

/** What the last occurrence was judged with; on paper, nothing is folded away. */
function settingsFacts({ asset, last_occurrence }: FaultEntry, isPrinted: boolean): Fact[] {
  if (!last_occurrence) return [];
  const { calibration_id, settings_id } = last_occurrence;
  const hashes = (
    <>
      settings <code>{settings_id}</code>
      {calibration_id && (
        <>
          , calibration <code>{calibration_id}</code>
        </>
      )}
    </>
  );
  return [
    [
      "Calibration",
      calibration_id ? (
        <Link to={calibrationsPath(asset)}>one of this rig</Link>
      ) : (
        "none: the rig was not calibrated"
      ),
    ],
    [
      "Hashes",
      isPrinted ? (
        hashes
      ) : (
        <details>
          <summary>of the settings{calibration_id && " and the calibration"}</summary>
          {hashes}
        </details>
      ),
    ],
  ];
}

const doneBy = (action: FaultEntry["cleared"]) =>
  action && (
    <>
      by <b>{action.by}</b>, {dateTime(action.at)}
    </>
  );

/** The number of sessions without the fault until it heals, and then until it is erased. */
function recoveryFacts(fault: FaultEntry): Fact[] {
  const progress = (required?: number | null, counted?: number | null) =>
    `${plural(required ?? 0, "session")} without the fault; ${counted ?? 0} so far`;
  if (fault.status === "confirmed")
    return [[<Term of="healing">Heals after</Term>, progress(fault.healing_cycles, fault.healing_counter)]];
  if (fault.status === "healed")
    return [[<Term of="aging">Erased after</Term>, progress(fault.aging_cycles, fault.aging_counter)]];
  return [];
}

/** What is on record of a fault, as names and values. */
import type { FaultEntry } from "../../api/types";
import type { Fact } from "../../parts/facts";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { plural, seconds } from "../../words/numbers";
import { dateTime } from "../../words/time";

export function faultFacts(fault: FaultEntry): Fact[] {
  const { axis, command, occurrences, failed_cycles, acknowledgement } = fault;
  const sessions = plural(failed_cycles ?? 0, "session");
  return [
    ...(axis ? [["Axis", `${axis}, moved by ${command}`] satisfies Fact] : []),
    ["Occurrences", `${occurrences} since the last clear, in ${sessions}`],
    ...occurrenceFacts("First", fault.first_occurrence, fault.first_onset_s),
    ...(occurrences > 1 ? occurrenceFacts("Last", fault.last_occurrence, fault.last_onset_s) : []),
    ...judgedByFacts(fault),
    ["Acknowledged", doneBy(acknowledgement) ?? (occurrences ? "not yet" : "nothing to acknowledge")],
    ["Cleared", doneBy(fault.cleared) ?? "never"],
    ...recoveryFacts(fault),
    ["Last change", dateTime(fault.changed_at)],
  ];
}

/** When and in which session it failed anew. */
function occurrenceFacts(
  which: string,
  occurrence: FaultEntry["last_occurrence"],
  onset_s?: number | null,
): Fact[] {
  if (!occurrence) return [];
  const { noted_at, session, session_id } = occurrence;
  const value = (
    <>
      {dateTime(noted_at)}, {onset_s == null ? "in" : `${seconds(onset_s)} into the clock of`}{" "}
      <Link to={sessionPath(session_id, onset_s)}>{session}</Link>
    </>
  );
  return [[`${which} occurrence`, value]];
}

function judgedByFacts({ last_occurrence }: FaultEntry): Fact[] {
  if (!last_occurrence) return [];
  const { calibration_id, settings_id } = last_occurrence;
  const calibration = calibration_id ? (
    <>
      calibration <code>{calibration_id}</code>
    </>
  ) : (
    "a rig that has not been learnt"
  );
  return [
    ["Judged by", calibration],
    ["Settings", <code>{settings_id}</code>],
  ];
}

const doneBy = (act: FaultEntry["cleared"]) =>
  act && (
    <>
      by <b>{act.by}</b>, {dateTime(act.at)}
    </>
  );

/** How many good sessions it takes until the fault heals, and then until it is erased. */
function recoveryFacts(fault: FaultEntry): Fact[] {
  const progress = (wanted?: number | null, counted?: number | null) =>
    `${plural(wanted ?? 0, "good session")}; there were ${counted ?? 0}`;
  if (fault.status === "confirmed")
    return [["Heals after", progress(fault.healing_cycles, fault.healing_counter)]];
  if (fault.status === "healed")
    return [["Is erased after", progress(fault.aging_cycles, fault.aging_counter)]];
  return [];
}

import type { FaultEntry, HistoryEntry } from "../../api/types";
import { EmptyState } from "../../parts/empty-state";
import { codeMeaning, codeTitle, faultMeaning } from "../../words/fault-names";
import { isPresent, isRepair, presenceOf, repairNote } from "../../words/fault-state";
import { capitalised, sentence } from "../../words/sentence";
import { isFailing, isTested } from "../../words/status-byte";
import { sinceText } from "../../words/time";
import { isActive } from "./is-active";

/** Returns the latest entry about a failing test; a test that passes again is told by the one after it. */
const latestFailure = (history: HistoryEntry[]) =>
  history.find(({ by, fault }) => !by && fault && isFailing(fault))?.fault;

/** Why it is not known whether the test of a fault fails now. */
function doubtText({ session_open, communication_lost_since: lost }: FaultEntry): string {
  if (!session_open) return "No session is open.";
  return lost
    ? `The rig has been silent since ${sinceText(lost)}.`
    : "It has not been tested in the open session yet.";
}

/** Since when the test passes again or fails, and whether that is known for now. */
function presentText(fault: FaultEntry, history: HistoryEntry[]): string {
  const began = fault.last_occurrence && sinceText(fault.last_occurrence.noted_at);
  if (isFailing(fault)) {
    const isNow = isPresent({ tested: isTested(fault) }, presenceOf(fault));
    if (isNow) return `Failing${began ? ` since ${began}` : ""}.`;
    return `It failed when it was last tested${began ? `, ${began}` : ""}. ${doubtText(fault)}`;
  }
  const repair = history.find((entry) => entry.fault && isRepair(entry.fault));
  const passes = `Its test passes again${repair ? ` since ${sinceText(repair.at)}` : ""}`;
  return `${passes}; it stays on record${began ? ` (last failure ${began})` : ""}. ${repairNote(fault)}`.trimEnd();
}

/** The fault in one sentence and how it stands now, or the note that it is not active. */
export function FaultSummary({ fault, history }: { fault: FaultEntry; history: HistoryEntry[] }) {
  const { code, status } = fault;
  const failure = latestFailure(history);
  if (isActive(fault)) {
    const seen = failure
      ? sentence(failure.summary)
      : `${capitalised(faultMeaning(fault, !isFailing(fault)))}.`;
    return (
      <div>
        {!isFailing(fault) && failure && <p class="quiet small-text">At its last failure:</p>}
        <p class="sentence">{seen}</p>
        <p class={`present ${isFailing(fault) ? "status-confirmed" : "status-passed"}`}>
          {presentText(fault, history)}
        </p>
      </div>
    );
  }
  return (
    <EmptyState title={status === "cleared" ? "Nothing is on record" : "On record, but not active"}>
      <p>
        {codeTitle(code)}: {codeMeaning(code)}.{" "}
        {status === "healed"
          ? "It healed after enough sessions without the fault."
          : "It has not been detected since it was last cleared."}
      </p>
      {status === "healed" && failure && <p>At its last failure: {sentence(failure.summary)}</p>}
    </EmptyState>
  );
}

import type { FaultCode, HistoryEntry } from "../../api/types";
import { isRepair } from "../../words/fault-state";
import { dateTime } from "../../words/time";
import { TimelineText } from "./timeline-text";

/** Leaves out the change of the status that a person's clear has made: the clear itself tells it. */
function withoutEchoes(history: HistoryEntry[]): HistoryEntry[] {
  const clears = new Set(history.filter(({ what }) => what === "clear").map(({ at }) => at));
  return history.filter(({ what, by, at }) => by || what !== "cleared" || !clears.has(at));
}

/** The status changes of the fault and the actions of users, the latest first. */
export function Timeline({ history, code }: { history: HistoryEntry[]; code: FaultCode }) {
  return (
    <section class="card">
      <h2>History</h2>
      {history.length === 0 && <p class="quiet">No entries.</p>}
      <ol class="timeline">
        {withoutEchoes(history).map((entry) => (
          <li key={entry.id} class={entry.fault && isRepair(entry.fault) ? "" : `what-${entry.what}`}>
            <time dateTime={entry.at}>{dateTime(entry.at)}</time>
            <TimelineText entry={entry} code={code} />
          </li>
        ))}
      </ol>
    </section>
  );
}

import type { FaultCode, HistoryEntry } from "../../api/types";
import { isRepair } from "../../words/fault-state";
import { dateTime } from "../../words/time";
import { TimelineText } from "./timeline-text";

/** The status changes of the fault and the actions of users, the latest first. */
export function Timeline({ history, code }: { history: HistoryEntry[]; code: FaultCode }) {
  return (
    <section class="card">
      <h2>History</h2>
      {history.length === 0 && <p class="quiet">No entries.</p>}
      <ol class="timeline">
        {history.map((entry) => (
          <li key={entry.id} class={entry.fault && isRepair(entry.fault) ? "" : `what-${entry.what}`}>
            <time dateTime={entry.at}>{dateTime(entry.at)}</time>
            <TimelineText entry={entry} code={code} />
          </li>
        ))}
      </ol>
    </section>
  );
}

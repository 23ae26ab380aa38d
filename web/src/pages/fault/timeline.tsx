import type { HistoryEntry } from "../../api/types";
import { dateTime } from "../../words/time";
import { TimelineText } from "./timeline-text";

/** What happened to the fault, and who did what about it, the latest first. */
export function Timeline({ history, code }: { history: HistoryEntry[]; code: string }) {
  return (
    <section class="card">
      <h2>Over time</h2>
      {history.length === 0 && <p class="quiet">It has never happened.</p>}
      <ol class="timeline">
        {history.map((entry) => (
          <li key={entry.id} class={`what-${entry.what}`}>
            <time dateTime={entry.at}>{dateTime(entry.at)}</time>
            <TimelineText entry={entry} code={code} />
          </li>
        ))}
      </ol>
    </section>
  );
}

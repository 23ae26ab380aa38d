import type { FaultEvent } from "../../api/events";
import { Link } from "../../router/link";
import { faultPath } from "../../router/paths";
import { sentence } from "../../words/sentence";

/** Lines that are shown. */
const SHOWN = 20;

/** Changes of any fault since the page was opened, the newest first. */
export function EventFeed({ lines }: { lines: FaultEvent[] }) {
  return (
    <section class={`feed${lines.length ? "" : " none"}`} aria-label="Events">
      <h2>Events</h2>
      {lines.length === 0 && (
        <p class="quiet">None since this page was opened. Changes of any fault appear here as they happen.</p>
      )}
      <ol aria-live="polite">
        {lines.slice(0, SHOWN).map((line) => (
          <li key={line.event}>
            <Link to={faultPath(line.asset ?? "", line.code)}>
              <b>{line.asset}</b> <span class={`status-${line.status}`}>{line.status}</span>
            </Link>
            <p>{sentence(line.summary)}</p>
          </li>
        ))}
      </ol>
    </section>
  );
}

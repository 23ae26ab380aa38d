import type { FaultEvent } from "../../api/events";
import { Link } from "../../router/link";
import { faultPath } from "../../router/paths";
import { sentence } from "../../words/sentence";

/** Number of displayed lines. */
const SHOWN = 20;

/** Fault changes since the page was opened, the newest first. */
export function EventFeed({ lines }: { lines: FaultEvent[] }) {
  return (
    <section class={`feed${lines.length ? "" : " none"}`} aria-label="Events">
      <h2>Events</h2>
      {lines.length === 0 && (
        <p class="quiet">No fault changes since this page was opened. New ones appear here immediately.</p>
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

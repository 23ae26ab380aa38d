import { Link } from "../../router/link";
import { faultPath } from "../../router/paths";
import { faultTitle } from "../../words/fault-names";
import { changeOf } from "../../words/fault-state";
import { seconds } from "../../words/numbers";
import { lineSentence } from "../../words/sentence";
import type { ReceivedEvent } from "./fleet-state";

/** Number of displayed lines. */
const SHOWN = 20;

const timeOfDay = (moment: Date) => moment.toLocaleTimeString(undefined, { timeStyle: "medium" });

function Event({ line }: { line: ReceivedEvent }) {
  const { text, look } = changeOf(line);
  return (
    <li>
      <Link to={faultPath(line.asset ?? "", line.code)}>
        <time class="quiet small-text" dateTime={line.received.toISOString()}>
          {timeOfDay(line.received)}
        </time>{" "}
        <b>{line.asset}</b>: {faultTitle(line.code, line.kind)} <span class={look}>{text}</span>
      </Link>
      <p>
        {lineSentence(line)}
        {line.t_s != null && ` At ${seconds(line.t_s)} of ${line.session}.`}
      </p>
    </li>
  );
}

/** Fault changes since the page was opened, the newest first, with the time at which they arrived. */
export function EventFeed({ lines }: { lines: ReceivedEvent[] }) {
  return (
    <section class={`feed${lines.length ? "" : " none"}`} aria-label="Events">
      <h2>Events since the page was opened</h2>
      {lines.length === 0 && <p class="quiet">No fault has changed since. New events appear here at once.</p>}
      <ol aria-live="polite">
        {lines.slice(0, SHOWN).map((line) => (
          <Event key={line.event} line={line} />
        ))}
      </ol>
    </section>
  );
}

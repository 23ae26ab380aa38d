import { isCommunication } from "../../api/events";
import { Link } from "../../router/link";
import { faultPath, rigPath } from "../../router/paths";
import { communicationText } from "../../words/communication";
import { faultTitle } from "../../words/fault-names";
import { changeOf } from "../../words/fault-state";
import { seconds } from "../../words/numbers";
import { lineSentence } from "../../words/sentence";
import type { ReceivedEvent } from "./fleet-state";

/** Number of displayed lines. */
const SHOWN = 20;

const timeOfDay = (moment: Date) => moment.toLocaleTimeString(undefined, { timeStyle: "medium" });

/** What an event tells, and the view that shows more of it. */
function told(line: ReceivedEvent) {
  if (isCommunication(line)) return { ...communicationText(line), title: "Data", path: rigPath(line.asset) };
  const at = line.t_s == null ? "" : ` At ${seconds(line.t_s)} of ${line.session}.`;
  return {
    ...changeOf(line),
    sentence: lineSentence(line) + at,
    title: faultTitle(line),
    path: faultPath(line.asset ?? "", line.code),
  };
}

function Event({ line }: { line: ReceivedEvent }) {
  const { title, text, look, sentence, path } = told(line);
  return (
    <li>
      <Link to={path}>
        <time class="quiet small-text" dateTime={line.received.toISOString()}>
          {timeOfDay(line.received)}
        </time>{" "}
        <b>{line.asset}</b>: {title} <span class={look}>{text}</span>
      </Link>
      <p>{sentence}</p>
    </li>
  );
}

/** Events since the page was opened, the newest first, with the time at which they arrived. */
export function EventFeed({ lines }: { lines: ReceivedEvent[] }) {
  return (
    <section class={`feed${lines.length ? "" : " none"}`} aria-label="Events">
      <h2>Events since the page was opened</h2>
      {lines.length === 0 && <p class="quiet">No events yet. New ones appear here at once.</p>}
      <ol aria-live="polite">
        {lines.slice(0, SHOWN).map((line) => (
          <Event key={line.event} line={line} />
        ))}
      </ol>
    </section>
  );
}

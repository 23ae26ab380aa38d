import type { Session } from "../../api/types";
import { Link } from "../../router/link";
import { rigPath, sessionPath } from "../../router/paths";
import { count } from "../../words/numbers";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";
import { verdict } from "../../words/verdict";

interface Props {
  session: Session;
  isChosen: boolean;
  /** Chooses the session for a comparison, or no longer. */
  toggle: () => void;
}

export function SessionRow({ session, isChosen, toggle }: Props) {
  const result = session.verdict && verdict(session.verdict);
  return (
    <tr>
      <td>
        <input type="checkbox" aria-label={`Compare ${session.name}`} checked={isChosen} onChange={toggle} />
      </td>
      <th scope="row">
        <Link to={sessionPath(session.id)}>{session.name}</Link>
      </th>
      <td>
        {session.state === "open" ? (
          <span class="status-open">● open</span>
        ) : (
          result && <span class={result.look}>{result.text}</span>
        )}
      </td>
      <td class="name" data-word="rig">
        <Link to={rigPath(session.asset)}>{session.asset}</Link>
      </td>
      <td class="time" data-word="started">
        {dateTime(session.opened_at)}
      </td>
      <td class="n" data-word="length">
        {duration(sessionLength(session))}
      </td>
      <td class="n" data-word="samples">
        {count(session.samples)}
      </td>
    </tr>
  );
}

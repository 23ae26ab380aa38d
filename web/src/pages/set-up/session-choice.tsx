import type { Session } from "../../api/types";
import { codeTitle } from "../../words/fault-names";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";

interface Props {
  session: Session;
  isChosen: boolean;
  /** Called with the state of the box: the proposal may have changed since the rendering. */
  choose: (isWanted: boolean) => void;
}

/** A session that can be chosen for learning. */
export function SessionChoice({ session, isChosen, choose }: Props) {
  const faults = session.verdict?.faults;
  return (
    <li>
      <label class="check">
        <input type="checkbox" checked={isChosen} onChange={(e) => choose(e.currentTarget.checked)} />
        <span>
          <b>{session.name}</b>
          {session.state === "open" && <span class="status-open"> ● recording</span>}
          <br />
          <span class="quiet">
            {dateTime(session.opened_at)}, {duration(sessionLength(session) ?? 0)}
            {faults?.length ? `, fault: ${faults.map(codeTitle).join(", ")}` : ""}
          </span>
        </span>
      </label>
    </li>
  );
}

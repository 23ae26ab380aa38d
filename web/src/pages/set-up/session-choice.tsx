import type { Session } from "../../api/types";
import { sessionLength } from "../../words/session";
import { dateTime, duration } from "../../words/time";

interface Props {
  session: Session;
  isChosen: boolean;
  /** Called with what the box shows: what is proposed may have changed since it was drawn. */
  choose: (isWanted: boolean) => void;
}

/** A session that the rig can be learnt from. */
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
            {faults?.length ? `, found: ${faults.join(", ")}` : ""}
          </span>
        </span>
      </label>
    </li>
  );
}

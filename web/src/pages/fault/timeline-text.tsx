import type { FaultCode, HistoryEntry, HistoryEvent } from "../../api/types";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { faultTitle } from "../../words/fault-names";
import { isRepair } from "../../words/fault-state";
import { seconds } from "../../words/numbers";

const EVENT: Record<HistoryEvent, string> = {
  pending: "was suspected",
  confirmed: "was confirmed",
  healed: "healed",
  cleared: "was cleared",
  acknowledge: "acknowledged",
  clear: "cleared",
};

/** One entry as text: the action of a user, or a change of the fault's status. */
export function TimelineText({ entry, code }: { entry: HistoryEntry; code: FaultCode }) {
  const { what, by, fault, session_id } = entry;
  if (by)
    return (
      <span>
        <b>{by}</b> {EVENT[what]} it
      </span>
    );
  const t_s = fault?.onset_s ?? fault?.t_s;
  // Without a link if the session was deleted.
  const session = session_id ? (
    <Link to={sessionPath(session_id, t_s)}>{fault?.session}</Link>
  ) : (
    fault?.session
  );
  return (
    <span>
      {faultTitle(fault ?? { code })}{" "}
      {fault && isRepair(fault) ? <b class="status-passed">passes its test again</b> : <b>{EVENT[what]}</b>}
      {fault && (
        <>
          {" "}
          at {seconds(fault.t_s)} of {session}
        </>
      )}
    </span>
  );
}

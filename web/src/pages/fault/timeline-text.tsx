import type { HistoryEntry } from "../../api/types";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { faultTitle } from "../../words/fault-names";
import { seconds } from "../../words/numbers";

const WHAT: Record<string, string> = {
  pending: "became pending",
  confirmed: "was confirmed",
  healed: "healed",
  cleared: "is off the record",
  acknowledge: "acknowledged",
  clear: "cleared",
};

/** One entry in words: somebody did something, or the fault became something. */
export function TimelineText({ entry, code }: { entry: HistoryEntry; code: string }) {
  const { what, by, fault, session_id } = entry;
  if (by)
    return (
      <span>
        <b>{by}</b> {WHAT[what]} it
      </span>
    );
  const t_s = fault?.onset_s ?? fault?.t_s;
  // Its name alone where the session is gone.
  const session = session_id ? (
    <Link to={sessionPath(session_id, t_s)}>{fault?.session}</Link>
  ) : (
    fault?.session
  );
  return (
    <span>
      {faultTitle(code, fault?.kind)} <b>{WHAT[what] ?? what}</b>
      {fault && (
        <>
          {" "}
          at {seconds(fault.t_s)} of {session}
        </>
      )}
    </span>
  );
}

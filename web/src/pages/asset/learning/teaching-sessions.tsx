import type { Learning } from "../../../api/types";
import { Link } from "../../../router/link";
import { sessionPath } from "../../../router/paths";

/** The sessions on which the calibration is based. */
export function TeachingSessions({ sessions }: { sessions: Learning["sessions"] }) {
  if (!sessions.length) return null;
  return (
    <p class="quiet small-text">
      From{" "}
      {sessions.map(({ id, name }, i) => (
        <>
          {i > 0 && ", "}
          <Link to={sessionPath(id)}>{name}</Link>
        </>
      ))}
      .
    </p>
  );
}

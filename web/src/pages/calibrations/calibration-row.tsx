import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { ConfirmButton } from "../../parts/confirm-button";
import { useRefusal } from "../../parts/login/rights";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { actWords, sessionOf, useWords, type DoneJob } from "./history";

interface Props {
  name: string;
  job: DoneJob;
  n: number;
  sessions: Session[];
  isChosen: boolean;
  choose: () => void;
  refetch: () => Promise<void>;
}

/** One calibration of the history. */
export function CalibrationRow({ name, job, n, sessions, isChosen, choose, refetch }: Props) {
  const mayActivate = useRefusal("operator") === undefined;
  const nameOf = (id: string) => sessions.find((session) => session.id === id)?.name ?? "an older session";
  return (
    <tr>
      <th scope="row">
        <label class="check">
          <input type="radio" name="calibration" checked={isChosen} onChange={choose} /> {n}
        </label>
      </th>
      <td>{actWords(job.made_at, job.made_by)}</td>
      <td>
        {job.sessions.map(sessionOf).map((id, i) => (
          <>
            {i > 0 && ", "}
            <Link to={sessionPath(id)}>{nameOf(id)}</Link>
          </>
        ))}
      </td>
      <td>{useWords(job)}</td>
      <td>
        {!job.active && mayActivate && (
          <ConfirmButton
            word="Restore this calibration"
            question={`Restore calibration ${n}?`}
            action={() => api.activate(name, job.id).then(refetch)}
          >
            The next session is judged by it; a running one keeps the calibration that it began with.
          </ConfirmButton>
        )}
      </td>
    </tr>
  );
}

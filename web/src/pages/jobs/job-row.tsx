import { jobApi } from "../../api/jobs";
import type { Job } from "../../api/types";
import { ActionButton } from "../../parts/action-button";
import { Link } from "../../router/link";
import { calibrationsPath, rigPath, sessionPath } from "../../router/paths";
import { jobText } from "../../words/job";
import { timeAgo } from "../../words/time";

interface Props {
  job: Job;
  now: number;
  refetch: () => Promise<unknown>;
}

/** What the job does, with the way to its result. */
function Title({ job: { session_id, asset } }: Pick<Props, "job">) {
  return session_id ? (
    <Link to={sessionPath(session_id)}>Judge a session again</Link>
  ) : (
    <Link to={calibrationsPath(asset)}>Calibrate the rig</Link>
  );
}

export function JobRow({ job, now, refetch }: Props) {
  const { asset, automatic, state, progress, created_at } = job;
  const cancel = () => jobApi.cancel(job).then(refetch);
  return (
    <tr>
      <th scope="row">
        <Title job={job} />
      </th>
      <td data-word="rig">
        <Link to={rigPath(asset)}>{asset}</Link>
      </td>
      <td>
        {state === "running" ? "Running" : jobText(job, "Waiting")}{" "}
        {progress != null && <progress value={progress} max={1} aria-label={`Progress of ${asset}`} />}
      </td>
      <td data-word="started by">{automatic ? "the rig itself" : "a person"}</td>
      <td data-word="asked for">{timeAgo(created_at, now)}</td>
      <td>
        <ActionButton class="small" label={`Cancel the job of ${asset}`} action={cancel} needs="operator">
          Cancel
        </ActionButton>
      </td>
    </tr>
  );
}

import { api } from "../../api/client";
import { useQuery } from "../../hooks/use-query";
import { Link } from "../../router/link";
import { rigPath } from "../../router/paths";

/** Polling interval, ms: the rig is learnt by itself while it runs. */
const INTERVAL_MS = 5000;

/** A rig that is judged without a calibration: whether one is being made, or waits for an answer. */
export function NothingLearnt({ asset }: { asset: string }) {
  const { data: learning } = useQuery(() => api.learning(asset), `${asset} learning`, INTERVAL_MS);
  if (learning?.state === "offered")
    return (
      <p class="wait wait-good" role="status">
        <b>A calibration is ready,</b> from the motion of the rig itself. Confirm that the rig was healthy to
        start using it. <Link to={rigPath(asset)}>Confirm on the page of the rig</Link>
      </p>
    );
  if (learning?.state === "learning")
    return (
      <p role="status">
        <span class="spinner" aria-hidden="true" /> {learning.summary}
      </p>
    );
  return <p class="quiet">None yet. Until then, only sensor faults are confirmed.</p>;
}

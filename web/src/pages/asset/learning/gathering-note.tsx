import { Link } from "../../../router/link";
import { setUpPath } from "../../../router/paths";

/** A note on the automatic calibration while the service gathers motion, and the alternative. */
export function GatheringNote({ name }: { name: string }) {
  return (
    <p class="quiet small-text">
      Until then, only sensor faults are confirmed. The rig is calibrated automatically while it runs, or you
      can <Link to={setUpPath(name, "learn")}>choose the recordings yourself</Link>.
    </p>
  );
}

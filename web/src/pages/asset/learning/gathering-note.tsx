import { Link } from "../../../router/link";
import { setUpPath } from "../../../router/paths";

/** What to know, and what to do instead, while the rig gathers motion to learn from. */
export function GatheringNote({ name }: { name: string }) {
  return (
    <p class="quiet small-text">
      Until then only faults of the sensor are confirmed. The rig learns by itself while it runs; or{" "}
      <Link to={setUpPath(name, "learn")}>choose the recordings yourself</Link>.
    </p>
  );
}

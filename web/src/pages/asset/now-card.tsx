import type { State } from "../../api/types";
import { Facts } from "../../parts/facts";
import { Link } from "../../router/link";
import { sessionPath } from "../../router/paths";
import { count, degrees, millimetres, seconds } from "../../words/numbers";

/** The latest values of the rig. */
export function NowCard({ state }: { state?: State }) {
  const evidence = state?.evidence;
  const session = state?.session_id ? (
    <Link to={sessionPath(state.session_id)}>{state.session}</Link>
  ) : (
    "none open"
  );
  return (
    <section class="card">
      <h2>Now</h2>
      <Facts
        facts={[
          ["Session", session],
          ["Device's clock", seconds(state?.t_s)],
          ["Samples", count(state?.samples ?? 0)],
          ["Ball", `${millimetres(evidence?.x.position_m)}, ${millimetres(evidence?.y.position_m)}`],
          ["Command", `qx ${degrees(evidence?.y.command_rad)}, qy ${degrees(evidence?.x.command_rad)}`],
          ["Averaged over", seconds(evidence?.window_s)],
          ["Scatter of readings", millimetres(evidence?.scatter_m, 2)],
        ]}
      />
    </section>
  );
}

import type { FaultEntry } from "../../api/types";
import { Facts } from "../../parts/facts";
import { plural } from "../../words/numbers";
import { judgedShare } from "../../words/verdict";

/** Below this share of sessions in which it could find anything, the monitor is of little use. */
const LOW_RATIO = 0.5;

function sessionText(monitor: FaultEntry["monitor"]): string {
  if (!monitor) return "none is open";
  const result = monitor.complete_this_cycle ? "has come to a result" : "no result yet";
  return `${result}; judged ${judgedShare(monitor)} of it`;
}

function ratioText(use: FaultEntry["in_use"]): string {
  if (use?.ratio == null) return "no session with enough data has ended yet";
  const sessions = `${plural(use.cycles_with_data, "session")} with enough data`;
  return `${Math.round(use.ratio * 100)} %: could have found it in ${use.cycles_judged} of ${sessions}`;
}

/** Where the test stands, and whether it has had the chance to find anything. */
export function MonitorCard({ fault: { monitor, in_use } }: { fault: FaultEntry }) {
  const counter = monitor && `${monitor.counter}, of −128 (passed) to 127 (failed)`.replace("-", "−");
  const ratio = in_use?.ratio;
  return (
    <section class="card">
      <h2>Its monitor</h2>
      <Facts
        facts={[
          ["In this session", sessionText(monitor)],
          ...(counter ? [["Fault detection counter", counter] satisfies [string, string]] : []),
          ["In-use ratio", ratioText(in_use)],
        ]}
      />
      {ratio != null && ratio < LOW_RATIO && (
        <p class="note">A low ratio says that the gate is too strict for how this rig is used.</p>
      )}
    </section>
  );
}

import type { FaultEntry } from "../../api/types";
import { Facts, type Fact } from "../../parts/facts";
import { Term } from "../../parts/term";
import { plural } from "../../words/numbers";
import { judgedShare } from "../../words/verdict";

/** In-use ratio below which the monitor is of little use. */
const LOW_RATIO = 0.5;

function sessionText({ monitor, session_open }: FaultEntry): string {
  if (!session_open) return "no session is open";
  if (!monitor) return "not known until the rig sends again";
  const result = monitor.complete_this_cycle ? "test completed" : "no result yet";
  return `${result}; judged ${judgedShare(monitor)}`;
}

function ratioText(use: FaultEntry["in_use"]): string {
  if (use?.ratio == null) return "no session with enough data has ended yet";
  const sessions = `${plural(use.cycles_with_data, "session")} with enough data`;
  return `in ${use.cycles_judged} of ${sessions} (${Math.round(use.ratio * 100)} %)`;
}

/** The state of the test, and how often the monitor was able to judge. */
export function MonitorCard({ fault }: { fault: FaultEntry }) {
  const { monitor, in_use } = fault;
  const counter = monitor && `${monitor.counter}, of −128 (passed) to 127 (failed)`.replace("-", "−");
  const ratio = in_use?.ratio;
  return (
    <section class="card">
      <h2>Monitor</h2>
      <Facts
        facts={[
          ["In this session", sessionText(fault)],
          ...(counter ? [[<Term of="counter">Fault detection counter</Term>, counter] satisfies Fact] : []),
          ["Tested", ratioText(in_use)],
        ]}
      />
      {ratio != null && ratio < LOW_RATIO && (
        <p class="note">
          It is rarely tested: the rig moves too little, or the conditions for a test are too strict for it.
        </p>
      )}
      <details class="quiet small-text">
        <summary>In the words of the standards</summary>
        <p>
          The share of the sessions with enough data is the in-use ratio of SAE J1979. The fault detection
          counter is that of ISO 14229-1.
        </p>
      </details>
    </section>
  );
}

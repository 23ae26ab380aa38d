import type { FaultEntry, State } from "../../api/types";
import { stateOf } from "../../words/fault-state";
import { healthByFaults, severity, type RigHealth } from "../../words/severity";

const severityOf = (fault: FaultEntry) => severity(stateOf(fault));

export const activeFaults = (faults: FaultEntry[]) =>
  faults.filter((fault) => severityOf(fault) > 0).sort((a, b) => severityOf(b) - severityOf(a));

interface Known {
  /** Whether the page receives the states of the rig. */
  isConnected: boolean;
  /** Whether no sample has arrived for some time. */
  isSilent: boolean;
  /** Whether the rig has a calibration. */
  isLearnt: boolean;
}

export function healthOf(
  faults: FaultEntry[],
  state: State | undefined,
  { isConnected, isSilent, isLearnt }: Known,
): RigHealth {
  const byFaults = healthByFaults(faults.map(stateOf));
  if (byFaults) return byFaults;
  if (!isConnected || !state) return "unknown";
  if (!state.session_id) return "idle";
  if (isSilent) return "silent";
  if (state.unjudged) return "untested";
  return isLearnt ? "ok" : "unlearnt";
}
